from __future__ import annotations

import itertools
import re
from base64 import b64encode
from dataclasses import replace
from hashlib import sha256

import numpy as np
import pytest
from scipy import stats

from navfuse.data.gps_epoch import GpsEpoch
from navfuse.data.result import Result
from navfuse.errors import InputError, OutputError
from navfuse.report.page import render, write_report
from reference.report_page import Page, curve, data_of, explained, packed, panels


@pytest.fixture(scope="module")
def page(drive):
    return render(*drive, title="A drive", skip_s=20.0)


def test_nothing_is_loaded_from_elsewhere(page):
    found = Page(page)
    for _, attributes in found.elements:
        assert not {"src", "srcset", "action", "formaction", "data"} & set(attributes)
    assert all(attributes["href"].startswith("#") for attributes in found.all("a"))
    assert found.all("link") == []
    style = re.search(r"<style>(.*?)</style>", page, re.S)[1]
    assert "url(" not in style
    assert "@import" not in style


def test_the_policy_lets_two_scripts_run_and_nothing_else(page):
    """Both by their hashes: neither an inline script that got in, nor a handler, nor a file could run."""
    policy = next(a["content"] for a in Page(page).all("meta") if a.get("http-equiv") == "Content-Security-Policy")
    parts = dict(part.strip().split(" ", 1) for part in policy.split(";"))
    assert parts["default-src"] == "'none'"
    own = re.search(r"<script>(.*?)</script>", page, re.S)[1].encode()
    hashes = [f"'sha256-{b64encode(sha256(text).digest()).decode()}'" for text in (packed(page, "plotly"), own)]
    assert parts["script-src"].split() == hashes
    assert "http" not in policy
    assert page.count("<script>") == 1


def test_the_plotting_library_is_inside_once(page):
    assert b"plotly.js v" in packed(page, "plotly")[:200]
    assert page.count('id="plotly"') == 1
    assert len(page) < 4_000_000


def test_head_is_readable_without_scripts(page):
    texts = " ".join(Page(page).texts)
    for expected in (
        "A drive",
        "Usable, but look at the points below",
        "3 rejected, 20 withheld",
        "the first 20 s left out",
        "Times are log time",
    ):
        assert expected in texts
    for expected in ("position horizontal [m]", "CEP95 [m]", "consistent", "filter.frame", "3 rows have no sigma"):
        assert expected in texts


def test_every_panel_has_a_place_or_a_reason_and_every_link_a_target(page):
    found = Page(page)
    drawn = [k for k, panel in enumerate(data_of(page)["panels"]) if panel["rows"]]
    places = [int(attributes["data-panel"]) for attributes in found.all("div") if "data-panel" in attributes]
    assert places == drawn
    assert list(explained(page)) == [panel["title"] for panel in data_of(page)["panels"] if not panel["rows"]]
    assert all(explained(page).values())
    identities = {attributes["id"] for _, attributes in found.elements if "id" in attributes}
    assert {attributes["href"][1:] for attributes in found.all("a")} <= identities
    assert set(re.findall(r'byId\("(\w+)"\)', page)) <= identities
    assert len(identities) == len([1 for _, attributes in found.elements if "id" in attributes])


def test_plots_have_alternatives_with_their_key_numbers(page, drive):
    found = Page(page)
    labels = [attributes["aria-label"] for attributes in found.all("div") if attributes.get("role") == "img"]
    assert len(labels) == len([panel for panel in data_of(page)["panels"] if panel["rows"]]) + 1
    for words in ("RMS north", "CEP50", "of the running means inside", "inside ±3σ", "m shown"):
        assert any(words in text for text in labels)
    error = drive[1].height - drive[0].smoothed.height
    rms = float(np.sqrt(np.mean(error**2)))
    position = next(text for text in labels if text.startswith("Position errors against truth"))
    assert f"down {rms:.3g} m" in position.split("Smoother:")[1]


def test_headings_come_in_order(page):
    levels = [int(name[1]) for name, _ in Page(page).elements if re.fullmatch(r"h[1-6]", name)]
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(after - before <= 1 for before, after in itertools.pairwise(levels))
    for attributes in Page(page).all("th"):
        assert attributes["scope"] in ("row", "col", "colgroup")


