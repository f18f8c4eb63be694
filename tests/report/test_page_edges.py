"""Results at the edge of what a page can show, and texts that try to be more than text."""

from __future__ import annotations

import re
from dataclasses import replace
from html import unescape

import numpy as np
import pytest

from navfuse.data.imu_overview import ImuOverview
from navfuse.data.logs import GnssLog
from navfuse.data.result import Innovations, Result, StateHistory
from navfuse.data.trajectory import Trajectory
from navfuse.report.page import render
from reference.report_page import Page, data_of, explained, panels

HOSTILE = "<script>alert(1)</script>\"'&<img src=x onerror=alert(2)>%{y}</script>"


def checked(result, truth=None, **options):
    """The page, after what holds for every page."""
    page = render(result, truth, **options)
    found = Page(page)
    assert page.count("<script") == 4
    assert not any(name.startswith("on") for _, attributes in found.elements for name in attributes)
    assert found.all("img") == []
    assert "nan" not in re.sub(r"<script.*?</script>", "", page, flags=re.S).lower().replace("finance", "")
    shown = panels(page)
    assert set(explained(page)) == {panel["title"] for panel in shown.values() if not panel["rows"]} or HOSTILE in page
    for panel in shown.values():
        for row in panel["rows"]:
            assert row["curves"]
            for curve in row["curves"]:
                lengths = {curve[key].size for key in ("x", "y", "y2") if key in curve}
                assert len(lengths) == 1
                assert (np.diff(curve["x"]) >= 0.0).all()
    view = data_of(page)["map"]["view"]
    assert view[0] < view[1]
    assert view[2] < view[3]
    return page


def still(n, lat=0.8, lon=0.2, step=1.0):
    return Trajectory(step * np.arange(float(n)), np.full(n, lat), np.full(n, lon), np.zeros(n))


def records(m, source="odometer", dof=1, status="used", seed=0):
    z = np.full((m, 3), np.nan)
    z[:, :dof] = np.random.default_rng(seed).standard_normal((m, min(dof, 3)))
    sd = np.where(np.isnan(z), np.nan, 1.0)
    return Innovations(
        np.arange(float(m)),
        np.full(m, source),
        np.full(m, status),
        np.nansum(z**2, axis=1),
        np.full(m, dof),
        z,
        sd,
        np.arange(m),
    )


def late_only():
    one = records(1, status="late")
    nothing = np.full((1, 3), np.nan)
    return replace(one, nis=np.array([np.nan]), dof=np.array([0]), z=nothing, sd=nothing)


def test_texts_from_outside_stay_text(drive):
    result, truth = drive
    fixes = replace(result.fixes, fix=np.where(np.arange(119) % 2, HOSTILE, "rtk-fixed"))
    hostile = replace(
        result,
        innovations=replace(result.innovations, source=np.full(len(result.innovations), HOSTILE)),
        states={HOSTILE: result.states["gyro_bias"]},
        summary={HOSTILE: [HOSTILE, {"key": HOSTILE}]},
        warnings=(HOSTILE,),
        fixes=fixes,
    )
    page = checked(hostile, truth, title=HOSTILE)
    texts = " ".join(Page(page).texts)
    assert texts.count(HOSTILE) >= 5
    assert unescape(re.search(r"<title>(.*?)</title>", page)[1]) == HOSTILE


@pytest.mark.parametrize("bad", ["\x00NUL", "\u202eright to left", "\ud800half", "\x1b[31mred", "a" * 100_000])
def test_characters_that_no_page_can_hold(drive, bad):
    result = drive[0]
    named = replace(
        result,
        innovations=replace(result.innovations, source=np.full(len(result.innovations), "odometer" + bad[:50])),
        states={bad: result.states["gyro_bias"]},
        summary={bad: bad},
        warnings=(bad,),
        fixes=replace(result.fixes, fix=np.full(119, bad)),
    )
    page = checked(named, title=bad)
    page.encode("utf-8")
    assert not any(character in page for character in "\x00\u202e\x1b")
    assert len(page) < 4_000_000


def test_hundreds_of_fix_types_sources_states_and_warnings(drive):
    result = drive[0]
    many = replace(
        result,
        innovations=replace(result.innovations, source=np.array([f"sensor {k % 40}" for k in range(119)])),
        states={f"sensor.{k}": result.states["gyro_bias"] for k in range(30)},
        warnings=tuple(f"warning {k}" for k in range(500)),
        fixes=replace(result.fixes, fix=np.array([f"type {k}" for k in range(119)])),
    )
    page = checked(many)
    assert "30 more sources" in explained(page)["Innovations of other sources"]
    assert "Other sensor states" in explained(page)
    assert "more are in summary.json" in page
    names = [cloud["name"] for cloud in data_of(page)["map"]["clouds"]]
    assert [name.partition(" (")[0] for name in names[:4]] == ["type 0", "type 1", "type 10", "116 other types"]
    assert names[3].endswith("used of 116)")


