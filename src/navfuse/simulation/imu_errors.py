"""Everything that a real inertial sensor adds to the truth, in SI units and in the units data sheets print.

:class:`ImuSensorModel` holds the error model of the engine (white noise, biases, scale factors, cross-coupling) and the
errors no filter estimates. :func:`~navfuse.simulation.measured_imu.measure_imu` applies them. The manual derives them
under "How real is it".
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from navfuse.core.constants import ALLAN_FLOOR, STANDARD_GRAVITY
from navfuse.core.printed_keys import naming_keys, shown
from navfuse.errors import ConfigError
from navfuse.imu.error_model import DATASHEET_UNITS, ImuErrorModel
from navfuse.imu.grades import grade
from navfuse.simulation.printed_fields import frozen, numbers, one_number, three_sizes, to_fields, unknown_key

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

Array = np.ndarray

_DEG = math.pi / 180.0
_DPH = _DEG / 3600.0
_G = STANDARD_GRAVITY

SENSOR_UNITS: dict[str, tuple[str, float]] = {
    "gyro_bias_instability_dph": ("gyro_bias_instability", _DPH),
    "gyro_bias_floor_dph": ("gyro_bias_instability", _DPH / ALLAN_FLOOR),
    "accel_bias_instability_ug": ("accel_bias_instability", 1e-6 * _G),
    "accel_bias_floor_ug": ("accel_bias_instability", 1e-6 * _G / ALLAN_FLOOR),
    "bias_instability_tau_s": ("bias_instability_tau", 1.0),
    "gyro_rate_walk_dph_per_sqrt_h": ("gyro_rate_walk", _DPH / 60.0),
    "gyro_rate_walk_degps_per_sqrt_s": ("gyro_rate_walk", _DEG),
    "accel_rate_walk_ug_per_sqrt_h": ("accel_rate_walk", 1e-6 * _G / 60.0),
    "accel_rate_walk_mps2_per_sqrt_s": ("accel_rate_walk", 1.0),
    "gyro_scale_asymmetry_sd_ppm": ("gyro_scale_asymmetry_sd", 1e-6),
    "accel_scale_asymmetry_sd_ppm": ("accel_scale_asymmetry_sd", 1e-6),
    "gyro_g_sensitivity_sd_dph_per_g": ("gyro_g_sensitivity_sd", _DPH / _G),
    "gyro_g_sensitivity_sd_degps_per_g": ("gyro_g_sensitivity_sd", _DEG / _G),
    "gyro_temperature_sd_dph_per_k": ("gyro_temperature_sd", _DPH),
    "gyro_temperature_sd_degps_per_k": ("gyro_temperature_sd", _DEG),
    "accel_temperature_sd_mg_per_k": ("accel_temperature_sd", 1e-3 * _G),
    "temperature_ramp_k_per_h": ("temperature_ramp", 1.0 / 3600.0),
    "temperature_ramp_k_per_min": ("temperature_ramp", 1.0 / 60.0),
    "warm_up_k": ("warm_up", 1.0),
    "warm_up_tau_s": ("warm_up_tau", 1.0),
    "vibration_hz": ("vibration_frequency", 1.0),
    "gyro_vibration_degps": ("gyro_vibration", _DEG),
    "accel_vibration_mg": ("accel_vibration", 1e-3 * _G),
    "vibration_noise_hz": ("vibration_noise_frequency", 1.0),
    "vibration_noise_width_hz": ("vibration_noise_width", 1.0),
    "gyro_vibration_noise_degps": ("gyro_vibration_noise", _DEG),
    "accel_vibration_noise_mg": ("accel_vibration_noise", 1e-3 * _G),
    "gyro_range_degps": ("gyro_range", _DEG),
    "accel_range_g": ("accel_range", _G),
    "gyro_rate_lsb_degps": ("gyro_rate_lsb", _DEG),
    "accel_force_lsb_mg": ("accel_force_lsb", 1e-3 * _G),
    "gyro_angle_lsb_urad": ("gyro_angle_lsb", 1e-6),
    "gyro_angle_lsb_arcsec": ("gyro_angle_lsb", _DPH),
    "accel_velocity_lsb_mmps": ("accel_velocity_lsb", 1e-3),
    "stamp_jitter_sd_us": ("stamp_jitter_sd", 1e-6),
    "stamp_jitter_sd_ms": ("stamp_jitter_sd", 1e-3),
    "stamp_latency_ms": ("stamp_latency", 1e-3),
    "stamp_latency_s": ("stamp_latency", 1.0),
    "dropped_percent": ("dropped_fraction", 1e-2),
    "dropouts_per_h": ("dropout_frequency", 1.0 / 3600.0),
    "dropout_s": ("dropout_length", 1.0),
}
"""Key with its printed unit -> (field of :class:`ImuSensorModel`, factor to SI); the keys of the engine's
:data:`~navfuse.imu.error_model.DATASHEET_UNITS` are accepted beside them."""

_AXES = (
    "gyro_bias_instability", "accel_bias_instability", "gyro_rate_walk", "accel_rate_walk",
    "gyro_scale_asymmetry_sd", "accel_scale_asymmetry_sd", "gyro_g_sensitivity_sd", "gyro_temperature_sd",
    "accel_temperature_sd", "gyro_vibration_noise", "accel_vibration_noise",
)  # fmt: skip
_SIZES = (
    "warm_up_tau", "vibration_noise_frequency", "vibration_noise_width", "gyro_rate_lsb", "accel_force_lsb",
    "gyro_angle_lsb", "accel_velocity_lsb", "stamp_jitter_sd", "dropped_fraction", "dropout_frequency",
    "dropout_length",
)  # fmt: skip
_SIGNED = ("temperature_ramp", "warm_up", "stamp_latency")


@dataclass(frozen=True, slots=True, eq=False)
class ImuSensorModel:
    """Errors of an inertial sensor as installed, SI units and radians; zero (a range: infinite) means absent.

    Fields marked *axes* take a number (every axis alike) or three; all are kept as three. What ends in ``_sd`` is drawn
    once per run, per axis, from a normal distribution.

    Attributes
    ----------
    base : ImuErrorModel
        White noise, biases, scale factors, cross-coupling. Its ``*_bias_walk``, in the ready-made grades, stands for
        the in-run instability; set it to zero beside an instability and a rate walk of their own.
    gyro_bias_instability, accel_bias_instability : axes [rad/s], [m/s^2]
        Coefficient B of the flicker (1/f) noise of the bias, two-sided density ``B^2 / (2 pi f)``. The Allan deviation
        is flat at 0.664 B, and this floor is what most makers print as "bias instability" (Sensonor's FAQ on the STIM
        series says so): enter it by the ``*_floor_*`` keys. Typical: floor 0.5 deg/h and 50 ug (Sensonor STIM300), 5.1
        deg/h (Analog Devices ADIS16488A).
    bias_instability_tau : (2,) array [s]
        Shortest and longest correlation time of the Gauss-Markov processes that make up the flicker noise, one per
        decade; default 0.1 and 10^4. The floor holds within 2 % from 12 times the shortest to a third of the longest.
    gyro_rate_walk, accel_rate_walk : axes [rad/s/sqrt(s)], [m/s^2/sqrt(s)]
        Density K of a random walk of the bias (rate random walk); Allan deviation ``K sqrt(tau / 3)``. Zero at the
        first sample. Typical: 3.8e-5 deg/s/sqrt(s) for a soldered MEMS part (as in the grade icm-45686).
    gyro_scale_asymmetry_sd, accel_scale_asymmetry_sd : axes [1]
        A scale factor that has the sign of the input: ``a |x|`` is added (Groves 2013, section 4.4). Typical (our
        estimate): tens of ppm for a tactical unit, up to some 1000 ppm for an uncalibrated MEMS part.
    gyro_g_sensitivity_sd : axes [rad/s per m/s^2]
        Of each element of a 3 x 3 matrix that turns specific force into angular rate, by row (gyro axis). Typical: 1
        deg/h/g compensated (Sensonor STIM300), 0.015 deg/s/g = 54 deg/h/g (Analog Devices ADIS16445).
    gyro_temperature_sd, accel_temperature_sd : axes [rad/s/K], [m/s^2/K]
        Of the change of bias per kelvin. Typical: 0.01 to 0.05 deg/s/K and 0.1 to 1 mg/K for consumer MEMS (as in
        the grade consumer).
    temperature_ramp, warm_up, warm_up_tau : float [K/s], [K], [s]
        The temperature is ``ramp t + warm_up (1 - exp(-t / warm_up_tau))`` above that of the first sample. Typical (our
        estimate): 10 to 20 K in 600 s after switch-on.
    vibration_frequency : (m,) array [Hz]
    gyro_vibration, accel_vibration : (m,) or (m, 3) arrays [rad/s], [m/s^2]
        Peak amplitudes of m sinusoids, every axis alike or per axis; phases are drawn per run and axis. Typical (our
        estimate): 20 mg at 25 Hz in an idling car, four cylinders at 750 revolutions per minute.
    vibration_noise_frequency, vibration_noise_width : float [Hz]
    gyro_vibration_noise, accel_vibration_noise : axes [rad/s], [m/s^2]
        Standard deviation of noise in a resonance at that frequency with that width between half-power points.
    gyro_range, accel_range : float [rad/s], [m/s^2]
        Beyond which the output is clipped; for increments, their mean over the interval. Typical: 450 deg/s and 18 g
        (ADIS16488A).
    gyro_rate_lsb, accel_force_lsb : float [rad/s], [m/s^2]
        Step of the output of rates, rounded to nearest. Typical: 0.061 deg/s and 0.49 mg, 16 bits over +-2000 deg/s and
        +-16 g.
    gyro_angle_lsb, accel_velocity_lsb : float [rad], [m/s]
        Step of the output of increments; the remainder is carried on to the next, so that no angle is lost.
    stamp_jitter_sd : float [s]
        Of a normal error of each time stamp. Stamps stay in order: none is less than 1 us behind the one before.
    stamp_latency : float [s]
        How late the stamps are; negative if early. A filter corrects it with ``time_offset_s = -latency``.
    dropped_fraction : float
        Chance of each row to be lost, in [0, 1). The first row is always there.
    dropout_frequency, dropout_length : float [1/s], [s]
        Mean number of longer losses per time (Poisson), and how long each takes.

    Raises
    ------
    ConfigError
        On construction, for a value that is negative, not finite or of the wrong shape, or one that lacks another.
    """

    base: ImuErrorModel = field(default_factory=ImuErrorModel)
    gyro_bias_instability: ArrayLike = 0.0
    accel_bias_instability: ArrayLike = 0.0
    bias_instability_tau: ArrayLike = (0.1, 1e4)
    gyro_rate_walk: ArrayLike = 0.0
    accel_rate_walk: ArrayLike = 0.0
    gyro_scale_asymmetry_sd: ArrayLike = 0.0
    accel_scale_asymmetry_sd: ArrayLike = 0.0
    gyro_g_sensitivity_sd: ArrayLike = 0.0
    gyro_temperature_sd: ArrayLike = 0.0
    accel_temperature_sd: ArrayLike = 0.0
    temperature_ramp: float = 0.0
    warm_up: float = 0.0
    warm_up_tau: float = 0.0
    vibration_frequency: ArrayLike = ()
    gyro_vibration: ArrayLike = ()
    accel_vibration: ArrayLike = ()
    vibration_noise_frequency: float = 0.0
    vibration_noise_width: float = 0.0
    gyro_vibration_noise: ArrayLike = 0.0
    accel_vibration_noise: ArrayLike = 0.0
    gyro_range: float = math.inf
    accel_range: float = math.inf
    gyro_rate_lsb: float = 0.0
    accel_force_lsb: float = 0.0
    gyro_angle_lsb: float = 0.0
    accel_velocity_lsb: float = 0.0
    stamp_jitter_sd: float = 0.0
    stamp_latency: float = 0.0
    dropped_fraction: float = 0.0
    dropout_frequency: float = 0.0
    dropout_length: float = 0.0

    def __post_init__(self) -> None:
        if not isinstance(self.base, ImuErrorModel):
            raise ConfigError(f"base must be an ImuErrorModel, not {type(self.base).__name__}")
        checked: dict[str, Any] = {name: three_sizes(name, getattr(self, name)) for name in _AXES}
        checked |= {name: one_number(name, getattr(self, name)) for name in _SIZES}
        checked |= {name: one_number(name, getattr(self, name), least=-math.inf) for name in _SIGNED}
        for name in ("gyro_range", "accel_range"):
            checked[name] = one_number(name, getattr(self, name), infinite=True, above=True)
        checked["bias_instability_tau"] = _decades(self.bias_instability_tau)
        frequency = np.atleast_1d(numbers("vibration_frequency", self.vibration_frequency))
        if frequency.ndim != 1 or not np.all(np.isfinite(frequency)) or np.any(frequency <= 0.0):
            raise ConfigError(f"vibration_frequency must be finite numbers > 0, not {shown(self.vibration_frequency)}")
        checked["vibration_frequency"] = frozen(frequency)
        for name in ("gyro_vibration", "accel_vibration"):
            checked[name] = _amplitudes(name, getattr(self, name), frequency.size)
        for name, value in checked.items():
            object.__setattr__(self, name, value)
        self._check_pairs()

    def _check_pairs(self) -> None:
        if np.any(self.axes("gyro_vibration_noise") + self.axes("accel_vibration_noise") > 0.0):
            if not self.vibration_noise_width > 0.0:
                raise ConfigError("vibration noise needs vibration_noise_width > 0, and the frequency it is centred on")
        if self.warm_up != 0.0 and not self.warm_up_tau > 0.0:
            raise ConfigError("warm_up needs warm_up_tau > 0")
        if not self.dropped_fraction < 1.0:
            raise ConfigError(f"dropped_fraction must be less than 1, not {shown(self.dropped_fraction)}")
        if (self.dropout_frequency > 0.0) != (self.dropout_length > 0.0):
            raise ConfigError("dropout_frequency and dropout_length need each other: give both > 0")

    def axes(self, name: str) -> Array:
        """A field marked *axes* as (3,) array, in its own unit."""
        return np.asarray(getattr(self, name))

    @classmethod
    def from_datasheet(cls, base: str | ImuErrorModel = "", /, **printed: Any) -> ImuSensorModel:
        """A model from the units that data sheets print.

        Parameters
        ----------
        base : str or ImuErrorModel
            Name of a grade, or a model; the empty string for one without errors.
        **printed : number or array
            Keys of :data:`SENSOR_UNITS`, and those of :data:`~navfuse.imu.error_model.DATASHEET_UNITS`, which change
            the base.

        Raises
        ------
        ConfigError
            For an unknown grade, key or unit (the nearest is named), a field given in two units, or a value the model
            refuses.

        Examples
        --------
        >>> model = ImuSensorModel.from_datasheet("tactical", gyro_bias_floor_dph=0.5, gyro_range_degps=400.0)
        >>> round(model.gyro_range, 3)
        6.981
        """
        start = base if isinstance(base, ImuErrorModel) else grade(base) if base else ImuErrorModel()
        return cls(start).replace_datasheet(**printed)

    def replace_datasheet(self, /, **printed: Any) -> ImuSensorModel:
        """A copy with some fields changed, in printed units; see :meth:`from_datasheet`.

        Raises
        ------
        ConfigError
            As :meth:`from_datasheet`.
        """
        for key in printed:
            if key not in SENSOR_UNITS and key not in DATASHEET_UNITS:
                raise unknown_key("IMU errors", key, [*DATASHEET_UNITS, *SENSOR_UNITS])
        base = self.base.replace_datasheet(**{key: printed[key] for key in printed if key in DATASHEET_UNITS})
        own = {key: printed[key] for key in printed if key in SENSOR_UNITS}
        fields = to_fields("IMU errors", own, SENSOR_UNITS)
        with naming_keys(own, SENSOR_UNITS):
            return dataclasses.replace(self, base=base, **fields)


def _decades(value: ArrayLike) -> Array:
    tau = numbers("bias_instability_tau", value)
    if tau.shape != (2,) or not (0.0 < tau[0] and 10.0 * tau[0] <= tau[1] < np.inf):
        raise ConfigError(
            "bias_instability_tau must be the shortest and the longest correlation time, > 0 and a decade or more "
            f"apart, not {shown(value)}"
        )
    return frozen(tau)


def _amplitudes(name: str, value: ArrayLike, count: int) -> Array:
    sizes = numbers(name, value)
    sizes = np.zeros(count) if sizes.size == 0 else np.atleast_1d(sizes)
    if sizes.shape not in ((count,), (count, 3)):
        raise ConfigError(
            f"{name} must hold one amplitude, or three, for each of the {count} values of vibration_frequency, "
            f"not an array of shape {sizes.shape}"
        )
    if not np.all(np.isfinite(sizes)) or np.any(sizes < 0.0):
        raise ConfigError(f"{name} must be finite and not negative, not {shown(value)}")
    return frozen(np.broadcast_to(sizes.reshape(count, -1), (count, 3)) if count else np.zeros((0, 3)))
