from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from navfuse.analysis.consistency import nis_summary
from navfuse.analysis.metrics import compare
from navfuse.analysis.separation import separation
from navfuse.data.gps_epoch import GpsEpoch
from navfuse.data.result import Innovations, Result
from navfuse.report.verdict import judge, length, metres, moment


def verdict_of(result, truth=None, **changes):
    result = replace(result, **changes)
    metrics = {} if truth is None else {"filter": compare(result.forward, truth)}
    return judge(result, nis_summary(result.innovations), metrics)


def text_of(verdict, level=None):
    return " ".join(point.text for point in verdict.points if level in (None, point.level))


def test_a_good_run_looks_sound(drive):
    verdict = verdict_of(*drive, warnings=())
    assert verdict.level == "good"
    assert verdict.headline == "This run looks sound"
    assert [point.level for point in verdict.points] == ["info"]
    assert "Longest stretch without a used position: 21.0 s, from 1059.0 s to 1080.0 s" in text_of(verdict)


def test_cards_hold_the_numbers_that_matter(drive):
    cards = {card.label: card for card in verdict_of(*drive).cards}
    assert cards["Duration"].value == "2 min"
    assert cards["Duration"].detail == "log time 1000.0 to 1120.0 s, 10 Hz"
    assert cards["Distance"].value == "1.2 km"
    assert cards["GNSS positions used"].value == "96"
    assert cards["GNSS positions used"].detail == "3 rejected, 20 withheld"
    assert cards["Longest without a used fix"].value == "21.0 s"
    assert cards["Longest without a used fix"].detail.startswith("fixes were there: 20 withheld; from 1059.0 s")
    assert cards["Consistency"].value == "consistent"
    assert cards["Off from withheld fixes"].detail == "rms of the largest horizontal difference in 1 window, filter"
    assert "horizontal, 1 sigma, smoother; vertical" in cards["Expected error at the end"].detail
    assert "1 sigma, at 10" in cards["Expected error at worst"].detail
    assert "True error of the filter" in cards


def test_warnings_of_the_run_ask_for_a_look(drive):
    verdict = verdict_of(drive[0], warnings=("the IMU has a gap; see imu.csv",))
    assert verdict.level == "check"
    assert text_of(verdict, "check") == "The IMU has a gap; see imu.csv"
    assert verdict.headline == "Usable, but look at the points below"


def test_no_used_position_is_serious(drive):
    result = drive[0]
    cases = (
        (Innovations.empty(), "No GNSS position was offered"),
        (replace(result.innovations, status=np.full(119, "rejected")), "No GNSS position was used (119 rejected)"),
    )
    for records, words in cases:
        verdict = verdict_of(result, innovations=records)
        assert verdict.level == "bad"
        assert verdict.headline.startswith("Do not rely on this run")
        assert words in verdict.points[0].text
    assert "119 in a row from 1001.0 s to 1119.0 s; the filter, not the fixes, is probably wrong" in text_of(verdict)
    nothing = {card.label: card.value for card in verdict_of(result, innovations=Innovations.empty()).cards}
    assert nothing["GNSS positions"] == "none"


@pytest.mark.parametrize(("rejected", "level"), [(4, None), (15, "check"), (60, "bad")])
def test_many_rejections(drive, rejected, level):
    records = replace(drive[0].innovations, nis=1.0 * drive[0].innovations.dof)
    status = np.where((np.arange(119) % 2 == 0) & (np.arange(119) < 2 * rejected), "rejected", "used")
    points = [
        point
        for point in verdict_of(drive[0], innovations=replace(records, status=status)).points
        if "% of GNSS position rejected" in point.text
    ]
    assert [point.level for point in points] == ([] if level is None else [level])


@pytest.mark.parametrize(("factor", "level"), [(1.1, None), (1.4, "check"), (1.6, "bad"), (3.0, "bad")])
def test_overconfidence(drive, factor, level):
    records = drive[0].innovations
    changed = replace(records, nis=factor**2 * records.dof * np.ones(119), status=np.full(119, "used"))
    points = [
        point
        for point in verdict_of(drive[0], innovations=changed).points
        if "larger than claimed" in point.text or "as large as claimed" in point.text
    ]
    assert [point.level for point in points] == ([] if level is None else [level])
    if level:
        assert f"{factor:.1f}" in points[0].text
        told = points[0].text
        order = [told.index(key) for key in ("time_offset_s", "lever_arm_m", "imu.axes", "imu.grade", "sd_scale")]
        assert order == sorted(order)