@pytest.mark.parametrize("changes", [{}, {"innovations": late_only()}, {"fixes": None}])
def test_a_run_of_next_to_nothing(changes):
    result = Result(still(2), **changes)
    page = checked(result)
    assert "No GNSS position was offered" in page
    why = explained(page)
    assert "no standard deviations of position" in why["Expected position error"]
    assert "no velocity" in why["Velocity"]
    assert "no smoother was run" in why["Filter minus smoother"]
    assert "holds no GNSS fixes" in why["Number of satellites"]
    assert "no overview of the inertial log" in why["IMU rate and gaps"]
    assert data_of(page)["shading"] == []
    checked(result, still(2))


@pytest.mark.parametrize("n", [1, 2, 3])
def test_a_few_epochs(drive, n):
    result, truth = drive
    short = replace(
        result,
        forward=result.forward.take(slice(0, n)),
        smoothed=result.smoothed.take(slice(0, n)),
        innovations=result.innovations.select(np.arange(n)),
        states={name: type(one)(*(part[:n] for part in one)) for name, one in result.states.items()},
    )
    page = checked(short, truth if n > 1 else None)
    assert ("Filter minus smoother" in explained(page)) is (n == 1)


def test_ten_seconds(make_drive):
    checked(*make_drive(10.0, 10.0))


def test_all_fixes_rejected(drive):
    records = drive[0].innovations
    page = checked(replace(drive[0], innovations=replace(records, status=np.full(119, "rejected"))))
    assert "Do not rely on this run" in page
    assert data_of(page)["shading"] == [[0.0, 120.0]]
    assert "no measurement was used" in explained(page)["Normalised residuals"]
    assert "only 0 of 119 were used" in explained(page)["GNSS position sigma, reported and realised"]


def test_a_single_fix(drive):
    result = drive[0]
    page = checked(replace(result, innovations=result.innovations.select(np.array([40])), warnings=()))
    assert data_of(page)["shading"] == [[41.0, 120.0], [0.0, 41.0]]


def test_no_gnss_at_all(drive):
    page = checked(replace(drive[0], innovations=records(100), fixes=None))
    assert "No GNSS fixes in this run." in page
    why = explained(page)
    assert why["GNSS velocity sigma, reported and realised"] == "the run holds no GNSS fixes"
    assert [panel for panel in panels(page) if panel == "Innovations: odometer"]


def test_what_the_log_lacks_is_said(drive):
    why = explained(checked(drive[0]))
    assert why["GNSS velocity sigma, reported and realised"] == "no velocity in the GNSS log"
    assert why["Number of satellites"].startswith("the number of satellites is not in the GNSS log")


@pytest.mark.parametrize("dof", [1, 2, 3, 5])
def test_other_sensors_have_their_own_panels(drive, dof):
    found = panels(checked(replace(drive[0], innovations=records(60, "odometer", dof))))["Innovations: odometer"]
    expected = [(f"component {k + 1}", "sensor unit") for k in range(min(dof, 3))]
    assert [(row["label"], row["unit"]) for row in found["rows"]] == expected


@pytest.mark.parametrize(("size", "rows"), [(1, 1), (3, 3), (6, 6), (40, 6)])
def test_states_of_other_sensors(drive, size, rows):
    time = drive[0].forward.time
    history = StateHistory(time, np.ones((time.size, size)), np.ones((time.size, size)))
    page = checked(replace(drive[0], states={"odometer.scale": history}))
    found = panels(page)["Estimated odometer.scale"]
    assert len(found["rows"]) == rows
    assert found["rows"][0]["unit"] == "SI"
    assert ("more components" in page) is (size > rows)


def test_fix_types_colour_the_fixes_and_the_satellites(drive):
    result = drive[0]
    kinds = np.where(np.arange(119) < 10, "single", np.where(np.arange(119) < 50, "rtk-float", "RTK-FIXED"))
    page = checked(replace(result, fixes=replace(result.fixes, fix=kinds, n_satellites=np.arange(119) % 7 + 4)))
    clouds = {cloud["name"]: cloud["role"] for cloud in data_of(page)["map"]["clouds"]}
    taken = np.isin(result.innovations.status, ("used", "reset"))
    rows = result.innovations.row
    for kind, role in (("RTK-FIXED", "fix-rtk-fixed"), ("single", "fix-single")):
        used, every = int(np.count_nonzero(taken & (kinds[rows] == kind))), int(np.count_nonzero(kinds == kind))
        assert clouds[f"{kind} ({every})" if used == every else f"{kind} ({used} used of {every})"] == role
    satellites = panels(page)["Number of satellites"]["rows"][0]["curves"]
    assert {one["name"]: one["x"].size for one in satellites} == {"RTK-FIXED": 69, "rtk-float": 40, "single": 10}
    assert "4 to 10, median 7" in page


