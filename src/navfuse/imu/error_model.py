"""The sensor error model of an inertial measurement unit, in SI units and in the units data sheets print.

The model is the same for the filter, which estimates these errors, and for the simulator, which draws them::

    w_meas = (I + M_g) w_ib_b + b_g + n_g          M = diag(scale) + off-diagonal cross-coupling
    f_meas = (I + M_a) f_b    + b_a + n_a

Each bias and each scale factor starts as a Gaussian of the given standard deviation. With a finite ``tau`` it is a
first-order Gauss-Markov process that keeps this standard deviation; with ``tau = inf`` it stays as drawn, plus, for a
bias, a random walk of density ``walk``. Cross-coupling never changes during a run.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from navfuse.core.constants import STANDARD_GRAVITY
from navfuse.core.nearest import nearest
from navfuse.core.printed_keys import naming_keys, numbers, shown
from navfuse.errors import ConfigError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

Array = np.ndarray

_DEG = math.pi / 180.0
_MILLI_G = 1e-3 * STANDARD_GRAVITY
_PER_SQRT_H = 1.0 / 60.0

DATASHEET_UNITS: dict[str, tuple[str, float]] = {
    "arw_deg_per_sqrt_h": ("arw", _DEG * _PER_SQRT_H),
    "gyro_noise_degps_per_sqrt_hz": ("arw", _DEG),
    "vrw_mps_per_sqrt_h": ("vrw", _PER_SQRT_H),
    "accel_noise_ug_per_sqrt_hz": ("vrw", 1e-3 * _MILLI_G),
    "gyro_bias_sd_dph": ("gyro_bias_sd", _DEG / 3600.0),
    "gyro_bias_sd_degps": ("gyro_bias_sd", _DEG),
    "gyro_bias_tau_s": ("gyro_bias_tau", 1.0),
    "gyro_bias_walk_dph_per_sqrt_h": ("gyro_bias_walk", _DEG / 3600.0 * _PER_SQRT_H),
    "accel_bias_sd_mg": ("accel_bias_sd", _MILLI_G),
    "accel_bias_sd_mgal": ("accel_bias_sd", 1e-5),
    "accel_bias_tau_s": ("accel_bias_tau", 1.0),
    "accel_bias_walk_mg_per_sqrt_h": ("accel_bias_walk", _MILLI_G * _PER_SQRT_H),
    "gyro_scale_sd_ppm": ("gyro_scale_sd", 1e-6),
    "gyro_scale_tau_s": ("gyro_scale_tau", 1.0),
    "accel_scale_sd_ppm": ("accel_scale_sd", 1e-6),
    "accel_scale_tau_s": ("accel_scale_tau", 1.0),
    "gyro_cross_sd_mrad": ("gyro_cross_sd", 1e-3),
    "accel_cross_sd_mrad": ("accel_cross_sd", 1e-3),
}
"""Key with its printed unit -> (field of :class:`ImuErrorModel`, factor to SI).

