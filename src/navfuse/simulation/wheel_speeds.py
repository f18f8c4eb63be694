"""Speeds of single wheels, driven and steered, with the errors of their sensors."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from navfuse.core.printed_keys import shown
from navfuse.data.aiding_logs import WheelSpeedLog
from navfuse.errors import ConfigError
from navfuse.simulation.printed_fields import any_number, one_number, one_or_several, unknown_key, yes_or_no
from navfuse.simulation.sampled_sensor import (
    SAMPLING_UNITS,
    SampledSensor,
    interval_means,
    point_velocity_b,
    rounded,
)
from navfuse.simulation.streams import Streams

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from navfuse.simulation.motion import Motion

Array = np.ndarray


@dataclass(frozen=True, slots=True)
class Wheel:
    """A wheel.

    Attributes
    ----------
    name : str
        Letters, digits and underscores; the column is ``wheel_<name>_mps``.
    forward_m, right_m, down_m : float [m]
        From the IMU to the point of contact with the road, in body axes.
    steered : bool
        Whether it turns in the direction in which its point of contact moves; otherwise it rolls along the forward
        axis.

    Raises
    ------
    ConfigError
        For a name that cannot stand in a column, or a position that is not finite.
    """

    name: str
    forward_m: float = 0.0
    right_m: float = 0.0
    down_m: float = 0.0
    steered: bool = False

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not re.fullmatch(r"[A-Za-z0-9_]+", self.name):
            raise ConfigError(f"a wheel needs a name of letters, digits and underscores, not {self.name!r}")
        for key in ("forward_m", "right_m", "down_m"):
            object.__setattr__(self, key, any_number(f"{key} of wheel {self.name!r}", getattr(self, key)))
        yes_or_no(f"steered of wheel {self.name!r}", self.steered)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class WheelSpeedModel(SampledSensor):
    """Errors of wheel-speed sensors, SI units; zero means absent.

    Attributes
    ----------
    rate, offset, latency : see :class:`~navfuse.simulation.sampled_sensor.SampledSensor`.
    wheels : tuple of Wheel, or of mappings with its fields
        At least one.
    averaged : bool
        Whether a row is the mean over the interval 1/rate before it (as in the coursework of UCL COMP0130) instead of
        the speed at its time.
    scale, scale_sd : number or one per wheel [1]
        Given part of the scale error, and standard deviation of the part drawn once per run and wheel. Typical: 3 %
        (UCL COMP0130).
    speed_sd : float [m/s]
        White noise. Typical: 0.05 m/s (UCL COMP0130).
    speed_lsb : float [m/s]
        Step of rounding. Typical: 0.02 m/s (UCL COMP0130).

    Raises
    ------
    ConfigError
        On construction, for no wheel, two of one name, or a value that is negative, not finite or of the wrong shape.
    """

    WHAT: ClassVar[str] = "wheel speeds"
    UNITS: ClassVar[dict[str, tuple[str, float]]] = SAMPLING_UNITS | {
        "scale_percent": ("scale", 1e-2),
        "scale_ppm": ("scale", 1e-6),
        "scale_sd_percent": ("scale_sd", 1e-2),
        "scale_sd_ppm": ("scale_sd", 1e-6),
        "speed_sd_mps": ("speed_sd", 1.0),
        "speed_sd_cmps": ("speed_sd", 1e-2),
        "speed_lsb_mps": ("speed_lsb", 1.0),
        "speed_lsb_cmps": ("speed_lsb", 1e-2),
    }
    WORDS: ClassVar[tuple[str, ...]] = ("wheels", "averaged")

    rate: float = 10.0
    wheels: tuple[Wheel, ...] = ()
    averaged: bool = True
    scale: ArrayLike = 0.0
    scale_sd: ArrayLike = 0.0
    speed_sd: float = 0.0
    speed_lsb: float = 0.0

    def __post_init__(self) -> None:
        self._settle(wheels=_wheels)
        per_wheel = partial(one_or_several, count=len(self.wheels), what="wheels")
        self._settle(
            averaged=yes_or_no,
            scale=per_wheel,
            scale_sd=partial(per_wheel, least=0.0),
            speed_sd=one_number,
            speed_lsb=one_number,
        )


@dataclass(frozen=True, slots=True, eq=False)
class WheelSpeedTruth:
    """What was added: before rounding, the log is ``(1 + scale) speed + noise``.

    Attributes
    ----------
    true_time : (n,) array [s]
        When each row was measured; its stamp is later by the latency.
    speed : (n, m) array [m/s]
        Without errors.
    scale : (m,) array [1]
    noise : (n, m) array [m/s]
    """

    true_time: Array
    speed: Array
    scale: Array
    noise: Array


def measure_wheel_speeds(
    motion: Motion, model: WheelSpeedModel, rng: np.random.Generator
) -> tuple[WheelSpeedLog, WheelSpeedTruth]:
    """Wheel speeds as real sensors would have written them.

    Parameters
    ----------
    motion : Motion
        Of the IMU.
    model : WheelSpeedModel
    rng : numpy Generator
        Advanced only by spawning children, one per error and wheel.

    Returns
    -------
    log : WheelSpeedLog
    truth : WheelSpeedTruth

    Raises
    ------
    InputError
        When the motion ends before the first sample.

    Notes
    -----
    The road is taken for parallel to the body's x-y plane. With the velocity v of the point of contact, a wheel that is
    not steered has ``v_x``; a steered one has ``hypot(v_x, v_y)`` with the sign of ``v_x``.
    """
    draws = Streams(rng, ("scale", "noise"))
    time = model.sample_times(motion)
    contact = np.array([[wheel.forward_m, wheel.right_m, wheel.down_m] for wheel in model.wheels])
    steered = np.array([wheel.steered for wheel in model.wheels])

    def rolling(at: Array) -> Array:
        v_b = point_velocity_b(motion, at, contact)
        along = v_b[..., 0]
        return np.where(steered, np.copysign(np.hypot(along, v_b[..., 1]), along), along)

    speed = interval_means(rolling, time, 1.0 / model.rate, motion.start) if model.averaged else rolling(time)
    per_wheel = {name: draws[name].spawn(len(model.wheels)) for name in ("scale", "noise")}
    drawn = np.array([stream.standard_normal() for stream in per_wheel["scale"]])
    scale = model.values("scale") + model.values("scale_sd") * drawn
    noise = model.speed_sd * np.column_stack([stream.standard_normal(time.size) for stream in per_wheel["noise"]])
    measured = rounded((1.0 + scale) * speed + noise, model.speed_lsb)
    names = tuple(wheel.name for wheel in model.wheels)
    log = WheelSpeedLog(time + model.latency, names, measured, source="simulation")
    return log, WheelSpeedTruth(time, speed, scale, noise)


def _wheels(name: str, value: Any) -> tuple[Wheel, ...]:
    known = [field.name for field in dataclasses.fields(Wheel)]
    wheels = []
    if isinstance(value, (str, Mapping)) or not isinstance(value, Iterable):
        raise ConfigError(f"{name} must be a list, not {shown(value)}")
    for given in value:
        if isinstance(given, Mapping):
            for key in given:
                if key not in known:
                    raise unknown_key("wheels", key, known)
            wheels.append(Wheel(**{"name": "", **given}))
        elif isinstance(given, Wheel):
            wheels.append(given)
        else:
            raise ConfigError(f"{name} must hold Wheel or tables of its fields, not {type(given).__name__}")
    names = [wheel.name for wheel in wheels]
    if not names:
        raise ConfigError("wheels must name at least one wheel")
    for wheel in names:
        if names.count(wheel) > 1:
            raise ConfigError(f"the wheel {wheel!r} is there twice; give it another name")
    return tuple(wheels)
