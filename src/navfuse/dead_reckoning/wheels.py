"""Speed and yaw rate of a vehicle from the speeds of its wheels: one, two or four, steered or not.

The vehicle is rigid and rolls on its fixed axle without slipping sideways. A point that is ahead of the middle of that
axle by x and right of it by y moves forward with u - w y and to the right with w x, where u is the speed of the middle
and w the yaw rate, clockwise from above. A wheel that does not steer measures the forward part. A steered one measures
the part along its own heading: with the steering angle known that of the angle, else, as Ackermann's geometry lets it
roll freely, all of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from navfuse.data.aiding_logs import WheelSpeedLog
from navfuse.dead_reckoning.odometry import Steps
from navfuse.errors import ConfigError, InputError

Array = np.ndarray

ITERATIONS = 8
"""Of Gauss and Newton for freely steered wheels; two do where speed is more than wheelbase times yaw rate."""
WIDEST, NARROWEST = 20.0, 0.02


@dataclass(frozen=True, slots=True)
class Wheel:
    """Where a wheel is.

    Attributes
    ----------
    forward, right : float [m]
        From the point of the vehicle whose track is wanted, such as the antenna.
    steered : bool
    used : bool
        False for a wheel whose speed is not to be trusted, such as a driven one that slips.
    """

    forward: float
    right: float
    steered: bool = False
    used: bool = True


@dataclass(frozen=True, slots=True)
class WheelGeometry:
    """The wheels of a vehicle by the names that their log gives them.

    Attributes
    ----------
    wheels : dict of str to Wheel

    Raises
    ------
    ConfigError
        On construction, if there is no wheel, a coordinate is no number or too large for a vehicle, the unsteered
        wheels are not on one axle, two wheels are in one place, or none is used.
    """

    wheels: Mapping[str, Wheel]

    def __post_init__(self) -> None:
        if not any(wheel.used for wheel in self.wheels.values()):
            raise ConfigError("wheel geometry: no wheel to use; give at least one with its place")
        for name, wheel in self.wheels.items():
            if not (abs(wheel.forward) < WIDEST and abs(wheel.right) < WIDEST):
                raise ConfigError(
                    f"wheel geometry: wheel {name} at ({wheel.forward}, {wheel.right}) m forward and right is not on a "
                    f"vehicle; places are in metres, below {WIDEST:g}"
                )
        fixed = {name: wheel.forward for name, wheel in self.wheels.items() if not wheel.steered}
        if not fixed:
            raise ConfigError(
                "wheel geometry: every wheel is steered; one has to be fixed, where the vehicle turns about"
            )
        if max(fixed.values()) - min(fixed.values()) > NARROWEST:
            raise ConfigError(
                f"wheel geometry: the wheels {', '.join(fixed)} do not steer, but are not on one axle "
                f"({', '.join(f'{at:g}' for at in fixed.values())} m forward): such a vehicle could not turn"
            )
        names = list(self.wheels)
        for k, name in enumerate(names):
            for other in names[:k]:
                a, b = self.wheels[name], self.wheels[other]
                if np.hypot(a.forward - b.forward, a.right - b.right) < NARROWEST:
                    raise ConfigError(f"wheel geometry: wheels {other} and {name} are in one place")

    @property
    def axle(self) -> float:
        """How far ahead of the reference point the fixed axle is [m]."""
        return float(np.mean([wheel.forward for wheel in self.wheels.values() if not wheel.steered]))

    @property
    def lever(self) -> tuple[float, float]:
        """From the middle line of the fixed axle to the reference point: forward, right [m]."""
        return -self.axle, 0.0


@dataclass(frozen=True, slots=True, eq=False)
class WheelMotion:
    """What the wheels say of the vehicle.

    Attributes
    ----------
    time : (n,) array [s]
    speed : (n,) array [m/s]
        Of the point of the fixed axle straight behind or ahead of the reference point.
    yaw_rate : (n,) array [rad/s]
        Clockwise from above.
    sd_speed, sd_yaw_rate : (n,) arrays
    residual : (n, m) array [m/s]
        Of every wheel, measured minus adjusted, in the order of the geometry; NaN where it was not used.
    slipped : (n, m) bool array
        Wheels left out because they contradicted the others.
    source : str
    """

    time: Array
    speed: Array
    yaw_rate: Array
    sd_speed: Array
    sd_yaw_rate: Array
    residual: Array
    slipped: Array
    source: str

    def steps(self, yaw_rate: Array | None = None) -> Steps:
        """Distances and turns, taking every row for the mean over the interval that ends at it.

        Parameters
        ----------
        yaw_rate : (n,) array [rad/s], optional
            Of a gyro instead of the wheels.
        """
        dt = np.diff(self.time)
        rate = self.yaw_rate if yaw_rate is None else np.asarray(yaw_rate, dtype=float)
        return Steps(self.time, self.speed[1:] * dt, rate[1:] * dt, self.source)


def wheel_motion(
    log: WheelSpeedLog,
    geometry: WheelGeometry,
    *,
    sd_speed: float = 0.05,
    yaw_rate: Array | None = None,
    sd_yaw_rate: float = 0.01,
    steering: Mapping[str, Array] | None = None,
    slip_threshold: float = 5.0,
) -> WheelMotion:
    """Least squares over the wheels of every row, and a gyro where there is one.

    Parameters
    ----------
    log : WheelSpeedLog
        A wheel may be NaN in some rows.
    geometry : WheelGeometry
        Names must be those of the log; wheels of the log that it lacks are not used.
    sd_speed : float [m/s]
        Of a wheel speed.
    yaw_rate : (n,) array [rad/s], optional
        Of a gyro at the rows of the log, clockwise from above; needed where the wheels alone do not tell.
    sd_yaw_rate : float [rad/s]
        Of it, its bias included.
    steering : dict of str to (n,) array [rad], optional
        Angles of steered wheels, positive to the right; these do not slip sideways either. Without them they are
        taken to roll freely.
    slip_threshold : float
        A wheel whose residual is more than so many of its standard deviations is left out, the worst one of a row, as
        long as speed and yaw rate are still overdetermined.

    Returns
    -------
    WheelMotion

    Raises
    ------
    ConfigError
        If a wheel of the geometry is not in the log, a steering angle is not of a steered wheel, or the wheels do not
        determine speed and yaw rate.
    InputError
        If an array has another length than the log.

    Notes
    -----
    A freely steered wheel measures ``|v|`` with the sign of its forward part, made linear about the last estimate.
    """
    missing = [name for name in geometry.wheels if name not in log.wheels]
    if missing:
        raise ConfigError(f"{log.source}: has no wheel {missing[0]!r}; it has {', '.join(log.wheels)}")
    if not sd_speed > 0.0 or not sd_yaw_rate > 0.0 or not slip_threshold > 0.0:
        raise ConfigError("sd_speed, sd_yaw_rate and slip_threshold of wheels must be positive")
    n = log.time.size
    angles = dict(steering or {})
    for name, values in (*angles.items(), ("yaw_rate", yaw_rate)):
        if values is not None and np.shape(values) != (n,):
            raise InputError(f"{log.source}: {name} has shape {np.shape(values)}, the log has {n} rows")
    names = list(geometry.wheels)
    z = log.speed[:, [log.wheels.index(name) for name in names]].copy()
    z[:, [not wheel.used for wheel in geometry.wheels.values()]] = np.nan
    m = len(names)
    unknown = [name for name in angles if name not in names or not geometry.wheels[name].steered]
    if unknown:
        raise ConfigError(f"{log.source}: there is a steering angle of {unknown[0]!r}, which is not a steered wheel")
    rolling = np.zeros((n, len(angles)))
    rate = np.full(n, np.nan) if yaw_rate is None else np.asarray(yaw_rate, dtype=float)
    measured = np.column_stack((z, rate, rolling))
    weight = np.full(measured.shape[1], sd_speed**-2)
    weight[m] = sd_yaw_rate**-2
    use = np.isfinite(measured)
    slipped = np.zeros((n, m), dtype=bool)
    while True:
        x, cov, residual = _adjust(measured, use, weight, geometry, angles)
        if not np.isfinite(cov).all():
            row = int(np.flatnonzero(~np.isfinite(cov).all(axis=(1, 2)))[0])
            raise ConfigError(
                f"{log.source}: at {log.time[row]:.3f} s the wheels do not tell speed and yaw rate: give a second "
                "wheel beside the first, or the yaw rate of a gyro"
            )
        spread = _residual_sd(x, cov, use, weight, geometry, angles)
        ratio = np.where(use[:, :m], np.abs(residual[:, :m]) / spread[:, :m], 0.0)
        worst = np.argmax(ratio, axis=1)
        out = (ratio[np.arange(n), worst] > slip_threshold) & (use.sum(axis=1) > 3)
        if not out.any():
            break
        use[out, worst[out]] = False
        slipped[out, worst[out]] = True
    residual = np.where(use, residual, np.nan)[:, :m]
    sd = np.sqrt(np.diagonal(cov, axis1=1, axis2=2))
    return WheelMotion(log.time, x[:, 0], x[:, 1], sd[:, 0], sd[:, 1], residual, slipped, log.source)


def _predicted(x: Array, geometry: WheelGeometry, angles: Mapping[str, Array]) -> tuple[Array, Array]:
    """Measurements (n, m) and their derivatives (n, m, 2) with respect to speed and yaw rate.

    Wheel speeds, the yaw rate, then what wheels with a known angle move sideways, which is nothing.
    """
    n, m = len(x), len(geometry.wheels)
    h, H = np.zeros((n, m + 1 + len(angles))), np.zeros((n, m + 1 + len(angles), 2))
    u, w = x.T
    for k, (name, wheel) in enumerate(geometry.wheels.items()):
        ahead = wheel.forward - geometry.axle
        forward, right = u - w * wheel.right, w * ahead
        if name in angles:
            c, s = np.cos(angles[name]), np.sin(angles[name])
            at = m + 1 + list(angles).index(name)
            h[:, at] = c * right - s * forward
            H[:, at, 0], H[:, at, 1] = -s, s * wheel.right + c * ahead
        elif wheel.steered:
            size = np.maximum(np.hypot(forward, right), 1e-12)
            # Standing still it points ahead as far as anybody knows.
            c, s = np.where(size > 1e-9, np.abs(forward) / size, 1.0), right * np.where(forward < 0.0, -1.0, 1.0) / size
        else:
            c, s = np.ones(n), np.zeros(n)
        h[:, k] = c * forward + s * right
        H[:, k, 0], H[:, k, 1] = c, -c * wheel.right + s * ahead
    h[:, m], H[:, m, 1] = w, 1.0
    return h, H


def _adjust(
    z: Array, use: Array, weight: Array, geometry: WheelGeometry, angles: Mapping[str, Array]
) -> tuple[Array, Array, Array]:
    x = np.zeros((len(z), 2))
    known = np.where(use, z, 0.0)
    W = use * weight
    for _ in range(ITERATIONS):
        h, H = _predicted(x, geometry, angles)
        N = np.einsum("kmi,km,kmj->kij", H, W, H)
        b = np.einsum("kmi,km->ki", H, W * (known - h))
        det = N[:, 0, 0] * N[:, 1, 1] - N[:, 0, 1] ** 2
        good = det > 1e-9 * N[:, 0, 0] * np.maximum(N[:, 1, 1], weight.min() * NARROWEST**2)
        cov = np.full_like(N, np.nan)
        cov[good] = np.linalg.inv(N[good])
        x = x + np.einsum("kij,kj->ki", np.where(good[:, None, None], cov, 0.0), b)
    return x, cov, known - _predicted(x, geometry, angles)[0]


def _residual_sd(
    x: Array, cov: Array, use: Array, weight: Array, geometry: WheelGeometry, angles: Mapping[str, Array]
) -> Array:
    """Standard deviation (n, m) of the residuals; inf where a measurement is not checked by the others."""
    _, H = _predicted(x, geometry, angles)
    variance = 1.0 / weight - np.einsum("kmi,kij,kmj->km", H, cov, H)
    return np.where(use & (variance > 1e-6 / weight), np.sqrt(np.maximum(variance, 0.0)), np.inf)
