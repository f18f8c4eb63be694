"""What a run leaves behind: trajectories, the fate of every measurement, sensor states, and a summary."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from navfuse.data.gps_epoch import GpsEpoch
from navfuse.data.imu_overview import ImuOverview
from navfuse.data.logs import GnssLog
from navfuse.data.trajectory import Trajectory
from navfuse.errors import InputError

if TYPE_CHECKING:
    import pandas

Array = np.ndarray

STATUSES = ("used", "rejected", "withheld", "late", "reset")
COMPONENTS = 3
DOUBTFUL = 1.5
"""Factor by which innovations may exceed their claimed size before the run is not to be relied on: the one threshold
of the command line, the summary and the report page."""


@dataclass(frozen=True, slots=True)
class Innovations:
    """One row for every measurement the filter was offered, whatever became of it.

    Attributes
    ----------
    time : (m,) array [s]
        Time of validity of the measurement (log time, offset applied), in the order it was handled.
    source : (m,) array of str
        The aiding sensor: ``"gnss_position"``, ``"gnss_velocity"``, ...
    status : (m,) array of str
        ``"used"``; ``"rejected"`` by the gate; ``"withheld"`` inside an outage window, so only compared;
        ``"late"``: older than the filter, so only counted; ``"reset"``: used after the covariance was enlarged,
        because the ones before it were all rejected.
    nis : (m,) array [1]
        Normalized innovation squared z' S^-1 z, chi-square with `dof` degrees of freedom when the model is right.
        NaN where none was formed ("late").
    dof : (m,) int array
        Number of components of the measurement; 0 where no innovation was formed.
    z : (m, 3) array
        Innovation, measured minus predicted, in the unit of the measurement; columns from `dof` on are NaN.
        GNSS innovations are resolved north, east, down, whatever the filter's frame.
    sd : (m, 3) array
        Standard deviation of the innovation, sqrt(diag S), same unit and padding.
    row : (m,) int array
        Row of the measurement in its log.
    """

    time: Array
    source: Array
    status: Array
    nis: Array
    dof: Array
    z: Array
    sd: Array
    row: Array

    def __post_init__(self) -> None:
        size = self.time.size
        for name in ("source", "status", "nis", "dof", "row"):
            _require_shape(name, getattr(self, name), (size,))
        for name in ("z", "sd"):
            _require_shape(name, getattr(self, name), (size, COMPONENTS))
        unknown = sorted(set(self.status.tolist()) - set(STATUSES))
        if unknown:
            raise InputError(f"innovations: unknown status {unknown[0]!r}; known: {', '.join(STATUSES)}")

    def __len__(self) -> int:
        return self.time.size

    @property
    def sources(self) -> tuple[str, ...]:
        """Names of the sources, in order of first appearance."""
        return tuple(dict.fromkeys(self.source.tolist()))

    def select(self, mask: Array) -> Innovations:
        """Rows picked by a boolean mask (m,) or an index array."""
        return Innovations(**{entry.name: getattr(self, entry.name)[mask] for entry in fields(self)})

    def of(self, source: str) -> Innovations:
        """Rows of one source (none when the source is unknown)."""
        return self.select(self.source == source)

    def count(self, source: str, status: str) -> int:
        """Number of measurements of `source` that ended as `status`."""
        return int(np.count_nonzero((self.source == source) & (self.status == status)))

    def to_columns(self) -> dict[str, Array]:
        """Columns of the native innovations table.

        Returns
        -------
        dict of str to (m,) array
            ``time_s, source, status, nis, dof, z_1..z_3, sd_1..sd_3, row``; `z` and `sd` in the unit of their source.
        """
        columns = {"time_s": self.time, "source": self.source, "status": self.status, "nis": self.nis, "dof": self.dof}
        columns |= {f"z_{k + 1}": self.z[:, k] for k in range(COMPONENTS)}
        columns |= {f"sd_{k + 1}": self.sd[:, k] for k in range(COMPONENTS)}
        columns["row"] = self.row
        return columns

    def to_pandas(self) -> pandas.DataFrame:
        """The native innovations table as a data frame."""
        import pandas

        return pandas.DataFrame(self.to_columns())

    @classmethod
    def empty(cls) -> Innovations:
        """No measurement at all."""
        nothing, block = np.empty(0), np.empty((0, COMPONENTS))
        text, number = np.empty(0, dtype="U1"), np.empty(0, dtype=np.int64)
        return cls(nothing, text, text, nothing, number, block, block, number)


class StateHistory(NamedTuple):
    """Estimate of one block of sensor states over time, SI units.

    Attributes
    ----------
    time : (n,) array [s]
    values : (n, k) array
    sd : (n, k) array
        Standard deviations, same unit as `values`.
    """

    time: Array
    values: Array
    sd: Array


@dataclass(frozen=True)
class Result:
    """Outcome of a run.

    Attributes
    ----------
    forward : Trajectory
        The filter's solution: each epoch knows only its past.
    smoothed : Trajectory or None
        The smoother's solution, when there was one: each epoch knows the whole log.
    innovations : Innovations
        Every measurement and what became of it.
    states : dict of str to StateHistory
        Estimated sensor states of the filter, e.g. ``gyro_bias`` [rad/s], ``accel_bias`` [m/s^2], ``gyro_scale`` and
        ``accel_scale`` [1]; (time, values (n, k), sd (n, k)).
    summary : dict
        Inputs, settings, counts and run times, as written to ``summary.json``.
    warnings : tuple of str
        Every warning of the run, in order; each says what to do.
    fixes : GnssLog or None
        The GNSS log offered to the filter (antenna positions, time offset applied), for maps.
        ``innovations.row`` of the GNSS sources points into it.
    imu : ImuOverview or None
        Rate, gaps and spectra of the inertial log.
    epoch : GpsEpoch or None
        GPS time from which the times of the run count; None where neither a file nor the project says.
    """

    forward: Trajectory
    smoothed: Trajectory | None = None
    innovations: Innovations = field(default_factory=Innovations.empty)
    states: dict[str, StateHistory] = field(default_factory=dict)
    summary: dict[str, Any] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    fixes: GnssLog | None = None
    imu: ImuOverview | None = None
    epoch: GpsEpoch | None = None

    @property
    def trajectory(self) -> Trajectory:
        """The best trajectory of the run: smoothed when there is one, else forward."""
        return self.forward if self.smoothed is None else self.smoothed

    def to_pandas(self) -> pandas.DataFrame:
        """The best trajectory as a data frame with the native trajectory columns (degrees, metres, m/s)."""
        return self.trajectory.to_pandas()

    def describe(self) -> str:
        """Plain-text account of the run: length, measurements, accuracy, warnings."""
        best = self.trajectory
        kind = "forward" if self.smoothed is None else "forward and smoothed"
        span = (
            f", {best.time[0]:.3f} .. {best.time[-1]:.3f} s ({best.time[-1] - best.time[0]:.1f} s)" if len(best) else ""
        )
        lines = [f"{kind} trajectory, {len(best)} epochs{span}"]
        for source in self.innovations.sources:
            counts = [(status, self.innovations.count(source, status)) for status in STATUSES]
            lines.append(f"{source}: " + ", ".join(f"{n} {status}" for status, n in counts if n))
        if best.sd_position is not None and len(best):
            sd = np.hypot(best.sd_position[:, 0], best.sd_position[:, 1])
            worst = int(np.argmax(sd))
            lines.append(
                f"expected horizontal error (1 sigma): {sd[-1]:.3g} m at the end, "
                f"{sd[worst]:.3g} m at worst (t = {best.time[worst]:.1f} s){self._doubt()}"
            )
        if self.states:
            lines.append(f"estimated sensor states: {', '.join(self.states)}")
        lines += [f"warning: {text}" for text in self.warnings]
        return "\n".join(lines)

    def _doubt(self) -> str:
        """What stands behind a standard deviation that the innovations contradict."""
        verdict = self.summary.get("verdict", {})
        if verdict.get("reliable") is not False:
            return ""
        factor = verdict.get("innovations_over_claim")
        large = factor is not None and factor > DOUBTFUL
        return " - NOT TO BE RELIED ON: " + (
            f"innovations are {factor:.1f} times as large as claimed" if large else "see the warnings"
        )


def _require_shape(name: str, array: Array, shape: tuple[int, ...]) -> None:
    if array.shape != shape:
        raise InputError(f"innovations: {name} has shape {array.shape}, expected {shape}")
