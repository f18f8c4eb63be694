"""Vehicles: motions as a car, an aircraft or a tripod makes them."""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial.transform import Rotation

from navfuse.core.constants import STANDARD_GRAVITY
from navfuse.core.earth import geodetic_to_ecef
from navfuse.core.rotation import dcm_from_euler
from navfuse.errors import ConfigError
from navfuse.simulation.bounds import require_rows
from navfuse.simulation.motion import Motion
from navfuse.simulation.paths import STEEPEST, LocalMap, SmoothSteps, Terrain, Turning, integrate_path

Array = np.ndarray

_SPACING = 0.1
_ROLL_PER_ACCELERATION = math.radians(4.0) / STANDARD_GRAVITY
_PITCH_PER_ACCELERATION = math.radians(1.5) / STANDARD_GRAVITY


def static(
    duration: float,
    lat: float = 0.8,
    lon: float = 0.2,
    height: float = 100.0,
    roll: float = 0.0,
    pitch: float = 0.0,
    heading: float = 0.0,
) -> Motion:
    """A body at rest on the Earth.

    Parameters
    ----------
    duration : float [s]
        From time 0.
    lat, lon, height : float [rad, rad, m]
    roll, pitch, heading : float [rad]

    Raises
    ------
    ConfigError
        For a duration that is not positive and finite.
    """
    _require_positive("duration", duration)
    local = LocalMap.at(lat, lon)
    C_en = np.column_stack([local.north, local.east, -local.up])
    C_eb = C_en @ np.array(dcm_from_euler(roll, pitch, heading)).reshape(3, 3)
    time = np.linspace(0.0, duration, 6)
    r_e = np.array(geodetic_to_ecef(lat, lon, height))
    return Motion.from_knots(time, np.tile(r_e, (6, 1)), np.tile(_quaternions(C_eb[None]), (6, 1)))


def car_drive(
    duration: float = 120.0,
    seed: int = 0,
    lat: float = 0.8,
    lon: float = 0.2,
    height: float = 100.0,
    heading: float = 0.6,
    standing: float = 20.0,
    hills: float = 0.05,
) -> Motion:
    """A car in town: a standing start, then accelerating, cruising, braking, stops and right-angle turns, over hills.

    The velocity is along the body x axis in the road plane: no side slip, and none upwards but for the squat below. The
    body rolls outwards by 4 deg per g of lateral, and squats by 1.5 deg per g of longitudinal acceleration; roll and
    pitch of the road add to it. Speed stays below 15 m/s, acceleration below 2.5 m/s^2 along and 2.8 m/s^2 across.

    Parameters
    ----------
    duration : float [s]
        From time 0.
    seed : int
        Of everything drawn: the order of manoeuvres and the terrain. The same seed gives the same drive, and a longer
        one begins like a shorter one.
    lat, lon, height : float [rad, rad, m]
        Start.
    heading : float [rad]
        Heading at the start.
    standing : float [s]
        How long the car stands before it drives off.
    hills : float [m/m]
        Bound of the slope of the terrain.

    Raises
    ------
    ConfigError
        For a duration that is not positive or too long, a negative standing time, a slope outside 0 .. 1.
    """
    _require_duration(duration)
    if not standing >= 0.0 or not 0.0 <= hills <= 1.0:
        raise ConfigError(
            f"standing must not be negative, and hills must be a slope in 0 .. 1, not {standing!r} and {hills!r}"
        )
    plan, ground = np.random.default_rng(seed).spawn(2)
    speed, course = _city_plan(plan, duration, heading, standing)
    terrain = Terrain.random(ground, hills)
    local = LocalMap.at(lat, lon, height)

    time = _knot_times(duration)
    x, y = integrate_path(time, speed, course)
    h = height + terrain.height(x, y)
    psi = course.value(time)
    cos_psi, sin_psi = np.cos(psi), np.sin(psi)
    slope_n, slope_e = terrain.slope(x, y)
    up = local.normal(x, y)
    level = local.tangent(x, y, h, cos_psi, sin_psi)
    forward = level + (slope_n * cos_psi + slope_e * sin_psi)[:, None] * up
    across = np.cross(-up, _unit(level)) + (slope_e * cos_psi - slope_n * sin_psi)[:, None] * up
    down = _unit(np.cross(forward, across))
    forward = _unit(forward)
    C_e_road = np.stack([forward, np.cross(down, forward), down], axis=2)
    roll = -_ROLL_PER_ACCELERATION * speed.value(time) * course.rate(time)
    pitch = _PITCH_PER_ACCELERATION * speed.rate(time)
    suspension = Rotation.from_euler("XY", np.column_stack([roll, pitch])).as_matrix()
    return Motion.from_knots(time, local.position(x, y, h), _quaternions(C_e_road @ suspension))


def circle_flight(
    duration: float = 300.0,
    lat: float = 0.8,
    lon: float = 0.2,
    height: float = 1000.0,
    heading: float = 0.0,
    speed: float = 60.0,
    bank: float = 0.45,
    straight: float = 20.0,
    climb: float = 100.0,
) -> Motion:
    """An aircraft that flies straight, then circles to the right; parameters as for :func:`figure_eight_flight`."""
    _require_flight(duration, speed, bank, straight)
    turn = STANDARD_GRAVITY * math.tan(bank) / speed
    rates = SmoothSteps(0.0, [(straight, 5.0, turn)])
    return _flight(duration, lat, lon, height, Turning(heading, rates), speed, straight, climb)


