"""What every filter does with increments, events, gaps and gates, whatever its estimator is."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from math import isfinite
from typing import Any

import numpy as np

from navfuse.aiding.base import AidingSensor
from navfuse.core.earth import dcm_en
from navfuse.data.layout import NAVIGATION_STATES, Layout
from navfuse.data.nav_state import NavState, to_ecef
from navfuse.data.start import Start
from navfuse.errors import ConfigError, FilterError
from navfuse.filters.carrier import Carrier
from navfuse.filters.doubt import bridge, loosen
from navfuse.filters.event import note
from navfuse.filters.gate import Gate
from navfuse.filters.heading_hold import HeadingHold
from navfuse.filters.output import OutputBuffer
from navfuse.filters.record import (
    LATE,
    REJECTED,
    RESET,
    USED,
    WITHHELD,
    Checkpoint,
    FilterRecord,
    Innovation,
)
from navfuse.filters.settings import FilterSettings
from navfuse.imu.error_model import ImuErrorModel
from navfuse.imu.increments import ImuIncrements
from navfuse.imu.states import imu_blocks
from navfuse.mechanization.error_dynamics import ACC_TIME, imu_state_map
from navfuse.mechanization.propagate import TIME_TOLERANCE
from navfuse.timeline import group_events, merge_events

Array = np.ndarray

DOUBT_S = 10.0
LINEAR_ATTITUDE = np.radians(1.0)
LINEAR_POSITION = 5000.0
POLAR_LATITUDE = float(np.radians(89.95))
NOTHING = np.empty(0)


class NavigationFilter(Carrier):
    """Inertial navigation corrected by aiding sensors, fed piece by piece; base of the filters.

    A kind of filter says how the covariance is carried between events (:meth:`_make_propagator`), how a measurement is
    used (:meth:`_use`) and how the covariance is made larger (:meth:`_enlarge`).

    Feeding the same increments in blocks of any size gives bit-identical results, provided each measurement is known
    to its sensor before the increments that pass its time are fed. A measurement older than the filter is recorded as
    ``late`` and not used.

    Parameters
    ----------
    start : Start
    imu_model : ImuErrorModel
        Decides which sensor errors are estimated, and how noisy the sensor is.
    sensors : sequence of AidingSensor
    settings : FilterSettings

    Attributes
    ----------
    layout : Layout
        Names of the states.
    time : float [s]
        Where the filter stands.
    record : FilterRecord
        Output, innovations and checkpoints so far.

    Notes
    -----
    Errors are true minus estimate. In a closed loop every correction goes through
    :func:`navfuse.data.nav_state.boxplus_navigation`; in an open loop it is kept in ``x`` and carried by the same
    transition (Groves 2013, section 14.1.1).
    """

    lets_go_early = False
    """See :class:`~navfuse.filters.heading_hold.HeadingHold`."""
    unknown_heading = (
        "the filter is not linear over such an error, its solution is not to be trusted before a heading is given"
    )
    """What a user is told of a vehicle that moves with an unknown heading."""

    def __init__(
        self,
        start: Start,
        imu_model: ImuErrorModel,
        sensors: Sequence[AidingSensor] = (),
        settings: FilterSettings | None = None,
    ):
        self.settings = settings = settings or FilterSettings()
        self.sensors = tuple(sensors)
        names = [sensor.name for sensor in self.sensors]
        if len(set(names)) != len(names):
            raise ConfigError(f"aiding sensors must have different names, got {', '.join(names)}")
        blocks = imu_blocks(imu_model)
        self.layout = layout = Layout.join(blocks, [b for sensor in self.sensors for b in sensor.state_blocks()])
        n = layout.size
        sd, tau, walk = (layout.per_state(a) for a in ("sd", "tau", "walk"))
        self.propagator = self._make_propagator(
            imu_state_map(tuple(b.name for b in blocks)),
            np.array([imu_model.arw**2, imu_model.vrw**2]),
            np.stack([sd**2, walk**2, np.where(np.isfinite(tau), 1.0 / tau, 0.0)], axis=1),
        )
        self.time = float(start.time)
        self._carry(n)
        self.nav[:] = start.nav
        self.P[:9, :9] = start.P
        self.P[range(9, n), range(9, n)] = sd**2
        if settings.ecef:
            self._rotate_start()
        self.s[:] = layout.per_state("value")
        for name, (value, sd) in start.states.items():
            if name in layout:
                where = layout.slice(name)
                self.s[where.start - NAVIGATION_STATES : where.stop - NAVIGATION_STATES] = value
                self.P[range(where.start, where.stop), range(where.start, where.stop)] = np.square(sd)
        self._acc = self.propagator.accumulator()
        self._begin()
        self._linear = True
        self._emitted = self._bridged = -np.inf
        self._hold = HeadingHold(self.nav[3:6], self.lets_go_early)
        self._pointers = [int(np.searchsorted(sensor.times, self.time - TIME_TOLERANCE)) for sensor in self.sensors]
        self._index = 0
        period = settings.output_period
        self._out_next = int(np.ceil(self.time / period - 1e-6)) if period > 0 else 0
        self._F = np.empty((0, n))
        self._output = OutputBuffer(self.propagator)
        self._gates = [Gate(sensor.gate, settings) for sensor in self.sensors]
        self._sensor_sd = layout.per_state("sd")
        self.record = FilterRecord(layout)
        self._hold_heading()
        self._keep_checkpoint(0, ())
        if period == 0 or (period > 0 and abs(self._out_next * period - self.time) <= TIME_TOLERANCE):
            self._note(put=True)
            self._output.flush(self.record)

    def _make_propagator(self, imu_map: Array, noise: Array, stochastic: Array) -> Any:
        """The propagator, with the interface of :class:`navfuse.mechanization.propagate.Propagator`."""
        raise NotImplementedError

    def _begin(self) -> None:
        """What is left to do with the start covariance."""

    def _use(self, sensor: AidingSensor, k: int, limit: Callable[[int], float] | None) -> tuple[float, int, Array]:
        """Use a measurement if its normalised innovation squared passes.

        `limit` gives the largest that passes for a number of values; None only predicts. Returns the normalised
        innovation squared, the number of values and what :func:`navfuse.filters.event.take` leaves behind.
        """
        raise NotImplementedError

    def _enlarge(self, change: Callable[[Array], None]) -> None:
        """Apply a function that makes a covariance larger, in place."""
        raise NotImplementedError

    def _uncorrelate(self) -> None:
        """Drop the correlations of a held heading."""
        raise NotImplementedError

    def _finish_event(self) -> None:
        """What is left to do when all measurements of an event have been used."""
        self._uncorrelate()

    def _rotate_start(self) -> None:
        C = np.kron(np.eye(3), np.array(dcm_en(self.nav[0], self.nav[1])).reshape(3, 3))
        self.nav[:] = to_ecef(self.nav)
        self.P[:9, :9] = C @ self.P[:9, :9] @ C.T

    def feed(self, increments: ImuIncrements) -> None:
        """Take in the next increments and every measurement up to their end.

        Raises
        ------
        FilterError
            If the increments do not begin where the last ended, or the state is no longer finite.
        """
        times = increments.time
        if abs(times[0] - self.time) > TIME_TOLERANCE:
            raise FilterError(
                f"increments begin at {times[0]:.6f} s but the filter stands at {self.time:.6f} s; feed them without "
                "a hole"
            )
        pending = [
            np.asarray(sensor.times[k:], dtype=float) for sensor, k in zip(self.sensors, self._pointers, strict=True)
        ]
        if not self._last.any() and len(increments):
            self._foresee_first_rate(increments)
        at = 0
        end = float(times[-1])
        step = self._stepper(increments)
        gaps = times[1:][np.diff(times) > self.settings.gap_s]
        for t, measurements, gap in self._stops(pending, gaps, end):
            at = self._advance(step, at, t)
            if gaps.size:
                self._bridge(increments, at, ended=gap)
            self._hold_heading()
            updates: list[Innovation] = []
            late = True
            for time, which, k in measurements:
                late &= self._measure(which, k, time, updates)
            if gap or not late:
                self._finish_event()
                self._close(increments, at, tuple(updates))
        following = [p[np.searchsorted(p, end + TIME_TOLERANCE, side="right") :] for p in pending]
        horizon = min((p[0] for p in following if p.size), default=np.inf)
        self._advance(step, at, max(horizon, end + 2 * TIME_TOLERANCE))
        self._index += increments.inc_theta_b.shape[0]
        self._output.flush(self.record)

    def _stops(
        self, pending: list[Array], gaps: Array, end: float
    ) -> Iterator[tuple[float, list[tuple[float, int, int]], bool]]:
        """Moments to stop at: time, measurements (time, sensor, number), and whether a gap ends there."""
        time, sensor, row = merge_events([p[: np.searchsorted(p, end + TIME_TOLERANCE, side="right")] for p in pending])
        row += np.array(self._pointers, dtype=np.int64)[sensor] if row.size else 0
        events = list(zip(time.tolist(), sensor.tolist(), row.tolist(), strict=True))
        if gaps.size:
            events += [(t, -1, -1) for t in gaps.tolist()]
            events.sort(key=lambda event: (event[0], event[1] >= 0))
        for first, last in group_events([event[0] for event in events], TIME_TOLERANCE):
            group = events[first:last]
            gap = gaps.size > 0 and any(event[1] < 0 for event in group)
            yield events[first][0], [event for event in group if event[1] >= 0] if gap else group, gap

    def _foresee_first_rate(self, increments: ImuIncrements) -> None:
        """Before the first increment is used, its rate and specific force stand in for those of the one before."""
        dt = float(increments.time[1] - increments.time[0])
        for part, values, name in ((0, increments.inc_theta_b, "gyro_bias"), (3, increments.inc_v_b, "accel_bias")):
            self._last[part : part + 3] = values[0] / dt
            if name in self.layout:
                where = self.layout.slice(name)
                self._last[part : part + 3] -= self.s[where.start - NAVIGATION_STATES : where.stop - NAVIGATION_STATES]

    def _stepper(self, increments: ImuIncrements) -> partial[tuple[int, float, int, int]]:
        carried = self.nav, self.s, self.x, self.P, self._F, self._acc, self._last
        return self.propagator.stepper(increments, *carried, self._output.arrays)

    def _advance(self, step: partial[tuple[int, float, int, int]], at: int, t_end: float) -> int:
        output = self._output
        while True:
            at, self.time, self._out_next, output.filled = step(at, self.time, t_end, self._out_next, output.filled)
            if output.filled < output.capacity or not output.capacity:
                return at
            output.flush(self.record)

    def _close(self, increments: ImuIncrements, at: int, updates: tuple[Innovation, ...]) -> None:
        period, time = self.settings.output_period, self.time
        due = (
            abs(self._out_next * period - time) <= TIME_TOLERANCE
            if period > 0
            else period == 0 and time == increments.time[at]
        )
        states = self._note(due and time > self._emitted)
        if not self.settings.ecef and abs(self.nav[0]) > POLAR_LATITUDE:
            raise FilterError(
                f"latitude {np.degrees(self.nav[0]):.4f} deg at {time:.3f} s: north and east have no meaning so "
                'near a pole; set [filter] frame = "ecef"'
            )
        self._keep_checkpoint(at, updates)
        self.record.state_time.append(time)
        self.record.states.append(states)

    def _note(self, put: bool) -> Array:
        """Put out a row if wanted; estimates and standard deviations (2, n - 9) of the states after the ninth."""
        output, period, time = self._output, self.settings.output_period, self.time
        states = np.empty((2, self.s.size))
        if put:
            self._emitted = time
            time = self._out_next * period if period > 0 else time
            self._out_next += 1
        if not isfinite(note(self._carried, states, time, output.filled if put else -1, *output.arrays[:4])):
            raise FilterError(
                f"the navigation state is no longer finite at {self.time:.3f} s; look at the inertial data before it"
            )
        if put:
            output.added(self.record)
        return states

    def _keep_checkpoint(self, at: int, updates: tuple[Innovation, ...]) -> None:
        if self.settings.checkpoints:
            acc = self.propagator.keep(self._acc)
            self.record.checkpoints.append(
                Checkpoint(self._index + at, self.time, self._carried.copy(), updates, self._hold.direction, acc)
            )

    def nav_state(self) -> NavState:
        """The corrected navigation state where the filter stands; a copy, which stays when the filter goes on."""
        now = self._seen()
        if self.settings.open_loop:
            return now
        arrays = now.array.copy(), now.ecef, now.states.copy(), now.layout, now.w_ib_b.copy(), now.f_b.copy()
        return NavState(now.time, *arrays)

    def _seen(self) -> NavState:
        """The corrected navigation state as a sensor sees it while it is asked: in a closed loop, views."""
        nav, s, x, _ = self._views
        now = NavState(self.time, nav, self.settings.ecef, s, self.layout, self._last[:3], self._last[3:])
        return now.boxplus(x) if self.settings.open_loop else now

    def _hold_heading(self) -> None:
        if self._hold.moved:
            return
        unknown = self._hold.watch(self.nav, self.x, self.P, self.settings.ecef)
        self._uncorrelate()
        if unknown is not None:
            self.record.notes.append(
                f"the vehicle moves from {self.time:.1f} s on with a heading known to {np.degrees(unknown):.0f} deg "
                f"only: {self.unknown_heading}"
            )

    def _measure(self, which: int, k: int, time: float, updates: list[Innovation]) -> bool:
        """Use or record one measurement; True if it came too late for either."""
        sensor = self.sensors[which]
        self._pointers[which] = k + 1
        row = sensor.log_row(k)
        if time < self.time - TIME_TOLERANCE or self._acc[ACC_TIME] > 0.0:
            self.record.innovations.append(Innovation(time, sensor.name, row, LATE, np.nan, 0, NOTHING))
            return True
        withheld = sensor.withheld(k)
        keeper = self._gates[which]
        nis, d, numbers = self._use(sensor, k, None if withheld else keeper.limit)
        if not isfinite(nis):
            raise FilterError(
                f"{sensor.name} measurement {k} at {time:.3f} s cannot be used: its innovation covariance is not "
                "positive definite or a value "
                "is not finite; look at its noise and at the start covariance"
            )
        status = WITHHELD
        if not withheld:
            gate = keeper.limit(d)
            status = USED if nis <= gate else REJECTED
            keeper.watch(nis / d, time)
            if status == REJECTED and keeper.reject(time):
                first = numbers[: d + d * d].copy()
                self._enlarge(partial(loosen, sensor_sd=self._sensor_sd, factor=1.01 * nis / gate))
                again, _, numbers = self._use(sensor, k, _ungated)
                if not isfinite(again):
                    raise FilterError(f"the covariance is no longer positive definite at {time:.3f} s")
                # The innovation stays that of the update, which a smoother goes back over.
                numbers[d : d + d * d] = first[d:]
                status = RESET
                self._note_reset(sensor.name, keeper, time)
        used = status in (USED, RESET)
        if not (used and self.settings.checkpoints):
            numbers = numbers[: d + d * d].copy()
        innovation = Innovation(time, sensor.name, row, status, nis, d, numbers)
        self.record.innovations.append(innovation)
        if used:
            keeper.accept()
            updates.append(innovation)
            if self.settings.open_loop:
                self._watch_linear_range()
        return False

    def _note_reset(self, name: str, gate: Gate, time: float) -> None:
        self.record.notes.append(
            f"{name}: {gate.rejections} measurements in a row were rejected from {gate.since:.1f} s to {time:.1f} s; "
            "the covariance "
            "was enlarged to take the "
            "next one. Look at the settings of the inertial sensor, at time offsets and at the sigmas of the "
            "measurements."
        )

    def _watch_linear_range(self) -> None:
        """Say once when the errors of an uncorrected inertial solution are no longer small enough to be linear."""
        turned = float(np.max(np.abs(self.x[6:9])))
        away = float(np.max(np.abs(self.x[:3])))
        if self._linear and (turned > LINEAR_ATTITUDE or away > LINEAR_POSITION):
            self._linear = False
            self.record.notes.append(
                f"open loop: at {self.time:.1f} s the uncorrected inertial solution is off by "
                f"{np.degrees(turned):.2f} deg and {away:.0f} m, "
                'out of the range where its errors are linear; use [filter] feedback = "closed" with this sensor'
            )

    def _bridge(self, increments: ImuIncrements, at: int, *, ended: bool) -> None:
        """Enlarge the covariance by the part of a gap just crossed, at its end or at a measurement inside it."""
        k = at - 1 if ended else at
        if not 0 <= k < len(increments):
            return
        begin, end = float(increments.time[k]), float(increments.time[k + 1])
        gap = end - begin
        if gap <= self.settings.gap_s or self.time <= begin + TIME_TOLERANCE:
            return
        crossed = self.time - max(begin, self._bridged)
        self._bridged = self.time
        self._enlarge(partial(bridge, settings=self.settings, gap=gap, crossed=crossed))
        if ended:
            self.record.gaps.append((begin, gap))
            for gate in self._gates:
                gate.doubt_filter_until(self.time + DOUBT_S)

    def state(self) -> dict[str, Any]:
        """Everything that a filter of the same start, model, sensors and settings needs to go on from here.

        Numbers and plain arrays, for ``numpy.savez`` or ``pickle``.
        """
        saved = {name.lstrip("_"): np.array(getattr(self, name)) for name in _SAVED}
        gates = np.array([gate.state() for gate in self._gates]).reshape(-1, 5)
        return {**saved, "gates": gates, "heading_hold": self._hold.state()}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from a saved :meth:`state`. The record starts anew: a smoother reaches back to here.

        Raises
        ------
        ConfigError
            If the state belongs to another layout, another number of sensors or another kind of filter.
        """
        alike = np.shape(state["P"]) == self.P.shape and np.shape(state["acc"]) == self._acc.shape
        if not alike or len(state["pointers"]) != len(self.sensors):
            raise ConfigError(
                "the saved state belongs to a filter of another kind or with other states or sensors; build the filter "
                "as it was when saved"
            )
        for name in _SAVED:
            value = np.array(state[name.lstrip("_")])
            if name in _ARRAYS:
                getattr(self, name)[...] = value
            else:
                setattr(self, name, value if value.ndim else value.item())
        self._pointers = [int(k) for k in self._pointers]
        self._hold.restore(state["heading_hold"])
        for gate, saved in zip(self._gates, state["gates"], strict=True):
            gate.restore(tuple(float(value) for value in saved))
        self._index = 0
        self.record = FilterRecord(self.layout)
        self._keep_checkpoint(0, ())


def _ungated(_: int) -> float:
    return np.inf


_ARRAYS = ("nav", "s", "x", "P", "_acc", "_last")
_SAVED = (*_ARRAYS, "time", "_out_next", "_emitted", "_bridged", "_linear", "_pointers")
