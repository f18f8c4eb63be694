"""Position and clock of one epoch from pseudo-ranges, velocity and clock drift from range rates, by least squares."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numba import njit

from navfuse.errors import InputError
from navfuse.gnss.ranging import line_of_sight, range_and_rate

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

Array = np.ndarray

_MOST_ITERATIONS = 30
_UNKNOWNS = 4
_WORST_CONDITION = 1e8


@dataclass(frozen=True, slots=True, eq=False)
class PointSolution:
    """A position, or a velocity, with the receiver clock.

    Attributes
    ----------
    vector_e : (3,) array [m] or [m/s]
        Of the antenna, in e at the time of reception.
    clock : float [m] or [m/s]
        Clock offset (positive where the receiver clock is ahead), or its drift, times the speed of light.
    covariance : (4, 4) array
        Of both, by the standard deviations given.
    residuals : (m,) array [m] or [m/s]
        Measured minus predicted by the solution.
    iterations : int
        Steps of Gauss and Newton.
    """

    vector_e: Array
    clock: float
    covariance: Array
    residuals: Array
    iterations: int


@njit(cache=True, error_model="numpy")
def _predict_ranges(sat_r_e, x, predicted, H):
    for j in range(sat_r_e.shape[0]):
        rho, ux, uy, uz, _, _ = line_of_sight(sat_r_e[j, 0], sat_r_e[j, 1], sat_r_e[j, 2], x[0], x[1], x[2])
        predicted[j] = rho + x[3]
        H[j, 0], H[j, 1], H[j, 2], H[j, 3] = -ux, -uy, -uz, 1.0


@njit(cache=True, error_model="numpy")
def _predict_rates(sat_r_e, sat_v_e, r, predicted, H):
    for j in range(sat_r_e.shape[0]):
        _, predicted[j], ux, uy, uz, shrink = range_and_rate(
            sat_r_e[j, 0], sat_r_e[j, 1], sat_r_e[j, 2], sat_v_e[j, 0], sat_v_e[j, 1], sat_v_e[j, 2],
            r[0], r[1], r[2], 0.0, 0.0, 0.0,
        )  # fmt: skip
        H[j, 0], H[j, 1], H[j, 2], H[j, 3] = -shrink * ux, -shrink * uy, -shrink * uz, 1.0


def single_point_position(
    pseudorange: ArrayLike,
    sat_r_e: ArrayLike,
    sd: ArrayLike = 1.0,
    start: ArrayLike = (0.0, 0.0, 0.0),
) -> PointSolution:
    """Position and clock offset from the pseudo-ranges of one epoch.

    Parameters
    ----------
    pseudorange : (m,) array [m]
        Corrected for atmosphere and satellite clock, m >= 4.
    sat_r_e : (m, 3) array [m]
        Satellites at transmission, in the Earth-fixed axes of that time.
    sd : number or (m,) array [m]
        Standard deviations, > 0. Weights are their inverse squares.
    start : (3,) array [m]
        Where to begin; the centre of the Earth will do for satellites on one side of it.

    Returns
    -------
    PointSolution
        Iterated until the step is below 1e-6 m, which leaves rounding, since the next one would be its square over the
        range.

    Raises
    ------
    InputError
        For fewer than four satellites, wrong shapes, values that are not finite or standard deviations that are not
        positive, satellites in a degenerate arrangement, or no convergence.
    """
    z, sat, sd = _checked(pseudorange, sat_r_e, sd, "pseudo-range")
    x = np.append(_three("start", start), 0.0)
    predicted, H = np.empty(z.size), np.empty((z.size, _UNKNOWNS))
    _predict_ranges(sat, x, predicted, H)
    x[3] = float(np.mean(z - predicted))
    for iteration in range(1, _MOST_ITERATIONS + 1):
        _predict_ranges(sat, x, predicted, H)
        step, covariance = _weighted_step(H, z - predicted, sd)
        x += step
        if np.abs(step).max() < 1e-6:
            _predict_ranges(sat, x, predicted, H)
            return PointSolution(x[:3].copy(), float(x[3]), covariance, z - predicted, iteration)
    raise InputError(
        f"least squares found no position in {_MOST_ITERATIONS} iterations: are the satellite positions in metres, and "
        "do they belong to these pseudo-ranges?"
    )


def single_point_velocity(
    range_rate: ArrayLike, sat_r_e: ArrayLike, sat_v_e: ArrayLike, r_e: ArrayLike, sd: ArrayLike = 1.0
) -> PointSolution:
    """Velocity and clock drift from the range rates of one epoch.

    Parameters
    ----------
    range_rate : (m,) array [m/s]
        Positive where the range grows, m >= 4.
    sat_r_e, sat_v_e : (m, 3) arrays [m], [m/s]
        Satellites at transmission, in the Earth-fixed axes of that time, velocity relative to the Earth.
    r_e : (3,) array [m]
        Antenna; 10 m off give up to 2 mm/s.
    sd : number or (m,) array [m/s]

    Returns
    -------
    PointSolution
        `vector_e` is the velocity relative to the Earth, `clock` the drift [m/s]. The problem is linear: one step.

    Raises
    ------
    InputError
        As :func:`single_point_position`.
    """
    z, sat, sd = _checked(range_rate, sat_r_e, sd, "range rate")
    sat_v = np.ascontiguousarray(sat_v_e, dtype=float)
    if sat_v.shape != sat.shape or not np.isfinite(sat_v).all():
        raise InputError(f"{z.size} range rates need sat_v_e of shape ({z.size}, 3) and finite, not {sat_v.shape}")
    predicted, H = np.empty(z.size), np.empty((z.size, _UNKNOWNS))
    _predict_rates(sat, sat_v, _three("r_e", r_e), predicted, H)
    x, covariance = _weighted_step(H, z - predicted, sd)
    return PointSolution(x[:3].copy(), float(x[3]), covariance, z - predicted - H @ x, 1)


def _weighted_step(H: Array, residuals: Array, sd: Array) -> tuple[Array, Array]:
    """Least-squares solution and its covariance, by orthogonal factors of the whitened equations."""
    Q, R = np.linalg.qr(H / sd[:, None])
    diagonal = np.abs(np.diag(R))
    if diagonal.min() * _WORST_CONDITION <= diagonal.max():
        raise InputError(
            f"the {residuals.size} satellites do not determine position and clock: their lines of sight lie on a cone, "
            "two are the same satellite, or their positions are not in metres; take more satellites"
        )
    inverse = np.linalg.inv(R)
    return inverse @ (Q.T @ (residuals / sd)), inverse @ inverse.T


def _checked(values: ArrayLike, sat_r_e: ArrayLike, sd: ArrayLike, what: str) -> tuple[Array, Array, Array]:
    z, sat = np.asarray(values, dtype=float), np.ascontiguousarray(sat_r_e, dtype=float)
    if z.ndim != 1 or sat.shape != (z.size, 3):
        raise InputError(f"a single epoch needs m {what}s and sat_r_e (m, 3), not {z.shape} and {sat.shape}")
    if z.size < _UNKNOWNS:
        raise InputError(
            f"an epoch of {z.size} {what}s does not determine three components and the clock: 4 are needed"
        )
    sds = np.asarray(sd, dtype=float)
    if sds.shape not in ((), z.shape) or not np.all(np.isfinite(sds)) or np.any(sds <= 0.0):
        raise InputError(f"the standard deviations of {what}s must be one number or {z.size}, positive and finite")
    if not (np.isfinite(z).all() and np.isfinite(sat).all()):
        raise InputError(
            f"the {what}s and satellite positions of an epoch must be finite; leave out those that are not"
        )
    return z, sat, np.broadcast_to(sds, z.shape)


def _three(name: str, values: ArrayLike) -> Array:
    vector = np.asarray(values, dtype=float)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise InputError(f"{name} must be three finite numbers, not {values!r}")
    return vector
