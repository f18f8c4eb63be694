"""Building blocks of vehicle motions: smooth steps in time, a plane laid onto the ellipsoid, rolling terrain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from navfuse.core.constants import WGS84_A, WGS84_B
from navfuse.core.earth import dcm_en, radii

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

Array = np.ndarray

STEEPEST = 315.0 / 128.0
"""Largest slope of the unit step: `delta` over `duration` peaks at the rate ``STEEPEST * delta / duration``."""

_STEP = np.polynomial.Polynomial([0, 0, 0, 0, 0, 126, -420, 540, -315, 70])
_STEP_RATE = _STEP.deriv()
_STEP_INTEGRAL = _STEP.integ()
_A2, _B2 = WGS84_A**2, WGS84_B**2


class SmoothSteps:
    """A function of time that is constant but for smooth, four times differentiable steps, one after the other.

    Parameters
    ----------
    initial : float
        Value before the first step.
    steps : sequence of (start [s], duration [s], change)
        In order of time; a step starts at or after the end of the one before, durations > 0.

    Notes
    -----
    Each step is the polynomial of degree nine whose first four derivatives vanish at both ends.
    """

    def __init__(self, initial: float, steps: list[tuple[float, float, float]]) -> None:
        self._start, self._duration, self._change = np.array(steps or [(0.0, 1.0, 0.0)]).T
        self._before = initial + np.concatenate([[0.0], np.cumsum(self._change)[:-1]])
        after = self._before + self._change
        end = self._start + self._duration
        area = self._before * self._duration + 0.5 * self._change * self._duration
        hold = after[:-1] * (self._start[1:] - end[:-1])
        self._area = np.concatenate([[0.0], np.cumsum(area[:-1] + hold)])

    def _locate(self, time: ArrayLike) -> tuple[Array, Array]:
        time = np.asarray(time, dtype=float)
        index = np.clip(np.searchsorted(self._start, time, side="right") - 1, 0, None)
        return index, (time - self._start[index]) / self._duration[index]

    def value(self, time: ArrayLike) -> Array:
        """The function, for times of any shape."""
        i, x = self._locate(time)
        return self._before[i] + self._change[i] * _STEP(np.clip(x, 0.0, 1.0))

    def rate(self, time: ArrayLike) -> Array:
        """Its derivative."""
        i, x = self._locate(time)
        return self._change[i] / self._duration[i] * _STEP_RATE(np.clip(x, 0.0, 1.0))

    def integral(self, time: ArrayLike) -> Array:
        """Its integral from the start of the first step."""
        i, x = self._locate(time)
        inside = np.clip(x, 0.0, 1.0)
        step = self._duration[i] * (_STEP_INTEGRAL(inside) + np.maximum(x - 1.0, 0.0))
        return self._area[i] + self._before[i] * self._duration[i] * x + self._change[i] * step


@dataclass(frozen=True, slots=True)
class Turning:
    """A course that turns at a given rate.

    Attributes
    ----------
    initial : float [rad]
        Course at the first step of the turn rate.
    turn_rate : SmoothSteps [rad/s]
    """

    initial: float
    turn_rate: SmoothSteps

    def value(self, time: ArrayLike) -> Array:
        """Course [rad], not wrapped."""
        return self.initial + self.turn_rate.integral(time)

    def rate(self, time: ArrayLike) -> Array:
        """Turn rate [rad/s]."""
        return self.turn_rate.value(time)


@dataclass(frozen=True, slots=True)
class LocalMap:
    """A plane laid onto the ellipsoid around a point: smooth everywhere within a quarter of the Earth, poles included.

    A point (x north, y east) of the plane has its ellipsoid normal tilted from the origin's by x / radius_north and
    y / radius_east, on the great circle of directions. Lengths and angles are true at the origin; at the distance d
    they are off by about d^2 / 6 R^2 and, the Earth being no sphere, by 0.01 d / R.

    Attributes
    ----------
    up, north, east : (3,) arrays
        Unit vectors at the origin, in e.
    radius_north, radius_east : float [m]
        Radii of curvature at the origin and its height.
    """

    up: Array
    north: Array
    east: Array
    radius_north: float
    radius_east: float

    @classmethod
    def at(cls, lat: float, lon: float, height: float = 0.0) -> LocalMap:
        """The map around a latitude and longitude [rad]; at a pole, north is the direction that the longitude names."""
        north, east, down = np.array(dcm_en(lat, lon)).reshape(3, 3).T
        meridian, transverse = radii(np.sin(lat))
        return cls(-down, north, east, float(meridian + height), float(transverse + height))

    def normal(self, x: Array, y: Array) -> Array:
        """Ellipsoid normals (n, 3) in e at x north and y east [m]."""
        p, q = x / self.radius_north, y / self.radius_east
        angle = np.hypot(p, q)
        sinc = np.sinc(angle / np.pi)
        return np.cos(angle)[:, None] * self.up + (sinc * p)[:, None] * self.north + (sinc * q)[:, None] * self.east

    def position(self, x: Array, y: Array, height: Array) -> Array:
        """Positions ``r_e`` (n, 3) [m] at x north, y east and ellipsoidal height [m]."""
        u = self.normal(x, y)
        scaled = u * (_A2, _A2, _B2)
        return scaled / np.sqrt(np.einsum("ij,ij->i", u, scaled))[:, None] + height[:, None] * u

    def tangent(self, x: Array, y: Array, height: Array, dx: Array, dy: Array) -> Array:
        """Level vectors (n, 3) in e that a plane displacement (dx, dy) becomes, per unit of it."""
        p, q = x / self.radius_north, y / self.radius_east
        dp, dq = dx / self.radius_north, dy / self.radius_east
        angle = np.hypot(p, q)
        sinc = np.sinc(angle / np.pi)
        small = angle < 1e-3
        safe = np.where(small, 1.0, angle)
        bend = np.where(small, -1.0 / 3.0, (np.cos(safe) - np.sin(safe) / safe) / safe**2) * (p * dp + q * dq)
        du = (
            (-sinc * (p * dp + q * dq))[:, None] * self.up
            + (sinc * dp + bend * p)[:, None] * self.north
            + (sinc * dq + bend * q)[:, None] * self.east
        )
        u = self.normal(x, y)
        scaled, d_scaled = u * (_A2, _A2, _B2), du * (_A2, _A2, _B2)
        w2 = np.einsum("ij,ij->i", u, scaled)
        surface = (d_scaled - scaled * (np.einsum("ij,ij->i", scaled, du) / w2)[:, None]) / np.sqrt(w2)[:, None]
        return surface + height[:, None] * du


@dataclass(frozen=True, slots=True)
class Terrain:
    """Hills: a sum of plane waves over the local plane, zero at its origin.

    Attributes
    ----------
    wave : (k, 2) array [rad/m]
        Wave numbers north and east.
    amplitude : (k,) array [m]
    phase : (k,) array [rad]
    """

    wave: Array
    amplitude: Array
    phase: Array

    @classmethod
    def random(cls, rng: np.random.Generator, steepest: float, waves: int = 4) -> Terrain:
        """Hills 300 m to 1500 m apart whose slope stays below `steepest` [m/m]."""
        length = rng.uniform(300.0, 1500.0, waves)
        direction = rng.uniform(0.0, 2.0 * np.pi, waves)
        k = 2.0 * np.pi / length
        wave = k[:, None] * np.column_stack([np.cos(direction), np.sin(direction)])
        return cls(wave, steepest / waves / k, rng.uniform(0.0, 2.0 * np.pi, waves))

    def height(self, x: Array, y: Array) -> Array:
        """Height [m] above that of the origin."""
        angle = np.outer(x, self.wave[:, 0]) + np.outer(y, self.wave[:, 1]) + self.phase
        return (np.sin(angle) - np.sin(self.phase)) @ self.amplitude

    def slope(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Slopes [m/m] towards north and east."""
        angle = np.outer(x, self.wave[:, 0]) + np.outer(y, self.wave[:, 1]) + self.phase
        rate = np.cos(angle) * self.amplitude
        return rate @ self.wave[:, 0], rate @ self.wave[:, 1]


def integrate_path(time: Array, speed: SmoothSteps, heading: SmoothSteps | Turning) -> tuple[Array, Array]:
    """Plane path of a speed and a course.

    Parameters
    ----------
    time : (n,) array [s]
    speed : SmoothSteps [m/s]
    heading : SmoothSteps or Turning [rad]
        Course, clockwise from north.

    Returns
    -------
    north, east : (n,) arrays [m]
        From the first time on, by Gauss-Legendre quadrature of order 12 in each interval.
    """
    nodes, weights = np.polynomial.legendre.leggauss(6)
    half = 0.5 * np.diff(time)
    at = (time[:-1] + half)[:, None] + half[:, None] * nodes
    v, course = speed.value(at), heading.value(at)
    legs = np.stack([(v * np.cos(course)) @ weights, (v * np.sin(course)) @ weights]) * half
    north, east = np.concatenate([np.zeros((2, 1)), np.cumsum(legs, axis=1)], axis=1)
    return north, east