``mg`` is 1e-3 standard gravity, ``mgal`` 1e-5 m/s^2.
"""


@dataclass(frozen=True, slots=True, eq=False)
class ImuErrorModel:
    """Stochastic errors of an inertial measurement unit, SI units and radians.

    White noise of density ``arw`` makes the integrated angle wander by ``arw * sqrt(t)``, and a rate sampled at
    interval ``dt`` noisy by ``arw / sqrt(dt)``; the same for velocity. Fields marked *axes* take a number (every axis
    alike) or three.

    Attributes
    ----------
    arw : float [rad/sqrt(s)]
        Angular random walk.
    vrw : float [(m/s)/sqrt(s)]
        Velocity random walk.
    gyro_bias_sd, accel_bias_sd : axes [rad/s], [m/s^2]
        Standard deviation of the bias of a freshly switched-on unit: turn-on repeatability and in-run change together.
    gyro_bias_tau, accel_bias_tau : float [s]
        Correlation time, > 0; inf (the default) is a constant, or with a walk a random walk.
    gyro_bias_walk, accel_bias_walk : axes [rad/s/sqrt(s)], [m/s^2/sqrt(s)]
        Density of the random walk of the bias; only with ``tau = inf``.
    gyro_scale_sd, accel_scale_sd : axes [1]
        Standard deviation of the scale-factor errors.
    gyro_scale_tau, accel_scale_tau : float [s]
        Their correlation times; inf (the default) is a constant.
    gyro_cross_sd, accel_cross_sd : float [rad]
        Standard deviation of each of the six off-diagonal elements (non-orthogonality and misalignment).
    source : str
        Where the figures come from.

    Raises
    ------
    ConfigError
        On construction, for a value that is negative, not finite where it must be, of the wrong shape, or a walk beside
        a finite tau.

    See Also
    --------
    navfuse.imu.grades : ready-made models.
    """

    arw: float = 0.0
    vrw: float = 0.0
    gyro_bias_sd: float | Array = 0.0
    gyro_bias_tau: float = math.inf
    gyro_bias_walk: float | Array = 0.0
    accel_bias_sd: float | Array = 0.0
    accel_bias_tau: float = math.inf
    accel_bias_walk: float | Array = 0.0
    gyro_scale_sd: float | Array = 0.0
    gyro_scale_tau: float = math.inf
    accel_scale_sd: float | Array = 0.0
    accel_scale_tau: float = math.inf
    gyro_cross_sd: float = 0.0
    accel_cross_sd: float = 0.0
    source: str = ""

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            if field.name == "source":
                continue
            value = getattr(self, field.name)
            if field.name.endswith("_tau"):
                value = _checked_tau(field.name, value)
            else:
                value = _checked_size(field.name, value, axes=field.name.endswith(("bias_sd", "walk", "scale_sd")))
            object.__setattr__(self, field.name, value)
        for sensor in ("gyro", "accel"):
            if math.isfinite(getattr(self, f"{sensor}_bias_tau")) and np.any(self.axes(f"{sensor}_bias_walk") > 0.0):
                raise ConfigError(
                    f"{sensor}_bias_walk needs {sensor}_bias_tau = inf: a Gauss-Markov bias has no extra random walk"
                )

    def axes(self, name: str) -> Array:
        """A field as three values.

        Parameters
        ----------
        name : str
            Field name, e.g. "gyro_bias_sd".

        Returns
        -------
        (3,) array
            Body x, y, z, in the unit of the field. A copy.
        """
        return np.broadcast_to(np.asarray(getattr(self, name), dtype=float), (3,)).copy()

    def replace(self, /, **changes: Any) -> ImuErrorModel:
        """A copy with some fields changed, in SI units.

        Raises
        ------
        ConfigError
            For a name that is no field, or a value the model refuses.
        """
        known = [field.name for field in dataclasses.fields(self)]
        for name in changes:
            if name not in known:
                raise ConfigError(f"unknown IMU error parameter {name!r}{_nearest(name, known)}")
        return dataclasses.replace(self, **changes)

    def replace_datasheet(self, /, **printed: ArrayLike) -> ImuErrorModel:
        """A copy with some fields changed, in printed units.

        Parameters
        ----------
        **printed : number or three numbers
            Keys of :data:`DATASHEET_UNITS`, which carry their units.

        Raises
        ------
        ConfigError
            For an unknown key (the nearest one is named), a field given twice in two units, or a value the model
            refuses.
        """
        changes: dict[str, Any] = {}
        for key, value in printed.items():
            if key not in DATASHEET_UNITS:
                raise ConfigError(f"unknown IMU error key {key!r}{_nearest(key, list(DATASHEET_UNITS))}")
            name, factor = DATASHEET_UNITS[key]
            if name in changes:
                raise ConfigError(f"{key!r} sets {name} a second time: give it in one unit only")
            changes[name] = _numbers(key, value) * factor
        with naming_keys(printed, DATASHEET_UNITS):
            return self.replace(**changes)

    @classmethod
    def from_datasheet(cls, /, source: str = "", **printed: ArrayLike) -> ImuErrorModel:
        """A model from the units that data sheets print.

        Parameters
        ----------
        source : str
            Where the figures come from.
        **printed : number or three numbers
            Keys of :data:`DATASHEET_UNITS`. What is not given is zero; correlation times are infinite.

        Raises
        ------
        ConfigError
            As :meth:`replace_datasheet`.

        Examples
        --------
        >>> model = ImuErrorModel.from_datasheet(arw_deg_per_sqrt_h=0.2, vrw_mps_per_sqrt_h=0.1, gyro_bias_sd_dph=30.0)
        >>> round(model.arw * 60 * 180 / 3.141592653589793, 9)
        0.2
        """
        return cls(source=source).replace_datasheet(**printed)

    def to_datasheet(self) -> dict[str, float | list[float]]:
        """The model in the units of the project file: the first key of :data:`DATASHEET_UNITS` for each field."""
        printed: dict[str, float | list[float]] = {}
        seen: set[str] = set()
        for key, (name, factor) in DATASHEET_UNITS.items():
            if name not in seen:
                seen.add(name)
                printed[key] = (np.asarray(getattr(self, name)) / factor).tolist()
        return printed


def _numbers(name: str, value: ArrayLike) -> Array:
    return numbers(name, value, "a number or three numbers")


def _checked_tau(name: str, value: ArrayLike) -> float:
    tau = _numbers(name, value)
    if tau.ndim != 0 or not tau > 0.0:
        raise ConfigError(f"{name} must be one number > 0 (inf for a constant), not {shown(value)}")
    return float(tau)


def _checked_size(name: str, value: ArrayLike, axes: bool) -> float | Array:
    size = _numbers(name, value)
    if size.shape not in ((), (3,)) or (size.ndim == 1 and not axes):
        wanted = "one number or three" if axes else "one number"
        raise ConfigError(f"{name} must be {wanted}, not an array of shape {size.shape}")
    if not np.all(np.isfinite(size)) or np.any(size < 0.0):
        raise ConfigError(f"{name} must be finite and not negative, not {shown(value)}")
    if size.ndim == 0:
        return float(size)
    size = size.copy()
    size.flags.writeable = False
    return size


def _nearest(name: str, known: list[str]) -> str:
    close = nearest(name, known)
    return f": did you mean {close!r}?" if close else f"; known: {', '.join(known)}"
