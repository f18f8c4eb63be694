"""Which measurements the filter takes, what it writes down about each, and that bad ones do no harm."""

from __future__ import annotations

import dataclasses
from collections import Counter

import numpy as np
import pytest
from scipy.stats import chi2

from navfuse.aiding.base import AidingSensor
from navfuse.aiding.gnss_fix import GnssPosition, GnssVelocity
from navfuse.filters.ekf import FilterSettings
from navfuse.imu.increments import to_increments
from navfuse.simulation import car_drive, simulate
from reference.engine_runs import MEMS, run_filter, start_at
from reference.navigation_algebra import position_e

SD = ([1.0, 1.0, 2.0], [0.05] * 3, np.radians([0.5, 0.5, 2.0]))
LOGS = simulate(car_drive(120.0, seed=11, standing=5.0), MEMS, seed=12, imu_rate=50.0, gnss_rate=2.0, gnss_offset=0.013)
INCREMENTS = to_increments(LOGS.imu)
START = start_at(LOGS.motion, 0.0, *SD, np.random.default_rng(1))
METRES = 1.0 / 6.4e6


def run(gnss=LOGS.gnss, options=None, velocity=True, **arguments):
    sensors = [GnssPosition(gnss, **arguments)] + [GnssVelocity(gnss, **arguments)] * velocity
    return run_filter(START, MEMS, sensors, INCREMENTS, options)


def changed(**fields):
    """The fixes with some columns replaced."""
    return dataclasses.replace(LOGS.gnss, **fields)


def with_outliers(rows, metres=300.0):
    lat = LOGS.gnss.lat.copy()
    lat[rows] += metres * METRES
    return changed(lat=lat)


def position_errors(filter_, since=0.0):
    """Distance from the truth [m] at each output."""
    trajectory = filter_.record.trajectory()
    late = trajectory.time >= since
    truth = LOGS.motion.r_e(trajectory.time[late])
    places = zip(trajectory.lat[late], trajectory.lon[late], trajectory.height[late], strict=True)
    return np.linalg.norm(np.array([position_e(*place) for place in places]) - truth, axis=1)


def by_source(filter_, source):
    return [i for i in filter_.record.innovations if i.source == source]


def test_every_measurement_has_one_record_in_order_of_time():
    filter_ = run(outages=((30.0, 40.0),))
    for source in ("gnss_position", "gnss_velocity"):
        records = by_source(filter_, source)
        assert [i.row for i in records] == list(range(LOGS.gnss.time.size))
        assert np.array_equal([i.time for i in records], LOGS.gnss.time)
    times = [i.time for i in filter_.record.innovations]
    assert times == sorted(times)
    assert filter_.record.state_time == sorted(set(times))


def test_the_record_holds_normalised_innovations():
    for innovation in run().record.innovations:
        assert innovation.z.shape == innovation.sd.shape == (3,)
        assert np.all(innovation.sd > 0.0)
        assert np.max((innovation.z / innovation.sd) ** 2) <= innovation.nis * (1.0 + 1e-9)


def test_withheld_measurements_are_predicted_but_change_nothing():
    filter_ = run(outages=((30.0, 40.0),))
    inside = [i for i in filter_.record.innovations if 30.0 <= i.time < 40.0]
    assert Counter(i.status for i in inside) == {"withheld": 40}
    assert {i.status for i in filter_.record.innovations if not 30.0 <= i.time < 40.0} == {"used"}
    assert all(np.isfinite(i.nis) for i in inside)
    sd = filter_.record.trajectory().sd_position[:, 0]
    time = filter_.record.trajectory().time
    window = (time >= 30.0) & (time < 40.0)
    assert np.all(np.diff(sd[window]) > 0.0)
    assert sd[time >= 41.0][0] < sd[window][-1]


@pytest.mark.parametrize("options", [FilterSettings(), FilterSettings(open_loop=True), FilterSettings(ecef=True)])
def test_outliers_are_rejected_and_do_not_move_the_trajectory(options):
    rows = [30, 31, 77, 150]
    spoilt = run(with_outliers(rows), options)
    rejected = [i for i in spoilt.record.innovations if i.status == "rejected"]
    assert [(i.row, i.source) for i in rejected] == [(row, "gnss_position") for row in rows]
    windows = tuple((LOGS.gnss.time[row], LOGS.gnss.time[row] + 0.1) for row in rows)
    sensors = [GnssPosition(LOGS.gnss, outages=windows), GnssVelocity(LOGS.gnss)]
    without = run_filter(START, MEMS, sensors, INCREMENTS, options)
    assert np.array_equal(np.concatenate(spoilt.record.rows), np.concatenate(without.record.rows))