def test_every_axis_has_a_unit(page):
    for panel in panels(page).values():
        for row in panel["rows"]:
            assert row["label"]
            assert row["unit"] in ("m", "m/s", "deg", "deg/h", "mg", "ppm", "1", "%")
            assert row["curves"]
        if "x" in panel:
            assert panel["x"]["label"]
            assert panel["x"]["unit"]


def test_errors_and_envelopes_are_those_of_the_result(page, drive):
    result, truth = drive
    title = "Position errors against truth"
    error = curve(page, title, 2, "filter")
    expected = truth.height - result.forward.height
    np.testing.assert_allclose(error["y"], expected, atol=1e-4)
    np.testing.assert_allclose(error["x"], truth.time - 1000.0, atol=1e-4)
    band = curve(page, title, 2, "filter ±3σ")
    shown = np.searchsorted(truth.time - 1000.0, band["x"] - 1e-3)
    np.testing.assert_allclose(band["y2"], 3.0 * result.forward.sd_position[shown, 2], rtol=2e-5)
    assert "y" not in band
    names = [found["name"] for found in panels(page)[title]["rows"][0]["curves"]]
    assert names == ["filter ±3σ", "smoother ±3σ", "filter", "smoother"]


def test_units_are_converted_for_people(page, drive):
    states = drive[0].states
    bias = curve(page, "Estimated gyro bias", 0, "filter")["y"][-1]
    assert bias == pytest.approx(np.degrees(states["gyro_bias"].values[-1, 0]) * 3600.0, rel=2e-5)
    accel = curve(page, "Estimated accel bias", 2, "filter")["y"][-1]
    assert accel == pytest.approx(states["accel_bias"].values[-1, 2] / 9.80665e-3, rel=2e-5)
    sigma = curve(page, "Expected attitude error", 2, "smoother")["y"]
    np.testing.assert_allclose(sigma, 0.3, rtol=2e-5)


def test_measurements_are_drawn_by_status_inside_their_bounds(page):
    drawn = {found["name"]: found["y"].size for found in panels(page)["Consistency (NIS)"]["rows"][0]["curves"]}
    points = {name: drawn[name] for name in ("used", "rejected", "withheld")}
    assert points == {"used": 96, "rejected": 3, "withheld": 20}
    assert drawn["mean of 50"] == 96 - 50 + 1
    bounds = curve(page, "Consistency (NIS)", 0, "99 % of mean of 50s")
    np.testing.assert_allclose(bounds["y"], stats.chi2.ppf(0.005, 150) / 150, rtol=2e-5)
    np.testing.assert_allclose(bounds["y2"], stats.chi2.ppf(0.995, 150) / 150, rtol=2e-5)
    rejected = curve(page, "Innovations: gnss position", 0, "rejected")["y"]
    assert (np.abs(rejected) > 5.0).all()


def test_gates_are_drawn_where_they_were(page, drive):
    """One component alone is at the gate at the root of the chi-square quantile, 9 sigma outliers beyond it."""
    records = drive[0].innovations
    gate = curve(page, "Innovations: gnss position", 0, "gate")
    expected = np.sqrt(stats.chi2.ppf(0.9999, 3)) * records.sd[:, 0]
    at = np.searchsorted(records.time - 1000.0, gate["x"] - 1e-3)
    assert (gate["y"] >= expected[at] * (1.0 - 1e-4)).all()
    assert gate["y"][0] == pytest.approx(expected[0], rel=1e-4)


def test_a_gate_that_contradicts_the_record_is_not_drawn(drive):
    result = drive[0]
    strict = replace(result, innovations=replace(result.innovations, nis=np.full(119, 500.0)))
    found = panels(render(strict))["Innovations: gnss position"]["rows"][0]["curves"]
    assert "gate" not in [one["name"] for one in found]


def test_map_shows_tracks_fixes_outages_and_their_fate(page):
    data = data_of(page)
    assert {cloud["name"]: cloud["e"].size for cloud in data["map"]["clouds"]} == {
        "fixes (96 used of 119)": 119,
        "rejected (3)": 3,
        "withheld (20)": 20,
    }
    assert [track["role"] for track in data["map"]["tracks"]] == ["outage", "forward", "smoothed", "truth"]
    outage = data["map"]["tracks"][0]
    assert outage["x"][0] == pytest.approx(59.0, abs=0.2)
    assert outage["x"][-1] == pytest.approx(80.0, abs=0.2)
    assert data["shading"] == [[59.0, 80.0]]
    assert "Fix types are not in the log" in page


