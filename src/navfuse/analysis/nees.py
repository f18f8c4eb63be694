"""How large are the errors of one run against the covariance that came with them? Errors, components, and NEES.

The normalized estimation error squared of an error d with covariance P is d' P^-1 d: chi-square with as many degrees of
freedom as d has components, when the filter is consistent. It needs the truth, which a simulation has. Averages over
runs and the verdict are in :mod:`navfuse.analysis.ensemble`. Source: Bar-Shalom, Li and Kirubarajan, *Estimation with
Applications to Tracking and Navigation* (2001), section 5.4.2.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numba import njit

from navfuse.core.constants import STANDARD_GRAVITY
from navfuse.core.earth import dcm_en, ecef_to_geodetic, geodetic_to_ecef
from navfuse.core.rotation import (
    dcm_from_quat,
    euler_from_dcm,
    mat_mul,
    mat_t_vec,
    mat_vec,
    quat_conjugate,
    quat_from_dcm,
    quat_multiply,
    rotvec_from_quat,
    transpose,
)
from navfuse.data.layout import CROSS_PAIRS, Layout
from navfuse.errors import InputError

Array = np.ndarray

WHOLE = "whole state"
SMALLEST_PIVOT = 1e-13
"""Of the correlation matrix; with a smaller one the covariance counts as not positive definite."""

_DEG = 180.0 / np.pi
_AXES = ("x", "y", "z")
_NAVIGATION = {
    "position": (("north", "east", "down"), "m", 1.0),
    "velocity": (("vn", "ve", "vd"), "mps", 1.0),
    "attitude": (("roll", "pitch", "heading"), "deg", _DEG),
}
_SENSOR_UNITS = {
    "gyro_bias": ("dph", _DEG * 3600.0),
    "accel_bias": ("mg", 1e3 / STANDARD_GRAVITY),
    "gyro_scale": ("ppm", 1e6),
    "accel_scale": ("ppm", 1e6),
    "gyro_cross": ("mrad", 1e3),
    "accel_cross": ("mrad", 1e3),
}


@dataclass(frozen=True, slots=True)
class Component:
    """One number whose error is followed.

    Attributes
    ----------
    name : str
        For columns and messages: ``north``, ``heading``, ``gyro_bias_x``.
    group : str
        The block it belongs to: ``position``, ``velocity``, ``attitude``, ``gyro_bias``, ...
    unit : str
        As printed, e.g. ``deg``; ``si`` for a state of an aiding sensor.
    factor : float
        SI to the printed unit.
    """

    name: str
    group: str
    unit: str
    factor: float


def components_of(layout: Layout) -> tuple[Component, ...]:
    """Components of a layout in its order, attitude as roll, pitch and heading."""
    return _components_of(tuple((block.name, block.size) for block in layout.blocks))


@lru_cache(maxsize=16)
def _components_of(blocks: tuple[tuple[str, int], ...]) -> tuple[Component, ...]:
    """The same tuple for all runs of a campaign, so that pickling several of them at once writes it once."""
    found = [Component(name, group, unit, k) for group, (names, unit, k) in _NAVIGATION.items() for name in names]
    for name, size in blocks:
        unit, factor = _SENSOR_UNITS.get(name, ("si", 1.0))
        if name.endswith("_cross"):
            axes = tuple(_AXES[row] + _AXES[column] for row, column in CROSS_PAIRS)
        else:
            axes = _AXES if size == 3 else tuple(str(k + 1) for k in range(size))
        found += [Component(f"{name}_{axis}", name, unit, factor) for axis in axes]
    return tuple(found)


@njit(cache=True, error_model="numpy")
def _navigation_errors(r_e, v_e, q_eb, nav, ecef, error, J):
    """Errors (m, 9) in the frame of the filter and what turns them to components, (m, 9, 9). No checks are made."""
    for row in range(nav.shape[0]):
        estimate = nav[row]
        C_mb = dcm_from_quat((estimate[6], estimate[7], estimate[8], estimate[9]))
        if ecef:
            r = (estimate[0], estimate[1], estimate[2])
            lat, lon, _ = ecef_to_geodetic(r[0], r[1], r[2])
            C_en = dcm_en(lat, lon)
            C_em = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
            C_nm = transpose(C_en)
        else:
            C_en = dcm_en(estimate[0], estimate[1])
            r = geodetic_to_ecef(estimate[0], estimate[1], estimate[2])
            C_em = C_en
            C_nm = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
        v = mat_vec(C_em, (estimate[3], estimate[4], estimate[5]))
        q = quat_from_dcm(mat_mul(C_em, C_mb))
        turned = quat_multiply((q_eb[row, 0], q_eb[row, 1], q_eb[row, 2], q_eb[row, 3]), quat_conjugate(q))
        parts = (
            mat_t_vec(C_em, (r_e[row, 0] - r[0], r_e[row, 1] - r[1], r_e[row, 2] - r[2])),
            mat_t_vec(C_em, (v_e[row, 0] - v[0], v_e[row, 1] - v[1], v_e[row, 2] - v[2])),
            mat_t_vec(C_em, rotvec_from_quat(turned)),
        )
        C_nb = mat_mul(C_nm, C_mb)
        _, pitch, heading = euler_from_dcm(C_nb)
        s, c = np.sin(heading), np.cos(heading)
        cp, sp = max(np.cos(pitch), 1e-9), np.sin(pitch)
        A = mat_mul((c / cp, s / cp, 0.0, -s, c, 0.0, sp * c / cp, sp * s / cp, 1.0), C_nm)
        for i in range(3):
            for block in range(3):
                error[row, 3 * block + i] = parts[block][i]
            for j in range(3):
                J[row, i, j] = C_nm[3 * i + j]
                J[row, 3 + i, 3 + j] = C_nm[3 * i + j]
                J[row, 6 + i, 6 + j] = A[3 * i + j]


def navigation_errors(r_e: Array, v_e: Array, q_eb: Array, nav: Array, ecef: bool) -> tuple[Array, Array]:
    """Errors of navigation states, true minus estimate, as the filter defines them.

    Parameters
    ----------
    r_e, v_e, q_eb : (m, 3), (m, 3), (m, 4) arrays [m], [m/s]
        The truth, Earth-fixed.
    nav : (m, 10) array
        Estimates: latitude, longitude [rad], height [m], v_n [m/s], q_nb, or r_e, v_e, q_eb.
    ecef : bool
        Which of the two.

    Returns
    -------
    error : (m, 9) array [m], [m/s], [rad]
        Of the Earth-fixed position, velocity and attitude, resolved in n or e of the estimate; the attitude error is
        the rotation vector psi with C_true = exp([psi x]) C_estimate.
    J : (m, 9, 9) array
        To north, east, down, and to first order to roll, pitch, heading.
    """
    error, J = np.empty((nav.shape[0], 9)), np.zeros((nav.shape[0], 9, 9))
    r_e, v_e, q_eb, nav = (np.ascontiguousarray(values, dtype=float) for values in (r_e, v_e, q_eb, nav))
    _navigation_errors(r_e, v_e, q_eb, nav, ecef, error, J)
    return error, J


@njit(cache=True, error_model="numpy")
def _to_components(error, P, J, values, sd):
    """Fill values and sd (m, n); J has three blocks of three by three on its diagonal. No checks are made."""
    for row in range(error.shape[0]):
        for i in range(error.shape[1]):
            v, variance = error[row, i], P[row, i, i]
            if i < 9:
                v = variance = 0.0
                first = i // 3 * 3
                for j in range(first, first + 3):
                    v += J[row, i, j] * error[row, j]
                    for k in range(first, first + 3):
                        variance += J[row, i, j] * P[row, j, k] * J[row, i, k]
            values[row, i] = v
            sd[row, i] = np.sqrt(max(variance, 0.0))


def to_components(error: Array, P: Array, J: Array) -> tuple[Array, Array]:
    """Errors and standard deviations of the components.

    Parameters
    ----------
    error : (m, n) array
        Navigation errors first, n >= 9.
    P : (m, n, n) array
        Their covariances.
    J : (m, 9, 9) array
        From :func:`navigation_errors`.

    Returns
    -------
    values, sd : (m, n) arrays
        SI units; see :func:`components_of`.
    """
    values, sd = np.empty_like(error), np.empty_like(error)
    _to_components(error, P, J, values, sd)
    return values, sd


@njit(cache=True, error_model="numpy")
def _squares(error, P, index, out):
    """``d' P^-1 d`` of every row, of the components `index` (n,); NaN where P is not positive definite. No checks are
    made.
    """
    n = index.size
    L, y, sd = np.empty((n, n)), np.empty(n), np.empty(n)
    for row in range(error.shape[0]):
        total = 0.0
        for i in range(n):
            a = index[i]
            own = P[row, a, a]
            sd[i] = np.sqrt(own) if own > 0.0 else np.nan
            for j in range(i):
                v = P[row, a, index[j]] / (sd[i] * sd[j])
                for k in range(j):
                    v -= L[i, k] * L[j, k]
                L[i, j] = v / L[j, j]
            pivot = own / (sd[i] * sd[i])
            v = error[row, a] / sd[i]
            for k in range(i):
                pivot -= L[i, k] * L[i, k]
                v -= L[i, k] * y[k]
            L[i, i] = np.sqrt(pivot) if pivot > SMALLEST_PIVOT else np.nan
            y[i] = v / L[i, i]
            total += y[i] * y[i]
        out[row] = total


def nees(error: Array, P: Array) -> Array:
    """Normalized estimation error squared of every epoch.

    Parameters
    ----------
    error : (m, n) array
    P : (m, n, n) array
        Covariances, symmetric and positive definite.

    Returns
    -------
    (m,) array [1]
        d' P^-1 d.

    Raises
    ------
    InputError
        For wrong shapes, values that are not finite, or a covariance that is not positive definite.

    Notes
    -----
    By Cholesky factors of the correlation matrix, so that units do not decide over its conditioning.
    """
    error, P = np.asarray(error, dtype=float), np.asarray(P, dtype=float)
    if error.ndim != 2 or P.shape != (*error.shape, error.shape[1]):
        raise InputError(f"NEES needs errors (m, n) and covariances (m, n, n), not {error.shape} and {P.shape}")
    return nees_of_groups(error, P, {WHOLE: np.arange(error.shape[1])})[WHOLE]


def groups_of(components: tuple[Component, ...], tested: Array | None = None) -> dict[str, Array]:
    """Indices of the components of every group, those of ``whole state`` last.

    Parameters
    ----------
    components : tuple of Component
    tested : (n,) bool array, optional
        Which of them have a truth and a variance; default all. A group without any is left out.
    """
    chosen = np.ones(len(components), dtype=bool) if tested is None else tested
    names = np.array([component.group for component in components])
    groups = {name: np.flatnonzero((names == name) & chosen) for name in dict.fromkeys(names.tolist())}
    groups[WHOLE] = np.flatnonzero(chosen)
    return {name: index for name, index in groups.items() if index.size}


def nees_of_groups(error: Array, P: Array, groups: dict[str, Array], strict: bool = True) -> dict[str, Array]:
    """NEES of every group from its marginal covariance.

    Parameters
    ----------
    error : (m, n) array
    P : (m, n, n) array
    groups : dict of str to index arrays
        From :func:`groups_of`.
    strict : bool
        Refuse a covariance that is not positive definite; otherwise its NEES is NaN.

    Returns
    -------
    dict of str to (m,) array

    Raises
    ------
    InputError
        As :func:`nees`.
    """
    error, P = np.ascontiguousarray(error, dtype=float), np.ascontiguousarray(P, dtype=float)
    finite = bool(np.isfinite(P).all())
    found = {}
    for name, index in groups.items():
        out = np.empty(error.shape[0])
        _squares(error, P, index, out)
        bad = np.flatnonzero(~np.isfinite(out))
        if not finite or not np.isfinite(error[bad[:, None], index]).all():
            raise InputError("NEES needs finite errors and covariances")
        if bad.size and strict:
            raise InputError(f"the covariance of epoch {bad[0]} is not positive definite, so that it has no NEES")
        found[name] = out
    return found