def test_caution_is_only_noted(drive):
    records = drive[0].innovations
    verdict = verdict_of(drive[0], innovations=replace(records, nis=0.1 * records.nis), warnings=())
    assert verdict.level == "good"
    assert "times smaller than claimed" in text_of(verdict, "info")


def test_drifting_innovations_ask_for_a_look(drive):
    records = drive[0].innovations
    slow = np.sin(np.arange(119) / 10.0)[:, None] * np.ones(3)
    assert "are alike (correlation 0." in text_of(verdict_of(drive[0], innovations=replace(records, z=slow)), "check")


def test_late_measurements_are_told(drive):
    records = drive[0].innovations
    late = replace(records, status=np.where(np.arange(119) < 2, "late", records.status))
    assert "2 GNSS position measurements came too late" in text_of(verdict_of(drive[0], innovations=late), "check")


@pytest.mark.parametrize(("shrink", "level"), [(1.0, None), (2.0, "check"), (8.0, "bad")])
def test_errors_outside_three_sigma(drive, shrink, level):
    result, truth = drive
    forward = replace(result.forward, sd_velocity=result.forward.sd_velocity / shrink)
    points = [
        point
        for point in verdict_of(result, truth, forward=forward).points
        if "velocity errors of the filter" in point.text
    ]
    assert [point.level for point in points] == ([] if level is None else [level])


def test_worst_points_come_first(drive):
    records = drive[0].innovations
    changed = replace(records, nis=9.0 * records.dof * np.ones(119), status=np.full(119, "used"))
    levels = [point.level for point in verdict_of(drive[0], innovations=changed, warnings=("look",)).points]
    assert levels == sorted(levels, key=["bad", "check", "info"].index)
    assert levels[0] == "bad"


def test_the_error_card_has_percentiles(drive):
    cards = {card.label: card for card in verdict_of(*drive).cards}
    metric = compare(drive[0].forward, drive[1]).statistics["position_horizontal"]
    assert f"CEP50 {metres(metric.p50)}, CEP95 {metres(metric.p95)}" in cards["True error of the filter"].detail


@pytest.mark.parametrize(
    ("stretch", "seconds", "level"),
    [(1.0, 400.0, None), (2.0, 400.0, "info"), (4.0, 400.0, "check"), (9.0, 400.0, "bad"), (9.0, 120.0, None)],
)
def test_filter_and_smoother_too_far_apart(make_drive, stretch, seconds, level):
    """Sigmas smaller than what they should be are found from the difference alone, in a run long enough to tell."""
    result, _ = make_drive(seconds, 5.0)
    forward, smoothed = (
        replace(one, sd_position=one.sd_position / stretch, sd_velocity=one.sd_velocity / stretch, sd_attitude=None)
        for one in (result.forward, result.smoothed)
    )
    verdict = judge(result, nis_summary(result.innovations), {}, separation(forward, smoothed))
    points = [point for point in verdict.points if "further apart" in point.text]
    assert [point.level for point in points] == ([] if level is None else [level])
    if level == "bad":
        assert verdict.headline.startswith("Do not rely on this run")


def test_a_warning_of_the_run_is_not_told_twice(drive):
    """Warning and point say the same with other roundings: one of them is enough, and the cards agree with it."""
    records = drive[0].innovations
    changed = replace(records, nis=4.0 * records.dof * np.ones(119), status=np.full(119, "used"))
    warned = (
        "innovations are larger than claimed: gnss_position 1.9 times (0.1 % rejected); told before",
        "in the outages the solution drifted further than claimed: gnss_position 2.0 times; so it is",
    )
    verdict = verdict_of(drive[0], innovations=changed, warnings=warned)
    assert verdict.level == "bad"
    assert text_of(verdict).count("larger than claimed") == 1
    assert text_of(verdict).count("gnss.lever_arm_m, imu.axes") == 1
    assert "In the outages the solution drifted further than claimed: GNSS position 2.0 times" in text_of(verdict)
    assert "not to be relied on" in {c.label: c for c in verdict.cards}["Expected error at the end"].detail


def test_the_worst_source_is_in_the_card(drive):
    records = drive[0].innovations
    position = replace(records, nis=1.0 * records.dof, status=np.full(119, "used"))
    velocity = replace(position, nis=4.0 * records.dof, source=np.full(119, "gnss_velocity"))
    both = {name: np.concatenate((getattr(position, name), getattr(velocity, name))) for name in records.__slots__}
    card = {c.label: c for c in verdict_of(drive[0], innovations=Innovations(**both)).cards}["Consistency"]
    assert card.value == "overconfident by factor 2.00"
    assert card.detail.startswith("GNSS velocity: mean NIS 4.00")


