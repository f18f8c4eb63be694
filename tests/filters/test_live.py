"""A run fed as it happens: inertial samples and fixes in blocks, sensors that grow."""

from __future__ import annotations

import numpy as np
import pytest

from navfuse.aiding import GnssPosition, GnssVelocity
from navfuse.data.start import Start
from navfuse.errors import FilterError, InputError
from navfuse.filters.ekf import ErrorStateFilter, FilterSettings
from navfuse.imu.grades import grade
from navfuse.imu.increments import IncrementsBuilder, to_increments
from navfuse.simulation import car_drive, simulate

LEVER = np.array([0.5, -0.3, -1.0])


@pytest.fixture(scope="module")
def drive():
    model = grade("industrial-mems")
    logs = simulate(car_drive(duration=60.0, seed=4), model, 4, gnss_offset=0.123, lever_arm_b=LEVER)
    t = logs.truth
    first = [t.lat[0], t.lon[0], t.height[0]]
    start = Start.from_parts(t.time[0], first, t.velocity_n[0], t.attitude[0], [1, 1, 2], [0.1] * 3, [0.01, 0.01, 0.05])
    return logs, model, start


def sensors(gnss):
    return [GnssPosition(gnss, LEVER), GnssVelocity(gnss, LEVER)]


@pytest.mark.parametrize("settings", [FilterSettings(), FilterSettings(ecef=True), FilterSettings(output_period=0.0)])
def test_live_feed_equals_file_run(drive, settings):
    logs, model, start = drive
    whole = ErrorStateFilter(start, model, sensors(logs.gnss), settings)
    whole.feed(to_increments(logs.imu))

    imu, gnss = logs.imu, logs.gnss
    live = ErrorStateFilter(start, model, sensors(gnss.take(slice(0, 1))), settings)
    builder = IncrementsBuilder(imu.kind)
    known = 1
    edges = np.cumsum(np.random.default_rng(0).integers(1, 400, 200))
    for begin, end in zip(np.r_[0, edges], edges, strict=False):
        rows = slice(begin, min(end, imu.time.size))
        if rows.start >= imu.time.size:
            break
        arrived = int(np.searchsorted(gnss.time, imu.time[rows][-1], side="right"))
        if arrived > known:
            for sensor in live.sensors:
                sensor.extend(gnss.take(slice(known, arrived)))
            known = arrived
        block = builder.feed(type(imu)(imu.time[rows], imu.gyro[rows], imu.accel[rows], imu.kind))
        if len(block):
            live.feed(block)
    assert live.time == whole.time
    for name in ("nav", "s", "P"):
        assert np.array_equal(getattr(live, name), getattr(whole, name)), name
    a, b = live.record.trajectory(), whole.record.trajectory()
    assert np.array_equal(a.time, b.time)
    assert np.array_equal(a.attitude, b.attitude)
    assert np.array_equal(a.sd_position, b.sd_position)
    assert [i[:5] for i in live.record.innovations] == [i[:5] for i in whole.record.innovations]


def test_velocity_sensor_refuses_a_block_without_velocities(drive):
    logs, _, _ = drive
    sensor = GnssVelocity(logs.gnss)
    bare = simulate(car_drive(duration=30.0), grade("tactical"), sd_velocity=None).gnss
    with pytest.raises(InputError, match="has no velocities"):
        sensor.extend(bare)


def test_open_loop_warns_when_errors_leave_the_linear_range():
    """A consumer sensor in an open loop is off by degrees within minutes."""
    model = grade("consumer")
    logs = simulate(car_drive(duration=120.0, seed=2), model, 2)
    t = logs.truth
    first = [t.lat[0], t.lon[0], t.height[0]]
    start = Start.from_parts(t.time[0], first, t.velocity_n[0], t.attitude[0], [1, 1, 2], [0.1] * 3, [0.02, 0.02, 0.05])
    estimator = ErrorStateFilter(start, model, sensors(logs.gnss), FilterSettings(open_loop=True))
    estimator.feed(to_increments(logs.imu))
    notes = [note for note in estimator.record.notes if "out of the range where its errors are linear" in note]
    assert len(notes) == 1


def test_ned_refuses_the_pole_and_ecef_does_not():
    model = grade("tactical")
    logs = simulate(car_drive(duration=30.0, lat=np.radians(89.97)), model, 1)
    t = logs.truth
    first = [t.lat[0], t.lon[0], t.height[0]]
    start = Start.from_parts(t.time[0], first, t.velocity_n[0], t.attitude[0], [1, 1, 2], [0.1] * 3, [0.01, 0.01, 0.05])
    with pytest.raises(FilterError, match="ecef"):
        ErrorStateFilter(start, model, sensors(logs.gnss)).feed(to_increments(logs.imu))
    ErrorStateFilter(start, model, sensors(logs.gnss), FilterSettings(ecef=True)).feed(to_increments(logs.imu))