def figure_eight_flight(
    duration: float = 300.0,
    lat: float = 0.8,
    lon: float = 0.2,
    height: float = 1000.0,
    heading: float = 0.0,
    speed: float = 60.0,
    bank: float = 0.45,
    straight: float = 20.0,
    climb: float = 100.0,
) -> Motion:
    """An aircraft that flies straight, then full circles to the right and to the left in turn.

    Turns are coordinated exactly: the specific force has no component along body y, Earth rotation and curvature
    included. The body x axis is along the velocity (no wind, no angle of attack).

    Parameters
    ----------
    duration : float [s]
        From time 0.
    lat, lon, height : float [rad, rad, m]
        Start.
    heading : float [rad]
        At the start.
    speed : float [m/s]
    bank : float [rad]
        Nominal bank angle of the turns, in (0, 1.4).
    straight : float [s]
        Straight flight before the first turn.
    climb : float [m]
        Height gained in a minute from the first turn on, and lost again in the next.

    Raises
    ------
    ConfigError
        For a duration or speed that is not positive, a duration that is too long, a negative straight time, or a bank
        out of range.
    """
    _require_flight(duration, speed, bank, straight)
    turn = STANDARD_GRAVITY * math.tan(bank) / speed
    roll_in = 5.0
    hold = max(2.0 * math.pi / turn - roll_in, 0.0)
    steps, start, sign = [], straight, 1.0
    while start < duration:
        steps += [(start, roll_in, sign * turn), (start + roll_in + hold, roll_in, -sign * turn)]
        start += 2.0 * roll_in + hold
        sign = -sign
    rates = SmoothSteps(0.0, steps)
    return _flight(duration, lat, lon, height, Turning(heading, rates), speed, straight, climb)


def _flight(
    duration: float,
    lat: float,
    lon: float,
    height: float,
    course: Turning,
    speed: float,
    straight: float,
    climb: float,
) -> Motion:
    local = LocalMap.at(lat, lon, height)
    time = _knot_times(duration)
    x, y = integrate_path(time, SmoothSteps(speed, []), course)
    climbs = [
        (straight + 120.0 * k + 60.0 * down, 60.0, (-climb if down else climb))
        for k in range(int(duration // 120) + 1)
        for down in (0, 1)
    ]
    h = height + SmoothSteps(0.0, climbs).value(time)
    r_e = local.position(x, y, h)
    unturned = np.tile((1.0, 0.0, 0.0, 0.0), (time.size, 1))
    path = Motion.from_knots(time, r_e, unturned).at(time)
    forward = _unit(path.v_e)
    lift = path.f_b
    down = -_unit(lift - forward * np.einsum("ij,ij->i", lift, forward)[:, None])
    C_eb = np.stack([forward, np.cross(down, forward), down], axis=2)
    return Motion.from_knots(time, r_e, _quaternions(C_eb))


def _city_plan(
    rng: np.random.Generator, duration: float, heading: float, standing: float
) -> tuple[SmoothSteps, SmoothSteps]:
    """Speed [m/s] and course [rad] of :func:`car_drive`."""
    t, v = standing, 0.0
    speeds: list[tuple[float, float, float]] = []
    courses: list[tuple[float, float, float]] = []

    def change_speed(to: float, strongest: float) -> None:
        nonlocal t, v
        lasts = max(STEEPEST * abs(to - v) / strongest, 2.0)
        speeds.append((t, lasts, to - v))
        t, v = t + lasts, to

    def turn(by: float, strongest: float) -> None:
        nonlocal t
        lasts = max(STEEPEST * abs(by) * v / strongest, 3.0)
        courses.append((t, lasts, by))
        t += lasts

    while t < duration:
        change_speed(rng.uniform(9.0, 15.0), rng.uniform(2.0, 2.5))
        t += rng.uniform(0.0, 2.0)
        turn(rng.choice((-1.0, 1.0)) * rng.uniform(0.1, 0.4), 2.0)
        crossing = rng.uniform(5.0, 7.0)
        if rng.random() < 0.3:
            change_speed(0.0, rng.uniform(2.0, 2.5))
            t += rng.uniform(3.0, 6.0)
        change_speed(crossing, rng.uniform(2.0, 2.5))
        turn(rng.choice((-1.0, 1.0)) * rng.uniform(1.3, 1.8), rng.uniform(2.2, 2.8))
    return SmoothSteps(0.0, speeds), SmoothSteps(heading, courses)


def _knot_times(duration: float) -> Array:
    return np.linspace(0.0, duration, max(round(duration / _SPACING), 5) + 1)


def _unit(v: Array) -> Array:
    return v / np.linalg.norm(v, axis=1)[:, None]


def _quaternions(C: Array) -> Array:
    return Rotation.from_matrix(C).as_quat(scalar_first=True)


def _require_positive(name: str, value: float) -> None:
    if not 0.0 < value < math.inf:
        raise ConfigError(f"{name} must be positive and finite, not {value!r}")


def _require_duration(duration: float) -> None:
    _require_positive("duration", duration)
    require_rows(duration / _SPACING, f"a motion of {duration:g} s with a knot every {_SPACING:g} s")


def _require_flight(duration: float, speed: float, bank: float, straight: float) -> None:
    _require_duration(duration)
    _require_positive("speed", speed)
    if not straight >= 0.0:
        raise ConfigError(f"straight must not be negative, not {straight!r}")
    if not 0.0 < bank < 1.4:
        raise ConfigError(f"bank must lie in (0, 1.4) rad, not {bank!r}")
