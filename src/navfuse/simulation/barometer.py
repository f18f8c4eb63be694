"""A barometer: the pressure of an atmosphere that is not quite the standard one, and the errors of the sensor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from navfuse.core.atmosphere import (
    CEILING,
    SEA_LEVEL_PRESSURE,
    SEA_LEVEL_TEMPERATURE,
    air_density,
    air_pressure,
    air_temperature,
    geopotential_height,
    pressure_height,
)
from navfuse.core.earth import ecef_to_geodetic_batch
from navfuse.core.printed_keys import shown
from navfuse.data.aiding_logs import BarometerLog
from navfuse.errors import ConfigError, InputError
from navfuse.simulation.printed_fields import any_number, one_number, tau, three_numbers
from navfuse.simulation.sampled_sensor import (
    SAMPLING_UNITS,
    SampledSensor,
    level_to_body,
    need_tau,
    point_velocity_b,
    rounded,
    wander,
)
from navfuse.simulation.sensors import antenna_state
from navfuse.simulation.streams import Streams

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from navfuse.simulation.motion import Motion

Array = np.ndarray

_HPA = 100.0
_OUTPUTS = ("pressure", "height", "both")
_DEEPEST = -5000.0


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class BarometerModel(SampledSensor):
    """Errors of a barometer and of the weather, SI units; zero means absent.

    Attributes
    ----------
    rate, offset, latency : see :class:`~navfuse.simulation.sampled_sensor.SampledSensor`.
    output : {"pressure", "height", "both"}
        What the log holds.
    lever_arm : (3,) array [m]
        IMU to the pressure port, body forward-right-down.
    undulation : float [m]
        Height of the geoid above the ellipsoid, the same along the whole motion: height above sea level is ellipsoidal
        height less this.
    sea_level_pressure : float [Pa]
        Of the day. Typical: 101325 +- 1000.
    temperature_deviation : float [K]
        Of the air from the standard atmosphere, the same at all heights below the tropopause. 10 K stretch heights by
        3.5 %.
    altimeter_setting : float [Pa]
        Sea-level pressure that the instrument uses to turn pressure into height in the standard atmosphere.
    weather_sd, weather_tau : float [Pa], [s]
        Stationary first-order Gauss-Markov change of the pressure. Typical: 500 Pa over a day (our estimate).
    pressure_walk : float [Pa/sqrt(s)]
        Random walk from zero. Typical: 1 Pa/sqrt(s) (our estimate), that is 60 Pa or 5 m after an hour.
    bias, bias_sd : float [Pa]
        Given offset, and standard deviation of the part drawn once per run. Typical: 50 Pa (Bosch BMP390 data sheet,
        absolute accuracy).
    pressure_sd : float [Pa]
        White noise. Typical: 0.02 Pa at the slowest setting (Bosch BMP390 data sheet); gusts and doors make it a few
        (our estimate).
    pressure_lsb, height_lsb : float [Pa], [m]
        Steps of rounding. Typical: 0.016 Pa (Bosch BMP390 data sheet, finest).
    dynamic_pressure_factor : float [1]
        Share of the dynamic pressure ``density * airspeed^2 / 2`` that the port sees too; negative for suction.
        Typical: -0.1 to 0.1 for a port that was not calibrated (our estimate).
    wind : (3,) array [m/s]
        North, east, down; the airspeed is that of the port against it.

    Raises
    ------
    ConfigError
        On construction, for a value that is negative, not finite or of the wrong shape, or one that lacks another.
    """

    WHAT: ClassVar[str] = "barometer"
    UNITS: ClassVar[dict[str, tuple[str, float]]] = SAMPLING_UNITS | {
        "lever_arm_m": ("lever_arm", 1.0),
        "undulation_m": ("undulation", 1.0),
        "sea_level_pressure_hpa": ("sea_level_pressure", _HPA),
        "temperature_deviation_k": ("temperature_deviation", 1.0),
        "altimeter_setting_hpa": ("altimeter_setting", _HPA),
        "weather_sd_hpa": ("weather_sd", _HPA),
        "weather_sd_pa": ("weather_sd", 1.0),
        "weather_tau_s": ("weather_tau", 1.0),
        "weather_tau_h": ("weather_tau", 3600.0),
        "pressure_walk_pa_per_sqrt_s": ("pressure_walk", 1.0),
        "pressure_walk_hpa_per_sqrt_h": ("pressure_walk", _HPA / 60.0),
        "bias_pa": ("bias", 1.0),
        "bias_hpa": ("bias", _HPA),
        "bias_sd_pa": ("bias_sd", 1.0),
        "bias_sd_hpa": ("bias_sd", _HPA),
        "pressure_sd_pa": ("pressure_sd", 1.0),
        "pressure_sd_hpa": ("pressure_sd", _HPA),
        "pressure_lsb_pa": ("pressure_lsb", 1.0),
        "pressure_lsb_hpa": ("pressure_lsb", _HPA),
        "height_lsb_m": ("height_lsb", 1.0),
        "dynamic_pressure_percent": ("dynamic_pressure_factor", 1e-2),
        "wind_mps": ("wind", 1.0),
    }
    WORDS: ClassVar[tuple[str, ...]] = ("output",)

    rate: float = 10.0
    output: str = "pressure"
    lever_arm: ArrayLike = (0.0, 0.0, 0.0)
    undulation: float = 0.0
    sea_level_pressure: float = SEA_LEVEL_PRESSURE
    temperature_deviation: float = 0.0
    altimeter_setting: float = SEA_LEVEL_PRESSURE
    weather_sd: float = 0.0
    weather_tau: float = 0.0
    pressure_walk: float = 0.0
    bias: float = 0.0
    bias_sd: float = 0.0
    pressure_sd: float = 0.0
    pressure_lsb: float = 0.0
    height_lsb: float = 0.0
    dynamic_pressure_factor: float = 0.0
    wind: ArrayLike = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        sizes = ("weather_sd", "pressure_walk", "bias_sd", "pressure_sd", "pressure_lsb", "height_lsb")
        self._settle(**dict.fromkeys(sizes, one_number), weather_tau=tau, lever_arm=three_numbers, wind=three_numbers)
        self._settle(undulation=any_number, bias=any_number, dynamic_pressure_factor=any_number)
        if self.output not in _OUTPUTS:
            raise ConfigError(f"output must be one of {', '.join(_OUTPUTS)}, not {shown(self.output)}")
        for name, low, high, unit in (
            ("sea_level_pressure", 85000.0, 110000.0, "Pa"),
            ("altimeter_setting", 85000.0, 110000.0, "Pa"),
            ("temperature_deviation", -80.0, 80.0, "K"),
        ):
            value = any_number(name, getattr(self, name))
            if not low <= value <= high:
                raise ConfigError(f"{name} must be within {low:g} to {high:g} {unit}, not {value:g}")
            object.__setattr__(self, name, value)
        need_tau("weather_sd", self.weather_sd, "weather_tau", self.weather_tau)


@dataclass(frozen=True, slots=True, eq=False)
class BarometerTruth:
    """What was added: before rounding, the pressure is ``pressure + weather + walk + dynamic + bias + noise``.

    Attributes
    ----------
    true_time : (n,) array [s]
        When each row was measured; its stamp is later by the latency.
    height : (n,) array [m]
        Of the port above sea level.
    pressure : (n,) array [Pa]
        Static, of the atmosphere of the day at this height.
    weather, walk, dynamic, noise : (n,) arrays [Pa]
    bias : float [Pa]
    """

    true_time: Array
    height: Array
    pressure: Array
    weather: Array
    walk: Array
    dynamic: Array
    noise: Array
    bias: float


def measure_barometer(
    motion: Motion, model: BarometerModel, rng: np.random.Generator
) -> tuple[BarometerLog, BarometerTruth]:
    """Pressures, or heights made of them, as a real barometer would have written them.

    Parameters
    ----------
    motion : Motion
        Of the IMU.
    model : BarometerModel
    rng : numpy Generator
        Advanced only by spawning children, one per error.

    Returns
    -------
    log : BarometerLog
        Heights are geopotential, in the standard atmosphere above the altimeter setting, as altimeters show them: 1.4 m
        less than geometric ones at 3 km.
    truth : BarometerTruth

    Raises
    ------
    InputError
        When the motion ends before the first sample or leaves -5 to 20 km above sea level, or a pressure is not
        positive.
    """
    draws = Streams(rng, ("weather", "walk", "bias", "noise"))
    time = model.sample_times(motion)
    height = ecef_to_geodetic_batch(antenna_state(motion, time, model.lever_arm)[0])[2] - model.undulation
    geopotential = geopotential_height(height)
    outside = (geopotential > CEILING) | (geopotential < _DEEPEST)
    if outside.any():
        raise InputError(
            f"the standard atmosphere of the barometer holds from {_DEEPEST / 1e3:g} to {CEILING / 1e3:g} km above sea "
            f"level, the motion is at {height[np.argmax(outside)] / 1e3:.3g} km"
        )
    temperature = SEA_LEVEL_TEMPERATURE + model.temperature_deviation
    pressure = air_pressure(geopotential, model.sea_level_pressure, temperature)
    air_b = point_velocity_b(motion, time, model.lever_arm) - level_to_body(motion, time, model.wind)
    density = air_density(pressure, air_temperature(geopotential, temperature))
    dynamic = model.dynamic_pressure_factor * 0.5 * density * np.einsum("ki,ki->k", air_b, air_b)
    weather = wander(time, model.weather_sd, model.weather_tau, 0.0, draws["weather"])
    walk = wander(time, 0.0, np.inf, model.pressure_walk, draws["walk"])
    bias = model.bias + model.bias_sd * float(draws["bias"].standard_normal())
    noise = model.pressure_sd * draws["noise"].standard_normal(time.size)
    measured = rounded(pressure + weather + walk + dynamic + bias + noise, model.pressure_lsb)
    if not np.all(measured > 0.0):
        raise InputError(f"the errors of the barometer make a pressure of {measured.min():.3g} Pa; give smaller ones")
    indicated = rounded(pressure_height(measured, model.altimeter_setting), model.height_lsb)
    log = BarometerLog(
        time + model.latency,
        None if model.output == "height" else measured,
        None if model.output == "pressure" else indicated,
        source="simulation",
    )
    return log, BarometerTruth(time, height, pressure, weather, walk, dynamic, noise, bias)
