from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navfuse.errors import ConfigError
from navfuse.simulation import SatelliteOutage, SkySector
from navfuse.simulation.sky import outage_of, sector_of

DEG = math.pi / 180.0


def sector(azimuth_from=0.0, azimuth_to=90.0, elevation_below=30.0, **more):
    return SkySector.from_datasheet(
        azimuth_from_deg=azimuth_from, azimuth_to_deg=azimuth_to, elevation_below_deg=elevation_below, **more
    )


def hides(what, azimuth, elevation=10.0, heading=0.0, time=0.0):
    arrays = (np.array([[x * DEG]]) for x in (elevation, azimuth))
    return bool(what.hides(np.array([time]), *arrays, np.array([heading * DEG]))[0, 0])


@pytest.mark.parametrize(
    ("begin", "end", "inside", "outside"),
    [
        (0.0, 90.0, (0.0, 45.0, 89.9), (90.0, 180.0, 359.9)),
        (350.0, 10.0, (350.0, 359.9, 0.0, 9.9), (10.0, 180.0, 349.9)),
        (-10.0, 10.0, (350.0, 0.0, 9.9), (10.0, 349.9)),
        (10.0, 350.0, (10.0, 180.0, 349.9), (350.0, 0.0, 9.9)),
        (0.0, 360.0, (0.0, 90.0, 359.9), ()),
        (-180.0, 180.0, (0.0, 179.9, 180.0, 359.9), ()),
        (360.0, 90.0, (0.0, 45.0), (90.0, 359.0)),
        (360.0, 0.0, (0.0, 123.0), ()),
    ],
)
def test_sectors_run_clockwise_and_through_north(begin, end, inside, outside):
    what = sector(begin, end)
    for azimuth in inside:
        assert hides(what, azimuth)
        assert not hides(what, azimuth, elevation=30.0)
    for azimuth in outside:
        assert not hides(what, azimuth)


@given(st.floats(-360.0, 360.0), st.floats(0.5, 359.5), st.floats(0.0, 359.99), st.floats(-180.0, 180.0))
def test_the_vehicle_carries_its_sectors_along(begin, width, azimuth, heading):
    """In the plane: inside is where the turn from the first edge is less than the width."""
    begin = min(max(begin, -360.0), 360.0 - width)
    what = sector(begin, begin + width, relative_to="vehicle")
    turn = (azimuth - heading - begin) % 360.0
    if min(abs(turn - edge) for edge in (0.0, width, 360.0)) > 1e-6:
        assert hides(what, azimuth, heading=heading) == (turn < width)


def test_all_the_sky_and_windows():
    tunnel = sector(0.0, 360.0, 90.0, windows_s=[[10.0, 20.0], [30.0, 31.0]])
    assert hides(tunnel, 77.0, elevation=90.0, time=10.0)
    assert hides(tunnel, 77.0, elevation=5.0, time=30.5)
    for time in (9.99, 20.0, 31.0):
        assert not hides(tunnel, 77.0, time=time)
    assert hides(sector(0.0, 360.0, 89.0), 1.0, elevation=88.9)
    assert not hides(sector(0.0, 360.0, 89.0), 1.0, elevation=89.0)


def test_tables_of_a_scenario():
    keys = {"azimuth_from_deg": 1.0, "azimuth_to_deg": 2.0, "elevation_below_deg": 3.0, "relative_to": "vehicle"}
    made = sector_of(keys)
    assert (made.azimuth_from, made.relative_to) == (DEG, "vehicle")
    assert sector_of(made) is made
    outage = outage_of({"satellite": "G01", "from_s": 3})
    assert (outage.from_s, outage.to_s) == (3.0, math.inf)
    assert outage_of(outage) is outage


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: sector(400.0, 10.0), "azimuth_from of a sky sector must lie in -360 .. 360 deg, not 400 deg"),
        (lambda: sector(0.0, math.nan), "azimuth_to of a sky sector must be a number and finite"),
        (lambda: sector(20.0, 20.0), "from 20 to 20 deg is empty; all round is 0 to 360"),
        (lambda: sector(-180.0, 270.0), "from -180 to 270 deg is wider than all round"),
        (lambda: sector(elevation_below=0.0), "elevation_below of a sky sector must be more than 0"),
        (lambda: sector(elevation_below=91.0), "must be at most 90 deg, not 91 deg"),
        (lambda: sector(relative_to="east"), "must be 'north' or 'vehicle', not 'east'"),
        (lambda: sector(windows_s=[[3.0, 2.0]]), r"windows of a sky sector must be windows \[from, to\]"),
        (lambda: sector(windows_s=[1.0, 2.0]), r"must be windows \[from, to\]"),
        (
            lambda: sector(azimuth_form_deg=1.0),
            "'azimuth_form_deg': did you mean 'azimuth_from_deg'",
        ),
        (lambda: SkySector.from_datasheet(azimuth_from_deg=1.0), "a sky sector needs 'azimuth_to_deg'"),
        (lambda: sector_of([1.0, 2.0]), "sectors must hold tables of keys and values"),
        (lambda: outage_of({"satelite": "G01"}), "unknown key or unit 'satelite': did you mean 'satellite'"),
        (lambda: outage_of({"from_s": 1.0}), "a satellite outage needs 'satellite'"),
        (lambda: outage_of("G01"), "satellite_outages must hold tables of keys and values, not 'G01'"),
        (lambda: SatelliteOutage("G01", 5.0, 5.0), "the outage of satellite 'G01' must have from_s < to_s"),
        (lambda: SatelliteOutage("G01", math.nan), "from_s of a satellite outage must be a number"),
    ],
)
def test_what_is_refused(make, message):
    with pytest.raises(ConfigError, match=message):
        make()
