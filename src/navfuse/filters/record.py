"""What a filter leaves behind: its output rows, one record per measurement, and the checkpoints a smoother needs."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from navfuse.data.layout import NAVIGATION_STATES, Layout
from navfuse.data.result import COMPONENTS, Innovations, StateHistory
from navfuse.data.trajectory import Trajectory
from navfuse.filters.event import split

Array = np.ndarray

USED, REJECTED, WITHHELD, LATE, RESET = "used", "rejected", "withheld", "late", "reset"
"""What became of a measurement. ``reset``: used after the covariance was enlarged, because the ones before it were
all rejected.
"""


class Innovation(NamedTuple):
    """One measurement, used or not.

    `size` is its number of values d, zero if it came late; `numbers` holds the innovation z (d,), its covariance S (d,
    d) and, if it was used in a run that keeps checkpoints, all else that :func:`navfuse.filters.event.take`
    leaves behind.
    """

    time: float
    source: str
    row: int
    status: str
    nis: float
    size: int
    numbers: Array

    @property
    def z(self) -> Array:
        """Innovation (d,), measured minus predicted."""
        return self.numbers[: self.size]

    @property
    def S(self) -> Array:
        """Covariance (d, d) of the innovation."""
        d = self.size
        return self.numbers[d : d + d * d].reshape(d, d)

    @property
    def sd(self) -> Array:
        """Standard deviations (d,) of the innovation."""
        return np.sqrt(self.S.diagonal())


class Checkpoint(NamedTuple):
    """The filter after an event: increments finished, time, what it carries, and the measurements used, in order.

    For `carried` see :mod:`navfuse.filters.event`. `held` (3,) is the direction of the attitude error that
    the event left alone, or zero; `acc` is what the propagator keeps of a covariance step under way, where a filter was
    restored in the middle of one, or of a root of the covariance; otherwise None.
    """

    index: int
    time: float
    carried: Array
    updates: tuple[Innovation, ...]
    held: Array
    acc: Array | None

    @property
    def parts(self) -> tuple[Array, Array, Array, Array]:
        """Views of nav, s, x and P."""
        return split(self.carried)

    @property
    def P(self) -> Array:
        """Covariance (n, n)."""
        return self.parts[3]


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
    state_time : list of float [s], states : list of (2, n - 9) arrays
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
    states: list[Array] = field(default_factory=list)
    gaps: list[tuple[float, float]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def trajectory(self, source: str = "forward") -> Trajectory:
        """The output so far."""
        return trajectory_from_rows(self.time, self.rows, source)


def trajectory_from_rows(time: list[Array], rows: list[Array], source: str) -> Trajectory:
    """A trajectory of pieces of output (r,) and (r, 18) as :func:`navfuse.data.nav_state.describe_rows` gives them."""
    if not rows:
        time, rows = [np.empty(0)], [np.empty((0, 18))]

    def column(k: int) -> Array:
        return np.concatenate([piece[:, k] for piece in rows])

    def vector(k: int) -> Array:
        return np.concatenate([piece[:, k : k + 3] for piece in rows])

    return Trajectory(
        time=np.concatenate(time),
        lat=column(0),
        lon=column(1),
        height=column(2),
        velocity_n=vector(3),
        attitude=vector(6),
        sd_position=vector(9),
        sd_velocity=vector(12),
        sd_attitude=vector(15),
        source=source,
    )


def collect(records: list[FilterRecord]) -> tuple[Trajectory, Innovations, dict[str, StateHistory]]:
    """Trajectory, innovations and sensor states of one run, or of several that follow each other."""
    times = [piece for record in records for piece in record.time]
    rows = [piece for record in records for piece in record.rows]
    layout = records[0].layout
    time = np.array([t for record in records for t in record.state_time])
    history = np.array([each for record in records for each in record.states])
    history = history.reshape(time.size, 2, layout.size - NAVIGATION_STATES)
    states = {}
    for block in layout.blocks:
        where = layout.slice(block.name)
        part = slice(where.start - NAVIGATION_STATES, where.stop - NAVIGATION_STATES)
        states[block.name] = StateHistory(time, history[:, 0, part], history[:, 1, part])
    return trajectory_from_rows(times, rows, "forward"), collect_innovations(records), states


def collect_innovations(records: list[FilterRecord]) -> Innovations:
    """Innovations of one run, or of several that follow each other."""
    entries = [entry for record in records for entry in record.innovations]
    if not entries:
        return Innovations.empty()
    time, source, row, status, nis, size, numbers = zip(*entries, strict=True)
    dof = np.array(size, dtype=np.int64)
    z, sd = np.full((dof.size, COMPONENTS), np.nan), np.full((dof.size, COMPONENTS), np.nan)
    for d in set(size) - {0}:
        of_size = np.flatnonzero(dof == d)
        values = np.array([numbers[k][: d + d * d] for k in of_size.tolist()])
        shown = min(d, COMPONENTS)
        z[of_size, :shown] = values[:, :shown]
        sd[of_size, :shown] = np.sqrt(values[:, d :: d + 1][:, :shown])
    return Innovations(
        time=np.array(time, dtype=float),
        source=np.array(source, dtype=np.str_),
        status=np.array(status, dtype=np.str_),
        nis=np.array(nis, dtype=float),
        dof=dof,
        z=z,
        sd=sd,
        row=np.array(row, dtype=np.int64),
    )
