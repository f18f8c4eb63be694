"""What the attitude and heading reference believes about sensors, motion and magnetic surroundings."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtri

from navfuse.errors import ConfigError

_MICRO = 1e6
_DEGREE = np.pi / 180.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AhrsSettings:
    """Settings of :func:`navfuse.attitude.ahrs.estimate_attitude`, SI units and radians, for a body held or worn.

    Attributes
    ----------
    block : float [s]
        Covariance and measurements once per block of at least this length; the attitude follows every sample.
    gravity : float [m/s^2]
    gyro_noise : float [rad/sqrt(s)]
        Angle random walk.
    gyro_scale : float [sqrt(s)]
        Rotation adds ``(gyro_scale |w|)^2`` to the square of the angle random walk: scale factors and misalignments of
        about this size whose effect changes direction once a second.
    gyro_bias_sd, gyro_bias_walk : float [rad/s], [rad/s/sqrt(s)]
    accel_noise : float [m/s/sqrt(s)]
        Velocity random walk.
    accel_scale : float [sqrt(s)]
        As `gyro_scale`, for the acceleration.
    accel_bias_sd, accel_bias_walk : float [m/s^2], [m/s^2/sqrt(s)]
    velocity_density, velocity_time : float [m/sqrt(s)], [s sqrt(s)]
        The velocity of the body is taken as white noise of density
        ``velocity_density^2 + (velocity_time a)^2``, where a is the root mean square of the acceleration over the last
        `accel_memory`. Motion to and fro at frequency f has a velocity of a / (2 pi f), 0.16 s of it at 1 Hz.
    accel_memory : float [s]
    mag_noise : float [T]
        Of one sample, white from sample to sample. For a sensor that low-passes: the noise of the mean over a block
        times the root of the number of its samples, which is more than the scatter of its samples.
    mag_bias_sd, mag_bias_walk : float [T], [T/sqrt(s)]
        What the calibration has left.
    mag_delay_sd : float [s]
        How late the magnetometer may be against its stamps. The delay is estimated; 0 leaves it out.
    disturbance_sd, disturbance_tau : float [T], [s]
        Per axis in n, first-order Gauss-Markov in time while the body moves and constant while it rests.
    field_sd, field_walk : float [T], [T/sqrt(s)]
        Of the horizontal and downward strength of the undisturbed field, about `field_n`, or the first sample.
    field_n : (3,) array-like [T] or None
        Field of the Earth, north, east, down, as :func:`navfuse.io.earth_magnetism.magnetic_field_n` gives it. With it
        the heading counts from true north, and a magnetometer with its sign inverted is found.
    declination : float [rad]
        East positive, for a heading from true north where no `field_n` is given.
    initial_tilt_sd, initial_heading_sd, initial_velocity_sd : float [rad], [rad], [m/s]
    gate_probability : float
        Share of good magnetometer blocks that passes the gate; 1 = no gate.
    patience : float [s]
        After rejections over this time the magnetometer is used again, with heading and field doubted.
    rest_rate, rest_force, rest_after : float [rad/s], [m/s^2], [s]
        The body rests once the rate is below, and rate and force within, these of their running means for that long.
    rest_velocity_sd, rest_rate_noise : float [m/s], [rad/sqrt(s)]
        How well velocity and rate are known to be zero then.

    Raises
    ------
    ConfigError
        On construction, for a value out of its range.
    """

    block: float = 0.028
    gravity: float = 9.80665
    gyro_noise: float = 3.6e-4
    gyro_scale: float = 0.008
    gyro_bias_sd: float = 0.01
    gyro_bias_walk: float = 2e-5
    accel_noise: float = 0.01
    accel_scale: float = 0.01
    accel_bias_sd: float = 0.1
    accel_bias_walk: float = 1e-4
    velocity_density: float = 0.1
    velocity_time: float = 0.15
    accel_memory: float = 2.0
    mag_noise: float = 1.5e-6
    mag_bias_sd: float = 5e-7
    mag_bias_walk: float = 1e-9
    mag_delay_sd: float = 0.01
    disturbance_sd: float = 1.5e-6
    disturbance_tau: float = 0.5
    field_sd: float = 5e-6
    field_walk: float = 1e-8
    field_n: ArrayLike | None = None
    declination: float = 0.0
    initial_tilt_sd: float = 0.1
    initial_heading_sd: float = 0.5
    initial_velocity_sd: float = 0.5
    gate_probability: float = 1.0 - 1.4e-6
    patience: float = 30.0
    rest_rate: float = 2.0 * _DEGREE
    rest_force: float = 0.5
    rest_after: float = 1.5
    rest_velocity_sd: float = 0.01
    rest_rate_noise: float = 9e-4

    def __post_init__(self) -> None:
        positive = {"block", "gravity", "accel_memory", "mag_noise", "disturbance_tau", "rest_velocity_sd",
                    "rest_rate_noise", "initial_tilt_sd", "gyro_noise", "field_sd", "velocity_density"}  # fmt: skip
        for name in (field.name for field in fields(self)):
            if name in ("field_n", "declination", "gate_probability"):
                continue
            value: Any = getattr(self, name)
            least = name in positive
            number = float(value) if np.ndim(value) == 0 else np.nan
            if not (np.isfinite(number) and (number > 0.0 if least else number >= 0.0)):
                raise ConfigError(f"{name} = {value!r} has to be a finite number {'> 0' if least else '>= 0'}")
        if not 0.0 < self.gate_probability <= 1.0:
            raise ConfigError(f"gate_probability = {self.gate_probability!r} has to be in (0, 1]")
        if not abs(self.declination) <= np.pi:
            raise ConfigError(f"declination = {self.declination!r} has to be an angle within half a turn")
        if self.field_n is not None:
            field_n = np.asarray(self.field_n, dtype=float)
            if field_n.shape != (3,) or not np.all(np.isfinite(field_n)) or not np.hypot(*field_n[:2]) > 1e-6:
                raise ConfigError(
                    f"field_n = {self.field_n!r} has to be the field north, east, down in tesla, with a horizontal "
                    "part of more than 1 uT"
                )

    @property
    def north(self) -> float:
        """Declination [rad]: of `field_n`, or as given."""
        if self.field_n is None:
            return self.declination
        field_n = np.asarray(self.field_n, dtype=float)
        return float(np.arctan2(field_n[1], field_n[0]))

    def numbers(self) -> tuple[float, ...]:
        """What :func:`navfuse.attitude.ahrs_kernels.forward` takes as `par`, fields in microtesla."""
        tail = 1.0 - self.gate_probability
        gate = float(chdtri(3, tail)) if tail > 0.0 else np.inf
        gaps = (0.2, 1.0, 10.0)
        return tuple(
            float(value)
            for value in (
                self.gravity, self.gyro_noise, self.gyro_scale, self.gyro_bias_walk, self.accel_noise, self.accel_scale,
                self.accel_bias_walk, self.velocity_density, self.velocity_time, self.accel_memory,
                _MICRO * self.mag_noise, _MICRO * self.disturbance_sd, self.disturbance_tau,
                _MICRO * self.mag_bias_walk,
                _MICRO * self.field_walk, 1e-5 if self.mag_delay_sd > 0.0 else 0.0, gate, self.patience, self.rest_rate,
                self.rest_force, self.rest_after, self.rest_velocity_sd, self.rest_rate_noise, *gaps,
            )
        )  # fmt: skip

    def start_sd(self, magnetic: bool) -> np.ndarray:
        """Standard deviations (21,) of the states at the start; see :mod:`navfuse.attitude.ahrs_kernels`."""
        heading = self.initial_heading_sd if magnetic else 0.0
        field = _MICRO * self.field_sd
        return np.concatenate(
            [
                np.full(3, self.initial_velocity_sd),
                np.full(3, _MICRO * self.disturbance_sd),
                [self.initial_tilt_sd, self.initial_tilt_sd, heading],
                np.full(3, self.gyro_bias_sd),
                np.full(3, self.accel_bias_sd),
                np.full(3, _MICRO * self.mag_bias_sd),
                [field, field, self.mag_delay_sd],
            ]
        )