def test_separation_is_inside_its_own_sigmas(page, drive):
    result = drive[0]
    found = curve(page, "Filter minus smoother: position", 2, "difference")
    np.testing.assert_allclose(found["y"], result.smoothed.height - result.forward.height, atol=2e-4)
    band = curve(page, "Filter minus smoother: position", 2, "difference ±3σ")
    variance = result.forward.sd_position[:, 2] ** 2 - result.smoothed.sd_position[:, 2] ** 2
    assert band["y2"].max() == pytest.approx(3.0 * np.sqrt(variance.max()), rel=2e-5)


def test_distribution_of_the_errors_crosses_half_at_the_median(page, drive):
    result, truth = drive
    found = curve(page, "Distribution of the position errors", 0, "filter vertical")
    median = np.median(np.abs(result.forward.height - truth.height))
    assert np.interp(50.0, found["y"], found["x"]) == pytest.approx(median, rel=0.02)


def test_spikes_survive_the_thinning(make_drive):
    result, truth = make_drive(300.0, 10.0)
    height = result.forward.height.copy()
    height[1321] += 55.0
    page = render(replace(result, forward=replace(result.forward, height=height)), truth)
    error = curve(page, "Position errors against truth", 2, "filter")["y"]
    assert error.size <= 2000
    assert error.min() == pytest.approx(truth.height[1321] - height[1321], abs=2e-3)
    for panel in panels(page).values():
        for row in panel["rows"]:
            assert all(found["x"].size <= 2000 for found in row["curves"])


def test_clock_is_given_where_the_epoch_is_known(drive):
    page = render(replace(drive[0], epoch=GpsEpoch(2374, 243258.0)))
    clock = data_of(page)["clock"]
    assert (clock["week"], clock["tow"]) == (2374, 243258.0)
    assert "Begins 2025-07-08 19:50:40 UTC. Log time 0 is GPS week 2374, 243258.000 s." in page
    assert "1059.0 s (19:51:39 UTC)" in page
    assert data_of(render(drive[0]))["clock"] is None


def test_without_truth_there_are_no_errors(drive):
    page = render(drive[0])
    assert "Errors against truth" not in page
    assert not any("against truth" in title for title in panels(page))
    assert "no truth was given" in explained(page)["Errors and their distribution"]


def test_a_trajectory_alone_has_what_it_can_have(drive):
    result, truth = drive
    page = render(Result(result.smoothed), truth, bare=True)
    assert "No GNSS position was used" not in page
    assert set(explained(page)) == {
        "Filter minus smoother",
        "Innovations, residuals and NIS",
        "Sensor states, IMU rate and spectra",
    }
    assert curve(page, "Position errors against truth", 0, "solution")["y"].size == 1201
    assert {"Distribution of the position errors", "Expected velocity error", "Attitude"} <= set(panels(page))


def test_tables_count_from_and_until_what_was_asked(drive):
    result, truth = drive
    cells = [render(result, truth, skip_s=19.95, until_s=until).count("<td>501</td>") for until in (None, 70.05)]
    assert cells == [0, 2]


def test_the_file_appears_whole(drive, tmp_path):
    path = write_report(tmp_path / "report.html", *drive, title="A drive")
    assert path == tmp_path / "report.html"
    assert path.read_text(encoding="utf-8").endswith("</html>\n")
    assert [entry.name for entry in tmp_path.iterdir()] == ["report.html"]


def test_a_folder_that_is_not_there(drive, tmp_path):
    with pytest.raises(OutputError, match=r"no-such-folder"):
        write_report(tmp_path / "no-such-folder" / "report.html", *drive)


def test_a_truth_of_another_time(drive):
    result, truth = drive
    with pytest.raises(InputError, match="have no time in common"):
        render(result, replace(truth, time=truth.time + 1e6))


def test_a_result_without_epochs(drive):
    with pytest.raises(InputError, match="no epochs, so there is nothing to report"):
        render(replace(drive[0], forward=drive[0].forward.take(slice(0, 0))))


def test_the_same_result_gives_the_same_page(drive):
    assert render(*drive) == render(*drive)
