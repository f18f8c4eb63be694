"""What the simulated aiding sensors share: when they sample, how late they stamp, how errors over time are drawn."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from navfuse.core.printed_keys import naming_keys
from navfuse.core.rotation import dcm_from_quat_batch
from navfuse.errors import ConfigError, InputError
from navfuse.simulation.bounds import require_rows, sampling_rate
from navfuse.simulation.perfect_imu import sample_times
from navfuse.simulation.printed_fields import any_number, one_number, to_fields, unknown_key
from navfuse.simulation.sensors import gauss_markov

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from typing import Self

    from numpy.typing import ArrayLike

    from navfuse.simulation.motion import Motion

Array = np.ndarray

SAMPLING_UNITS: dict[str, tuple[str, float]] = {
    "rate_hz": ("rate", 1.0),
    "offset_s": ("offset", 1.0),
    "latency_s": ("latency", 1.0),
    "latency_ms": ("latency", 1e-3),
}
"""Key with its printed unit -> (field of :class:`SampledSensor`, factor to SI)."""

_PANEL = 0.05
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(4)
_AT_ONCE = 200_000


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SampledSensor:
    """A sensor that measures at a regular rate; base of the models of aiding sensors.

    Attributes
    ----------
    rate, offset : float [Hz], [s]
        Samples per second, and how long after the start of the motion the first one is measured.
    latency : float [s]
        How late the stamps are; negative if early.
    """

    WHAT: ClassVar[str] = "sensor"
    UNITS: ClassVar[Mapping[str, tuple[str, float]]] = SAMPLING_UNITS
    WORDS: ClassVar[tuple[str, ...]] = ()

    rate: float = 1.0
    offset: float = 0.0
    latency: float = 0.0

    def _settle(self, **checks: Callable[[str, Any], Any]) -> None:
        """Replace fields by what their check makes of them; those of the base class always."""
        object.__setattr__(self, "rate", sampling_rate("rate", self.rate))
        object.__setattr__(self, "offset", one_number("offset", self.offset))
        object.__setattr__(self, "latency", any_number("latency", self.latency))
        for name, check in checks.items():
            object.__setattr__(self, name, check(name, getattr(self, name)))

    @classmethod
    def from_datasheet(cls, /, **printed: Any) -> Self:
        """A model from keys that end in their unit.

        Parameters
        ----------
        **printed : number or array
            Keys of the class's ``UNITS``, and those of its ``WORDS``, which have no unit.

        Raises
        ------
        ConfigError
            For an unknown key or unit (the nearest is named), a field given in two units, or a value the model refuses.
        """
        with naming_keys(printed, cls.UNITS):
            return cls(**cls._fields(printed))

    def replace_datasheet(self, /, **printed: Any) -> Self:
        """A copy with some fields changed, by the keys of :meth:`from_datasheet`.

        Raises
        ------
        ConfigError
            As :meth:`from_datasheet`.
        """
        with naming_keys(printed, self.UNITS):
            return dataclasses.replace(self, **self._fields(printed))

    @classmethod
    def _fields(cls, printed: dict[str, Any]) -> dict[str, Any]:
        for key in printed:
            if key not in cls.UNITS and key not in cls.WORDS:
                raise unknown_key(cls.WHAT, key, [*cls.UNITS, *cls.WORDS])
        words = {key: value for key, value in printed.items() if key in cls.WORDS}
        return words | to_fields(cls.WHAT, {k: v for k, v in printed.items() if k not in words}, cls.UNITS)

    def values(self, name: str) -> Array:
        """A field of several numbers, as array in SI units."""
        return np.asarray(getattr(self, name), dtype=float)

    def sample_times(self, motion: Motion) -> Array:
        """When it measures along a motion, (n,) [s], n >= 1.

        Raises
        ------
        InputError
            When the motion ends before the first sample.
        """
        time = sample_times(motion.start, motion.end, self.rate, self.offset)
        if time.size == 0:
            raise InputError(
                f"the motion ends at {motion.end:g} s, before the first sample of the {self.WHAT} at "
                f"{motion.start + self.offset:g} s"
            )
        return time


def need_each_other(what: str, **fields: float) -> None:
    """Refuse fields of which some are zero and others not.

    Raises
    ------
    ConfigError
    """
    if any(value > 0.0 for value in fields.values()) and not all(value > 0.0 for value in fields.values()):
        raise ConfigError(f"{what} need {' and '.join(fields)} > 0, all of them")


def need_tau(sd_name: str, sd: ArrayLike, tau_name: str, tau: float) -> None:
    """Refuse a Gauss-Markov error without its correlation time.

    Raises
    ------
    ConfigError
    """
    if np.any(np.asarray(sd) > 0.0) and not tau > 0.0:
        raise ConfigError(f"{sd_name} needs {tau_name} > 0 (inf for a constant)")


def stated_sd(factor: float, sd: ArrayLike, shape: tuple[int, ...]) -> Array | None:
    """Standard deviations for a log: `factor` times `sd` in every row, None where that is zero."""
    stated = np.broadcast_to(factor * np.asarray(sd), shape)
    return stated.copy() if np.all(stated > 0.0) else None


def rounded(values: Array, lsb: float) -> Array:
    """Values to the nearest multiple of `lsb`; unchanged if that is 0."""
    return np.rint(values / lsb) * lsb + 0.0 if lsb > 0.0 else values  # + 0.0: no -0.0 in a file


def wander(time: Array, sd: float, tau: float, walk: float, rng: np.random.Generator) -> Array:
    """A path (n,) of a Gauss-Markov process or random walk; see :func:`~navfuse.simulation.sensors.gauss_markov`."""
    return gauss_markov(time, sd, tau, walk, rng)[:, 0]


def boxes(time: Array, windows: Array, sizes: Array) -> Array:
    """Sum of offsets that hold from one time to another.

    Parameters
    ----------
    time : (n,) array [s]
    windows : (m, 2) array [s]
        Half-open [from, to).
    sizes : (m, k) array

    Returns
    -------
    (n, k) array
    """
    out = np.zeros((time.size, sizes.shape[1]))
    for (begin, end), size in zip(windows, sizes, strict=True):
        out[np.searchsorted(time, begin) : np.searchsorted(time, end)] += size
    return out


def random_boxes(
    time: Array, frequency: float, mean: float, sd: Array, when: np.random.Generator, size: np.random.Generator
) -> Array:
    """Offsets that begin at random (Poisson), each constant for a time that is exponentially distributed.

    Parameters
    ----------
    time : (n,) array [s]
    frequency : float [1/s]
        Mean number per time.
    mean : float [s]
        Mean length.
    sd : (k,) array
        Standard deviations of the offsets.
    when, size : numpy Generators

    Returns
    -------
    (n, k) array
        Overlapping offsets add up.
    """
    require_rows(frequency * (time[-1] - time[0]), f"{3600.0 * frequency:g} random events per hour")
    count = when.poisson(frequency * (time[-1] - time[0])) if frequency else 0
    begin = np.sort(when.uniform(time[0], time[-1], count))
    end = begin + mean * when.standard_exponential(count)
    return boxes(time, np.column_stack([begin, end]), sd * size.standard_normal((count, sd.size)))


def interval_means(values_at: Callable[[Array], Array], time: Array, length: float, start: float) -> Array:
    """Means of a function over the interval before each stamp.

    Parameters
    ----------
    values_at : callable
        (n,) times [s] -> (n, k) values.
    time : (n,) array [s]
        Ends of the intervals.
    length : float [s]
    start : float [s]
        Intervals are cut off here; one without length has the value at its stamp.

    Returns
    -------
    (n, k) array

    Notes
    -----
    Gauss-Legendre quadrature of order 8 on panels of at most 50 ms: rounding for anything slower than about 1 Hz, a
    millionth at 3 Hz.
    """
    require_rows(_NODES.size * length / _PANEL, f"the mean over an interval of {length:g} s")
    panels = max(1, math.ceil(length / _PANEL - 1e-9))
    fraction = ((np.arange(panels)[:, None] + 0.5 * (1.0 + _NODES)) / panels).ravel()
    weights = np.tile(0.5 * _WEIGHTS / panels, panels)
    step = max(1, _AT_ONCE // fraction.size)
    means = []
    for first in range(0, time.size, step):
        end = time[first : first + step]
        begin = np.maximum(end - length, start)
        values = values_at((begin[:, None] + (end - begin)[:, None] * fraction).ravel())
        means.append(np.einsum("j,ijk->ik", weights, values.reshape(end.size, fraction.size, -1)))
    return np.concatenate(means)


def point_velocity_b(motion: Motion, time: Array, lever_arm_b: ArrayLike) -> Array:
    """Velocity relative to the Earth of a point fixed to the body, resolved in b.

    Parameters
    ----------
    motion : Motion
        Of the IMU.
    time : (n,) array [s]
    lever_arm_b : (3,) or (m, 3) array [m]
        From the IMU to the point or points, in b.

    Returns
    -------
    (n, 3) or (n, m, 3) array [m/s]
        ``C_be v_e + w_eb_b x l``.
    """
    state = motion.at(time)
    arm = np.asarray(lever_arm_b, dtype=float)
    v_b = np.einsum("kji,kj->ki", dcm_from_quat_batch(state.q_eb), state.v_e)
    if arm.ndim == 1:
        return v_b + np.cross(state.w_eb_b, arm)
    return v_b[:, None, :] + np.cross(state.w_eb_b[:, None, :], arm)


def level_to_body(motion: Motion, time: Array, vector_n: ArrayLike) -> Array:
    """A vector north-east-down, (3,) or (n, 3), resolved in b at n times."""
    return np.einsum("kji,kj->ki", motion.C_nb(time), np.broadcast_to(np.asarray(vector_n), (time.size, 3)))
