"""GNSS fixes with the errors of real receivers: correlated, late, interrupted, jumping, drifting, overconfident."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from navfuse.core.printed_keys import naming_keys
from navfuse.errors import ConfigError
from navfuse.simulation.bounds import sampling_rate
from navfuse.simulation.printed_fields import (
    one_number,
    tables,
    things,
    three_numbers,
    three_sizes,
    to_fields,
    unknown_key,
    windows,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike

Array = np.ndarray

RECEIVER_UNITS: dict[str, tuple[str, float]] = {
    "rate_hz": ("rate", 1.0),
    "offset_s": ("offset", 1.0),
    "position_sd_m": ("position_sd", 1.0),
    "position_sd_cm": ("position_sd", 1e-2),
    "position_correlated_sd_m": ("position_correlated_sd", 1.0),
    "position_correlated_sd_cm": ("position_correlated_sd", 1e-2),
    "position_correlated_tau_s": ("position_correlated_tau", 1.0),
    "velocity_sd_mps": ("velocity_sd", 1.0),
    "velocity_sd_cmps": ("velocity_sd", 1e-2),
    "velocity_correlated_sd_mps": ("velocity_correlated_sd", 1.0),
    "velocity_correlated_sd_cmps": ("velocity_correlated_sd", 1e-2),
    "velocity_correlated_tau_s": ("velocity_correlated_tau", 1.0),
    "stated_sigma_factor": ("stated_sigma_factor", 1.0),
    "latency_s": ("latency", 1.0),
    "latency_ms": ("latency", 1e-3),
    "outages_s": ("outages", 1.0),
    "outages_per_h": ("outage_frequency", 1.0 / 3600.0),
    "outage_s": ("outage_length", 1.0),
    "multipath_jumps_per_h": ("multipath_frequency", 1.0 / 3600.0),
    "multipath_mean_s": ("multipath_mean", 1.0),
    "multipath_sd_m": ("multipath_sd", 1.0),
    "drift_mps": ("drift_velocity", 1.0),
    "drift_from_s": ("drift_from", 1.0),
    "drift_to_s": ("drift_to", 1.0),
}
"""Key with its printed unit -> (field of :class:`GnssReceiverModel`, factor to SI); ``fix_types`` stands beside
them."""

_AXES = ("position_sd", "position_correlated_sd", "velocity_sd", "velocity_correlated_sd", "multipath_sd")
_SIZES = ("offset", "outage_frequency", "outage_length", "multipath_frequency", "multipath_mean")


@dataclass(frozen=True, slots=True)
class FixType:
    """A quality of fix that a receiver stays in for a while.

    Attributes
    ----------
    name : str
        As it stands in the log, e.g. "rtk-fixed", "rtk-float", "single".
    sd_factor : float
        White and correlated errors of the model, and the stated sigmas, are multiplied by this.
    mean_s : float [s]
        Mean length of a stay, exponentially distributed; inf to stay for good.

    Raises
    ------
    ConfigError
        For an empty name, or a number that is not positive.
    """

    name: str
    sd_factor: float = 1.0
    mean_s: float = math.inf

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name:
            raise ConfigError(f"a fix type needs a name, not {self.name!r}")
        for key, infinite in (("sd_factor", False), ("mean_s", True)):
            value = one_number(f"{key} of fix type {self.name!r}", getattr(self, key), above=True, infinite=infinite)
            object.__setattr__(self, key, value)


@dataclass(frozen=True, slots=True, eq=False)
class GnssReceiverModel:
    """Errors of a GNSS receiver that gives positions and velocities, SI units; zero means absent.

    Fields marked *axes* take a number or three: north, east, down. Times are those of the motion.

    Attributes
    ----------
    rate, offset : float [Hz], [s]
        Fixes per second, and how long after the start of the motion the first one is measured.
    position_sd : axes [m]
        White errors. Typical: 0.01 m horizontally and 0.015 m vertically for a fixed RTK solution without its part per
        million of the baseline (u-blox ZED-F9P data sheet: 0.01 m + 1 ppm CEP both ways).
    position_correlated_sd, position_correlated_tau : axes [m], float [s]
        Stationary first-order Gauss-Markov errors, correlation time > 0 (inf: constant). Typical of single-point fixes:
        1 to 2 m over a minute or so (D. L. Wilson's autocorrelation of a Garmin 12XL bends at about 1 min); 10 to 900 s
        bound the time constant of code multipath in Joerger and Pervan (2020).
    velocity_sd : axes [m/s]
        White errors. Typical: 0.05 m/s (u-blox NEO-M8 and ZED-F9P data sheets, 50 % at 30 m/s). With the correlated
        ones zero too, the log has no velocity.
    velocity_correlated_sd, velocity_correlated_tau : axes [m/s], float [s]
    stated_sigma_factor : float
        Stated sigma over true one, where the true one is ``sqrt(position_sd^2 + position_correlated_sd^2)`` times the
        factor of the fix type. 1 is honest; receivers that take their errors for white often state a third.
    latency : float [s]
        How late the stamps are; negative if early. Typical of stamps by arrival: 0.05 to 0.2 s (our estimate).
    outages : (m, 2) array [s]
        Windows [from, to) without fixes.
    outage_frequency, outage_length : float [1/s], [s]
        Random windows besides: mean number per time (Poisson), and how long each takes.
    multipath_frequency, multipath_mean, multipath_sd : float [1/s], float [s], axes [m]
        Jumps of the position: mean number per time (Poisson), mean length of each (exponential), standard deviation of
        its constant offset. They are not in the stated sigma. Typical of street canyons (our estimate): 60 per hour, 10
        s, 10 m.
    drift_velocity, drift_from, drift_to : (3,) array [m/s], floats [s]
        A pull as by a spoofer: the position moves away with this velocity, north, east, down, from one time to the
        other, and the velocity shows it; afterwards the offset stays. Not in the stated sigma.
    fix_types : tuple of FixType
        The first is that of the start; after a stay, one of the others follows, each as likely. Empty: no fix column.

    Raises
    ------
    ConfigError
        On construction, for a value that is negative, not finite or of the wrong shape, or one that lacks another.
    """

    rate: float = 1.0
    offset: float = 0.0
    position_sd: ArrayLike = 0.0
    position_correlated_sd: ArrayLike = 0.0
    position_correlated_tau: float = 0.0
    velocity_sd: ArrayLike = 0.0
    velocity_correlated_sd: ArrayLike = 0.0
    velocity_correlated_tau: float = 0.0
    stated_sigma_factor: float = 1.0
    latency: float = 0.0
    outages: ArrayLike = ()
    outage_frequency: float = 0.0
    outage_length: float = 0.0
    multipath_frequency: float = 0.0
    multipath_mean: float = 0.0
    multipath_sd: ArrayLike = 0.0
    drift_velocity: ArrayLike = (0.0, 0.0, 0.0)
    drift_from: float = 0.0
    drift_to: float = math.inf
    fix_types: tuple[FixType, ...] = ()

    def __post_init__(self) -> None:
        checked: dict[str, Any] = {name: three_sizes(name, getattr(self, name)) for name in _AXES}
        checked |= {name: one_number(name, getattr(self, name)) for name in _SIZES}
        checked["rate"] = sampling_rate("rate", self.rate)
        checked["stated_sigma_factor"] = one_number("stated_sigma_factor", self.stated_sigma_factor, above=True)
        for name in ("position_correlated_tau", "velocity_correlated_tau"):
            checked[name] = one_number(name, getattr(self, name), infinite=True)
        for name in ("latency", "drift_from"):
            checked[name] = one_number(name, getattr(self, name), least=-math.inf)
        checked["drift_to"] = one_number("drift_to", self.drift_to, least=checked["drift_from"], infinite=True)
        checked |= {
            "drift_velocity": three_numbers("drift_velocity", self.drift_velocity),
            "outages": windows("outages", self.outages),
        }
        checked["fix_types"] = things("fix_types", self.fix_types, FixType)
        for name, value in checked.items():
            object.__setattr__(self, name, value)
        self._check_pairs()

    def _check_pairs(self) -> None:
        if np.any(self.total_sd("position") == 0.0):
            raise ConfigError(
                "position_sd and position_correlated_sd are both zero on some axis, and a fix needs an error to state "
                "its sigma: give position_sd_m or position_correlated_sd_m with one number > 0, or three"
            )
        velocity = self.total_sd("velocity")
        if velocity.any() and not velocity.all():
            raise ConfigError(
                "velocity_sd and velocity_correlated_sd must give every axis an error, or none; "
                f"together they are {velocity.tolist()}"
            )
        for kind in ("position", "velocity"):
            if self.axes(f"{kind}_correlated_sd").any() and not getattr(self, f"{kind}_correlated_tau") > 0.0:
                raise ConfigError(f"{kind}_correlated_sd needs {kind}_correlated_tau > 0 (inf for a constant)")
        if (self.outage_frequency > 0.0) != (self.outage_length > 0.0):
            raise ConfigError("outage_frequency and outage_length need each other: give both > 0")
        jumps = (self.multipath_frequency > 0.0, self.multipath_mean > 0.0, bool(self.axes("multipath_sd").any()))
        if any(jumps) and not all(jumps):
            raise ConfigError("multipath jumps need all of multipath_frequency, multipath_mean and multipath_sd > 0")

    def axes(self, name: str) -> Array:
        """A field marked *axes* as (3,) array, in its own unit."""
        return np.asarray(getattr(self, name))

    def total_sd(self, kind: str) -> Array:
        """White and correlated errors together, (3,) in [m] or [m/s], for "position" or "velocity"."""
        return np.hypot(self.axes(f"{kind}_sd"), self.axes(f"{kind}_correlated_sd"))

    @classmethod
    def from_datasheet(
        cls, /, fix_types: Sequence[FixType | Mapping[str, Any]] = (), **printed: Any
    ) -> GnssReceiverModel:
        """A model from keys that end in their unit.

        Parameters
        ----------
        fix_types : sequence of FixType or of mappings with its fields
        **printed : number or array
            Keys of :data:`RECEIVER_UNITS`.

        Raises
        ------
        ConfigError
            For an unknown key or unit (the nearest is named), a field given in two units, or a value the model refuses.

        Examples
        --------
        >>> model = GnssReceiverModel.from_datasheet(position_sd_cm=2.0, velocity_sd_mps=0.05, rate_hz=5.0)
        >>> float(model.position_sd[0])
        0.02
        """
        kinds = [
            kind if isinstance(kind, FixType) else _fix_type(kind) for kind in tables("fix_types", fix_types, FixType)
        ]
        fields = to_fields("GNSS errors", printed, RECEIVER_UNITS)
        with naming_keys(printed, RECEIVER_UNITS):
            return cls(fix_types=tuple(kinds), **fields)  # pyright: ignore[reportArgumentType]

    def replace_datasheet(self, /, **printed: Any) -> GnssReceiverModel:
        """A copy with some fields changed, by keys of :data:`RECEIVER_UNITS`.

        Raises
        ------
        ConfigError
            As :meth:`from_datasheet`.
        """
        fields = to_fields("GNSS errors", printed, RECEIVER_UNITS)
        with naming_keys(printed, RECEIVER_UNITS):
            return dataclasses.replace(self, **fields)


def _fix_type(given: Mapping[str, Any]) -> FixType:
    known = [entry.name for entry in dataclasses.fields(FixType)]
    for key in given:
        if key not in known:
            raise unknown_key("fix_types", key, known)
    return FixType(**{"name": "", **given})