@pytest.mark.parametrize(
    ("number", "fix", "level", "words"),
    [
        (4, "single", None, ""),
        (8, "single", "check", "8 in a row from"),
        (8, "rtk-fixed", "check", "8 of them rtk-fixed, from"),
        (12, "rtk-fixed", "bad", "the filter, not the fixes, is probably wrong here"),
        (25, "single", "bad", "the filter, not the fixes, is probably wrong here"),
    ],
)
def test_fixes_refused_in_a_row(drive, number, fix, level, words):
    result = drive[0]
    records, fixes = result.innovations, replace(result.fixes, fix=np.full(result.fixes.time.size, fix))
    inside = (np.arange(119) >= 30) & (np.arange(119) < 30 + number)
    refused = replace(records, status=np.where(inside, "rejected", "used"))
    verdict = verdict_of(result, innovations=refused, fixes=fixes)
    points = [point for point in verdict.points if "offered and refused" in point.text]
    assert [point.level for point in points] == ([] if level is None else [level])
    assert words in text_of(verdict)
    card = {c.label: c for c in verdict.cards}["Longest without a used fix"]
    assert card.detail.startswith(f"fixes were there: {number} rejected by the filter")


def test_a_trajectory_alone_is_not_blamed_for_what_it_cannot_have(drive):
    result, truth = drive
    bare = Result(result.smoothed)
    verdict = judge(bare, {}, {"solution": compare(result.smoothed, truth)}, bare=True)
    assert "No GNSS" not in text_of(verdict)
    assert not any(card.label.startswith("GNSS") for card in verdict.cards)
    good = judge(bare, {}, {}, bare=True)
    assert good.headline == "A trajectory and its errors; nothing here speaks against it"
    details = {card.label: card.detail for card in good.cards}
    assert "1 sigma, solution" in details["Expected error at the end"]


def test_moments_have_a_clock_where_it_is_known(drive):
    epoch = GpsEpoch(2374, 243258.0)
    assert moment(3.7, epoch) == "3.7 s (19:34:03 UTC)"
    assert moment(3.7, None) == "3.7 s"
    verdict = verdict_of(drive[0], epoch=epoch)
    assert "from 1059.0 s (19:51:39 UTC) to 1080.0 s (19:52:00 UTC)" in text_of(verdict)
    assert "from 2025-07-08 19:50:40 UTC" in verdict.cards[0].detail


@pytest.mark.parametrize("sd", [None, np.full((1201, 3), np.nan)])
def test_an_accuracy_that_is_not_known(drive, sd):
    result = drive[0]
    unknown = {
        card.label: card.value
        for card in verdict_of(replace(result, smoothed=replace(result.smoothed, sd_position=sd))).cards
    }
    assert unknown["Expected error"] == "unknown"


def test_an_accuracy_that_is_known_in_part(drive):
    result = drive[0]
    sd = result.smoothed.sd_position.copy()
    worst = np.argmax(np.hypot(sd[:, 0], sd[:, 1]))
    sd[:300] = np.nan
    cards = {
        card.label: card
        for card in verdict_of(replace(result, smoothed=replace(result.smoothed, sd_position=sd))).cards
    }
    assert worst >= 300
    assert f"at {result.smoothed.time[worst]:.1f} s" in cards["Expected error at worst"].detail


@pytest.mark.parametrize(("factor", "text"), [(1.15, "nearly consistent"), (1.6, "overconfident by factor 1.60")])
def test_a_small_excess_is_no_alarm(drive, factor, text):
    records = drive[0].innovations
    changed = replace(records, nis=factor**2 * records.dof * np.ones(119), status=np.full(119, "used"))
    cards = {card.label: card.value for card in verdict_of(drive[0], innovations=changed).cards}
    assert cards["Consistency"] == text


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.0, "0.0 s"),
        (99.94, "99.9 s"),
        (100.0, "1 min 40 s"),
        (3599.6, "1 h 00 min"),
        (3720.0, "1 h 02 min"),
        (120.0, "2 min"),
    ],
)
def test_lengths_of_time(seconds, text):
    assert length(seconds) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.042, "4.2 cm"),
        (0.5234, "0.52 m"),
        (12.3, "12 m"),
        (3420.0, "3.4 km"),
        (250_000.0, "250 km"),
        (np.nan, "unknown"),
    ],
)
def test_lengths_in_metres(value, text):
    assert metres(value) == text
