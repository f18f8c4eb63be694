"""What a filter leaves behind: its output rows, one record per measurement, and the checkpoints a smoother needs."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from navfuse.data.layout import NAVIGATION_STATES, Layout
from navfuse.data.result import COMPONENTS, Innovations, StateHistory
from navfuse.data.trajectory import Trajectory

Array = np.ndarray

USED, REJECTED, WITHHELD, LATE, RESET = "used", "rejected", "withheld", "late", "reset"
"""What became of a measurement. ``reset``: used after the covariance was enlarged, because the ones before it were
all rejected.
"""


class Update(NamedTuple):
    """One applied measurement: matrix H (d, n), gain K (n, d), inverse innovation covariance, innovation z, attitude
    correction (3,).
    """

    H: Array
    K: Array
    Sinv: Array
    z: Array
    dpsi: Array


class Checkpoint(NamedTuple):
    """The filter after an event: increments finished, time, state, covariance, and the updates applied in order.

    `held` (3,) is the direction of the attitude error that the event left alone, or zero; `acc` are the sums of a
    covariance step under way, where a filter was restored in the middle of one, otherwise None.
    """

    index: int
    time: float
    nav: Array
    s: Array
    x: Array
    P: Array
    updates: tuple[Update, ...]
    held: Array
    acc: Array | None


class Innovation(NamedTuple):
    """One measurement, used or not: innovation z (d,) and its covariance S (d, d); both empty if it came late."""

    time: float
    source: str
    row: int
    status: str
    nis: float
    z: Array
    S: Array

    @property
    def sd(self) -> Array:
        """Standard deviations (d,) of the innovation."""
        return np.sqrt(self.S.diagonal())


@dataclass
class FilterRecord:
    """Everything kept of a run.

    Attributes
    ----------
    layout : Layout
    time : list of (r,) arrays, rows : list of (r, 18) arrays
        Output, as :func:`navfuse.data.nav_state.describe_rows` gives it.
    innovations : list of Innovation
    checkpoints : list of Checkpoint
    state_time, state_value, state_sd : lists
        Estimates of the states after the ninth, and their standard deviations, after every event.
    gaps : list of (start, length) [s]
        Stretches without inertial data that were bridged.
    notes : list of str
        What a user should know about the run.
    """

    layout: Layout
    time: list[Array] = field(default_factory=list)
    rows: list[Array] = field(default_factory=list)
    innovations: list[Innovation] = field(default_factory=list)
    checkpoints: list[Checkpoint] = field(default_factory=list)
    state_time: list[float] = field(default_factory=list)
    state_value: list[Array] = field(default_factory=list)
    state_sd: list[Array] = field(default_factory=list)
    gaps: list[tuple[float, float]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def trajectory(self, source: str = "forward") -> Trajectory:
        """The output so far."""
        return trajectory_from_rows(self.time, self.rows, source)


def trajectory_from_rows(time: list[Array], rows: list[Array], source: str) -> Trajectory:
    """A trajectory of pieces of output (r,) and (r, 18) as :func:`navfuse.data.nav_state.describe_rows` gives them."""
    t = np.concatenate(time) if time else np.empty(0)
    r = np.concatenate(rows) if rows else np.empty((0, 18))
    r = np.ascontiguousarray(r.T)
    return Trajectory(
        time=t,
        lat=r[0],
        lon=r[1],
        height=r[2],
        velocity_n=np.ascontiguousarray(r[3:6].T),
        attitude=np.ascontiguousarray(r[6:9].T),
        sd_position=np.ascontiguousarray(r[9:12].T),
        sd_velocity=np.ascontiguousarray(r[12:15].T),
        sd_attitude=np.ascontiguousarray(r[15:18].T),
        source=source,
    )


def collect(records: list[FilterRecord]) -> tuple[Trajectory, Innovations, dict[str, StateHistory]]:
    """Trajectory, innovations and sensor states of one run, or of several that follow each other."""
    times = [piece for record in records for piece in record.time]
    rows = [piece for record in records for piece in record.rows]
    entries = [entry for record in records for entry in record.innovations]
    count = len(entries)
    z, sd = np.full((count, COMPONENTS), np.nan), np.full((count, COMPONENTS), np.nan)
    for k, entry in enumerate(entries):
        size = min(entry.z.size, COMPONENTS)
        z[k, :size] = entry.z[:size]
        sd[k, :size] = entry.sd[:size]
    innovations = Innovations(
        time=np.array([entry.time for entry in entries], dtype=float),
        source=np.array([entry.source for entry in entries], dtype=np.str_),
        status=np.array([entry.status for entry in entries], dtype=np.str_),
        nis=np.array([entry.nis for entry in entries], dtype=float),
        dof=np.array([entry.z.size for entry in entries], dtype=np.int64),
        z=z,
        sd=sd,
        row=np.array([entry.row for entry in entries], dtype=np.int64),
    )
    layout = records[0].layout
    time = np.array([t for record in records for t in record.state_time])
    value = np.array([v for record in records for v in record.state_value]).reshape(
        time.size, layout.size - NAVIGATION_STATES
    )
    deviation = np.array([v for record in records for v in record.state_sd]).reshape(
        time.size, layout.size - NAVIGATION_STATES
    )
    states = {}
    for block in layout.blocks:
        where = layout.slice(block.name)
        part = slice(where.start - NAVIGATION_STATES, where.stop - NAVIGATION_STATES)
        states[block.name] = StateHistory(time, value[:, part], deviation[:, part])
    return trajectory_from_rows(times, rows, "forward"), innovations, states