def test_a_small_outlier_just_over_the_gate_is_rejected():
    filter_ = run()
    innovation = by_source(filter_, "gnss_position")[100]
    gate = chi2.ppf(0.9999, 3)
    assert innovation.nis < gate
    metres = 1.3 * np.sqrt(gate) * innovation.sd[0] + abs(innovation.z[0])
    again = run(with_outliers([100], metres))
    assert by_source(again, "gnss_position")[100].status == "rejected"


def test_without_a_gate_everything_is_used():
    filter_ = run(with_outliers([30]), FilterSettings(gate_probability=1.0))
    assert {i.status for i in filter_.record.innovations} == {"used"}
    assert position_errors(filter_).max() > 5.0


def test_a_sensor_may_bring_a_gate_of_its_own():
    filter_ = run(gate=0.5, velocity=False)
    counts = Counter(i.status for i in filter_.record.innovations)
    assert 0.35 < counts["rejected"] / LOGS.gnss.time.size < 0.65
    assert {i.status for i in run(with_outliers([30]), gate=1.0).record.innovations} == {"used"}


def test_the_gate_lets_its_share_of_good_measurements_pass():
    filter_ = run(options=FilterSettings(gate_probability=0.95))
    rejected = sum(i.status == "rejected" for i in filter_.record.innovations)
    n = len(filter_.record.innovations)
    assert abs(rejected - 0.05 * n) < 3.5 * np.sqrt(0.05 * 0.95 * n)


@pytest.mark.parametrize("factor", [3.0, 10.0])
@pytest.mark.parametrize("options", [FilterSettings(), FilterSettings(open_loop=True)], ids=["closed", "open"])
def test_sigmas_that_are_too_small_do_not_make_the_filter_collapse(factor, options):
    honest = position_errors(run(options=options), since=20.0)
    optimistic = run(
        changed(sd_position=LOGS.gnss.sd_position / factor, sd_velocity=LOGS.gnss.sd_velocity / factor), options
    )
    errors = position_errors(optimistic, since=20.0)
    counts = Counter(i.status for i in optimistic.record.innovations)
    assert np.sqrt(np.mean(errors**2)) < 2.0 * np.sqrt(np.mean(honest**2))
    assert counts["used"] + counts["reset"] > 0.5 * len(optimistic.record.innovations)


def test_a_filter_that_rejects_everything_comes_round():
    """First by a gate that widens with the scatter it sees, at the latest by a reset."""
    away = np.where(LOGS.gnss.time > 30.0, 500.0 * METRES, 0.0)
    filter_ = run(changed(lat=LOGS.gnss.lat + away), velocity=False)
    records = by_source(filter_, "gnss_position")
    first = next(i for i in records if i.time > 30.0)
    taken = next(i for i in records if i.time > 30.0 and i.status in ("used", "reset"))
    between = [i for i in records if first.time <= i.time < taken.time]
    assert {i.status for i in between} == {"rejected"}
    assert len(between) >= 9
    assert 3.0 <= taken.time - first.time < 35.0
    trajectory = filter_.record.trajectory()
    truth = LOGS.motion.trajectory(trajectory.time)
    off = (trajectory.lat - truth.lat) / METRES
    assert np.abs(off[trajectory.time < 30.0]).max() < 5.0
    assert off[-1] > 250.0


def test_a_reset_leaves_a_covariance_that_can_be_used():
    away = np.where(LOGS.gnss.time > 50.0, 5e4 * METRES, 0.0)
    filter_ = run(changed(lat=LOGS.gnss.lat + away), FilterSettings(reset_count=10, reset_s=3.0))
    assert "reset" in {i.status for i in filter_.record.innovations}
    sd = np.sqrt(np.diagonal(filter_.P))
    assert np.linalg.eigvalsh(filter_.P / np.outer(sd, sd)).min() > 0.0
    assert np.array_equal(filter_.P, filter_.P.T)
    states = filter_.layout.per_state("sd")
    assert np.all(np.array(filter_.record.states)[:, 1] <= states * (1.0 + 1e-9))


class Wide(AidingSensor):
    """A measurement of many values, as a sensor of one's own may have."""

    name = "wide"
    times = np.array([1.0, 2.0])

    def __init__(self, size):
        self.size = size

    def value(self, k):
        return np.full(self.size, LOGS.motion.trajectory(self.times[k : k + 1]).height[0])

    def predict(self, nav, k):
        return np.full(self.size, nav.height)

    def noise(self, k):
        return 10.0


@pytest.mark.parametrize("size", [1, 6, 12, 13, 40])
def test_measurements_of_any_size_can_be_used(size):
    filter_ = run_filter(START, MEMS, [Wide(size)], INCREMENTS)
    assert [i.status for i in filter_.record.innovations] == ["used", "used"]