def test_gaps_of_the_imu_and_its_spectra(drive):
    frequency = np.linspace(0.1, 50.0, 1024)
    psd = np.full((1024, 3), 1e-6)
    imu = ImuOverview(
        np.arange(1000.0, 1120.0),
        np.full(120, 100.0),
        100.0,
        np.array([1010.0, 1050.0]),
        np.array([0.5, 2.0]),
        frequency,
        psd,
        0.0 * psd,
    )
    page = checked(replace(drive[0], imu=imu))
    rate = panels(page)["IMU rate and gaps"]["rows"]
    assert [row["label"] for row in rate] == ["rate", "gap"]
    np.testing.assert_allclose(rate[1]["curves"][0]["y"], [0.5, 2.0], rtol=1e-4)
    assert "2 gaps, 2.5 s in all, the longest 2 s after 1050.00 s" in page
    rates = panels(page)["Angular rate spectrum"]["rows"][0]["curves"][0]
    np.testing.assert_allclose(rates["y"], np.degrees(1e-3), rtol=2e-5)
    assert "all its values are equal" in explained(page)["Specific force spectrum"]


def moved(trajectory, lat, lon):
    """The same path elsewhere, by its metres east and north of the start."""
    from navfuse.core.earth import ecef_to_geodetic
    from navfuse.report.series import east_north, origin_of

    plane = east_north(trajectory, origin_of(trajectory))
    first = Trajectory(np.zeros(1), np.array([lat]), np.array([lon]), np.zeros(1))
    there = origin_of(first)
    ecef = there.r_e + plane[:, :1] * there.C_en[:, 1] + plane[:, 1:] * there.C_en[:, 0]
    geodetic = np.array([ecef_to_geodetic(*row) for row in ecef])
    return replace(trajectory, lat=geodetic[:, 0], lon=geodetic[:, 1], height=geodetic[:, 2])


@pytest.mark.parametrize(("lat", "lon"), [(-17.0, 179.9999), (89.9999, 30.0), (-90.0, 0.0)])
def test_across_the_date_line_and_at_the_poles(drive, lat, lon):
    result, truth = drive
    lat, lon = np.radians(lat), np.radians(lon)
    there = replace(
        result, forward=moved(result.forward, lat, lon), smoothed=moved(result.smoothed, lat, lon), fixes=None
    )
    page = checked(there, moved(truth, lat, lon))
    here = data_of(render(replace(result, fixes=None)))["map"]["tracks"]
    for role in ("forward", "smoothed"):
        old, new = (
            next(one for one in tracks if one["role"] == role) for tracks in (here, data_of(page)["map"]["tracks"])
        )
        if role == "forward":
            np.testing.assert_allclose(np.ptp(new["e"]), np.ptp(old["e"]), rtol=1e-3)


def test_numbers_that_are_none(drive):
    result, truth = drive

    def broken(array, rows=slice(300, 400)):
        array = array.copy()
        array[rows] = np.nan
        return array

    states = {name: StateHistory(one.time, broken(one.values), broken(one.sd)) for name, one in result.states.items()}
    forward = replace(result.forward, sd_position=broken(result.forward.sd_position, slice(None)))
    smoothed = replace(
        result.smoothed,
        velocity_n=broken(result.smoothed.velocity_n),
        sd_position=broken(result.smoothed.sd_position),
        sd_attitude=broken(result.smoothed.sd_attitude),
    )
    innovations = replace(result.innovations, z=broken(result.innovations.z, slice(3, 30)))
    fixes = replace(result.fixes, lat=broken(result.fixes.lat, slice(0, 9)))
    changed = replace(result, forward=forward, smoothed=smoothed, states=states, innovations=innovations, fixes=fixes)
    checked(changed, truth)


def test_gnss_at_rest():
    n = 600
    rng = np.random.default_rng(4)
    base = still(n)
    sd = np.full((n, 3), 0.01)
    standing = replace(
        base, velocity_n=np.zeros((n, 3)), attitude=np.zeros((n, 3)), sd_position=sd, sd_velocity=sd, sd_attitude=sd
    )
    fixes = GnssLog(base.time, base.lat + 1e-7 * rng.standard_normal(n), base.lon, base.height, np.ones((n, 3)))
    page = checked(Result(standing, standing, records(n, "gnss_position", 3), fixes=fixes))
    west, east, south, north = data_of(page)["map"]["view"]
    assert 0.9 < east - west < 50.0
    assert 0.9 < north - south < 50.0


@pytest.mark.parametrize("hours", [2, pytest.param(10, marks=pytest.mark.slow)])
def test_many_hours_stay_small(hours):
    n = 36_000 * hours
    rng = np.random.default_rng(1)
    time = 0.1 * np.arange(n)
    lat = 0.8 + 1e-7 * np.cumsum(rng.standard_normal(n))
    triad = rng.standard_normal((n, 3))
    forward = Trajectory(time, lat, np.full(n, 0.2), np.zeros(n), triad, triad, abs(triad), abs(triad), abs(triad))
    m = 3600 * hours
    position = records(m, "gnss_position", 3)
    fixes = GnssLog(position.time, lat[::10], np.full(m, 0.2), np.zeros(m), np.ones((m, 3)))
    page = checked(Result(forward, forward, position, fixes=fixes))
    assert len(page) < 4_000_000
    assert max(row["curves"][0]["x"].size for panel in panels(page).values() for row in panel["rows"]) <= 2000
