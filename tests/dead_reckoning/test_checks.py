"""Logs in the wrong unit or of another drive are refused with one message that says what to do."""

from dataclasses import replace

import numpy as np
import pytest

from navfuse.data.aiding_logs import HeadingLog, OdometerLog
from navfuse.data.logs import GnssLog
from navfuse.dead_reckoning.checks import check_belongs_together, check_heading_unit, check_speed_unit
from navfuse.dead_reckoning.odometry import StartPoint, from_velocity
from navfuse.errors import InputError

T = np.arange(0.0, 100.0, 0.5)
COURSE = (0.5 + 0.04 * T) % (2 * np.pi)
SPEED = 9.0 + 3.0 * np.sin(0.1 * T)
VELOCITY = np.column_stack((SPEED * np.cos(COURSE), SPEED * np.sin(COURSE), np.zeros(T.size)))
TRACK = from_velocity(T, VELOCITY, StartPoint(0.8, 0.1, 0.0))
FIXES = GnssLog(T, TRACK.lat, TRACK.lon, TRACK.height, np.ones((T.size, 3)), VELOCITY, np.ones((T.size, 3)))
POSITIONS = replace(FIXES, velocity_n=None, sd_velocity=None)


@pytest.mark.parametrize("fixes", [FIXES, POSITIONS])
@pytest.mark.parametrize(("unit", "factor"), [("km/h", 3.6), ("mile/h", 2.237), ("knots", 1.944), ("mm/s", 1e3)])
def test_speeds_in_another_unit(fixes, unit, factor):
    with pytest.raises(
        InputError, match=rf"speeds are .* times those of gnss, as if they were in {unit}; convert them"
    ):
        check_speed_unit(OdometerLog(T, factor * 1.03 * SPEED), fixes)


@pytest.mark.parametrize("fixes", [FIXES, POSITIONS, FIXES.take(slice(0, 5)), POSITIONS.take(slice(0, 1))])
def test_an_odometer_that_is_off_by_its_scale_or_cannot_be_compared_passes(fixes):
    check_speed_unit(OdometerLog(T, 1.05 * SPEED), fixes)
    check_speed_unit(OdometerLog(T, -SPEED), fixes)
    check_speed_unit(OdometerLog(T + 1e6, 3.6 * SPEED), fixes)
    check_heading_unit(HeadingLog(T, COURSE), fixes)


@pytest.mark.parametrize("fixes", [FIXES, POSITIONS])
def test_headings_in_radians(fixes):
    read = HeadingLog(T, np.radians(COURSE))
    with pytest.raises(InputError, match=r"by \d+ deg if they are radians; name the column heading_rad"):
        check_heading_unit(read, fixes)
    # headings that are small and right, and wrong ones that are wrong either way
    north = replace(FIXES, velocity_n=np.column_stack((SPEED, np.zeros(T.size), np.zeros(T.size))))
    check_heading_unit(HeadingLog(T, 0.01 * np.sin(T) % (2 * np.pi)), north)
    check_heading_unit(HeadingLog(T, np.full(T.size, 0.05)), fixes)
    check_heading_unit(HeadingLog(T[:0], T[:0]), fixes)


def test_logs_that_do_not_overlap():
    with pytest.raises(InputError, match=r"covers 0\.000 \.\. 99\.500 s and gnss 500\.000 .* no fix lies inside"):
        check_belongs_together(TRACK, replace(FIXES, time=T + 500.0))
    with pytest.raises(InputError, match="gnss: there is not a single row"):
        check_belongs_together(TRACK, FIXES.take(slice(0, 0)))
    check_belongs_together(TRACK, FIXES)
