"""Shortcuts for tests of the engine: the truth as navigation states, and the mechanization alone."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from navfuse.data.nav_state import boxplus_navigation, to_ned
from navfuse.data.start import Start
from navfuse.filters.ekf import ErrorStateFilter, FilterSettings
from navfuse.imu.error_model import ImuErrorModel
from navfuse.imu.increments import ImuIncrements, to_increments
from navfuse.mechanization.error_dynamics import imu_state_map
from navfuse.mechanization.propagate import Propagator
from navfuse.simulation import perfect_imu, sample_times

if TYPE_CHECKING:
    from collections.abc import Sequence

    from navfuse.aiding.base import AidingSensor
    from navfuse.filters.record import FilterRecord
    from navfuse.simulation import Motion

Array = np.ndarray


def nav_at(motion: Motion, time: float, ecef: bool) -> Array:
    """Navigation array (10,) of the truth."""
    state = motion.at(time)
    nav = np.concatenate([state.r_e[0], state.v_e[0], state.q_eb[0]])
    return nav if ecef else to_ned(nav)


def perfect_increments(motion: Motion, rate: float, start: float = 0.0, end: float | None = None) -> ImuIncrements:
    """Increments of an ideal integrating sensor."""
    stamps = sample_times(start, motion.end if end is None else end, rate)
    return to_increments(perfect_imu(motion, stamps))


def cut(increments: ImuIncrements, first: int, last: int | None = None) -> ImuIncrements:
    """Increments `first` to `last` (exclusive) as a block of their own."""
    stop = None if last is None else last + 1
    return ImuIncrements(
        increments.time[first:stop], increments.inc_theta_b[first:last], increments.inc_v_b[first:last]
    )


def mechanize(increments: ImuIncrements, nav: Array, ecef: bool, out_rate: float = 0.0) -> tuple[Array, Array]:
    """Free inertial navigation.

    Returns
    -------
    nav : (10,) array
        At the end.
    rows : (r, 10) array
        At the multiples of 1 / out_rate; none with out_rate = 0.
    """
    nav = nav.copy()
    span = increments.time[-1] - increments.time[0]
    period = 1.0 / out_rate if out_rate else -1.0
    propagator = Propagator(imu_state_map(()), np.zeros(2), np.zeros((0, 3)), ecef, 60.0, period)
    rows = int(span * out_rate) + 3 if out_rate else 0
    out = propagator.buffers(rows, transitions=False)
    first = int(np.ceil(increments.time[0] * out_rate - 1e-6)) if out_rate else 0
    x, s, P, F = np.zeros(9), np.zeros(0), np.zeros((9, 9)), np.empty((0, 9))
    begin, end = float(increments.time[0]), float(increments.time[-1]) + 1.0
    acc, last = propagator.accumulator(), np.zeros(6)
    filled = propagator.advance(increments, 0, begin, end, nav, s, x, P, F, acc, first, out, last)[3]
    return nav, out[1][:filled].copy()


def start_at(
    motion: Motion,
    time: float,
    sd_position: Array,
    sd_velocity: Array,
    sd_euler: Array,
    rng: np.random.Generator | None = None,
) -> Start:
    """Start at the truth or, with `rng`, wrong by a draw from the covariance that it states."""
    nav = nav_at(motion, time, ecef=False)
    truth = motion.trajectory(np.array([time]))
    start = Start.from_parts(time, nav[:3], nav[3:6], truth.attitude[0], sd_position, sd_velocity, sd_euler)
    if rng is None:
        return start
    wrong = start.nav.copy()
    boxplus_navigation(wrong, -np.linalg.cholesky(start.P) @ rng.standard_normal(9), False)
    return Start(start.time, wrong, start.P)


MEMS = ImuErrorModel.from_datasheet(
    arw_deg_per_sqrt_h=0.2,
    vrw_mps_per_sqrt_h=0.1,
    gyro_bias_sd_dph=30.0,
    gyro_bias_tau_s=3600.0,
    accel_bias_sd_mg=0.5,
    accel_bias_tau_s=3600.0,
    gyro_scale_sd_ppm=300.0,
    accel_scale_sd_ppm=300.0,
)
"""A sensor model of 21 states for tests of the filter."""


def run_filter(
    start: Start,
    model: ImuErrorModel,
    sensors: Sequence[AidingSensor],
    increments: ImuIncrements,
    settings: FilterSettings | None = None,
    cuts: Sequence[int] = (),
) -> ErrorStateFilter:
    """A filter after all increments, fed in blocks that end before the increments numbered `cuts`."""
    filter_ = ErrorStateFilter(start, model, sensors, settings)
    edges = [0, *cuts, len(increments)]
    for first, last in pairwise(edges):
        filter_.feed(cut(increments, first, last))
    return filter_


def assert_same_record(a: FilterRecord, b: FilterRecord) -> None:
    """Two records hold the same numbers to the last bit, however they were cut into pieces."""
    empty = [np.empty(0)], [np.empty((0, 18))]
    for pieces, others, nothing in zip((a.time, a.rows), (b.time, b.rows), empty, strict=True):
        assert np.array_equal(np.concatenate(nothing + pieces), np.concatenate(nothing + others))
    assert len(a.innovations) == len(b.innovations)
    for one, other in zip(a.innovations, b.innovations, strict=True):
        assert (one.time, one.source, one.row, one.status) == (other.time, other.source, other.row, other.status)
        assert np.array_equal([one.nis, *one.z, *one.sd], [other.nis, *other.z, *other.sd], equal_nan=True)
    assert a.state_time == b.state_time
    assert np.array_equal(a.states, b.states)
    assert a.notes == b.notes
    assert a.gaps == b.gaps
    assert len(a.checkpoints) == len(b.checkpoints)
    for one, other in zip(a.checkpoints, b.checkpoints, strict=True):
        assert (one.index, one.time) == (other.index, other.time)
        assert np.array_equal(one.carried, other.carried)
