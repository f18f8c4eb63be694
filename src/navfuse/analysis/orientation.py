"""Errors of an attitude against a reference, as the BROAD benchmark counts them.

Laidig, Caruso, Cereatti and Seel, "BROAD - A Benchmark for Robust Inertial Orientation Estimation", Data 6(7), 2021,
section 4: the error rotation in the level frame is split into a turn about the vertical (heading) and the smallest turn
about a horizontal axis (inclination).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from navfuse.core.rotation import quat_conjugate, quat_multiply
from navfuse.errors import InputError

Array = np.ndarray


@dataclass(frozen=True, slots=True)
class OrientationErrors:
    """Root mean square errors.

    Attributes
    ----------
    total, heading, inclination : float [rad]
        RMS of the whole error rotation, of its turn about the vertical, and of the rest.
    offset : float [rad]
        Constant turn about down that was taken out of the estimates first; 0 if none was.
    count : int
        Samples that counted.
    """

    total: float
    heading: float
    inclination: float
    offset: float
    count: int


def orientation_errors(
    q: Array, q_reference: Array, counted: Array | None = None, *, remove_offset: bool = False
) -> OrientationErrors:
    """Compare attitudes sample by sample.

    Parameters
    ----------
    q, q_reference : (n, 4) arrays
        Body to level frame (vertical third axis), scalar first; rows of the reference may be NaN.
    counted : (n,) bool array, optional
        Samples that count, for example while the body moves; those without a reference never do.
    remove_offset : bool
        Whether the constant heading offset with the least total error (RMS) is removed first. BROAD itself removes
        none; a magnetometer in a room that bends the field has no say in it.

    Raises
    ------
    InputError
        If no sample counts.
    """
    use = np.isfinite(q_reference).all(axis=1)
    if counted is not None:
        use &= np.asarray(counted, dtype=bool)
    if not use.any():
        raise InputError("no sample has a reference attitude and counts")
    reference = q_reference[use].T / np.linalg.norm(q_reference[use], axis=1)
    e = np.stack(quat_multiply(q[use].T / np.linalg.norm(q[use], axis=1), quat_conjugate(reference)))
    offset = _best_offset(e) if remove_offset else 0.0
    e = _turned(e, -offset)
    total = 2.0 * np.arctan2(np.linalg.norm(e[1:], axis=0), np.abs(e[0]))
    heading = 2.0 * np.arctan2(np.abs(e[3]), np.abs(e[0]))
    inclination = 2.0 * np.arctan2(np.hypot(e[1], e[2]), np.hypot(e[0], e[3]))
    rms = [float(np.sqrt(np.mean(angle**2))) for angle in (total, heading, inclination)]
    return OrientationErrors(rms[0], rms[1], rms[2], offset, int(np.count_nonzero(use)))


def _turned(e: Array, angle: float) -> Array:
    turn = (np.cos(0.5 * angle), 0.0, 0.0, np.sin(0.5 * angle))
    return np.stack(quat_multiply(turn, e))


def _best_offset(e: Array) -> float:
    from scipy.optimize import minimize_scalar

    def cost(angle: float) -> float:
        turned = _turned(e, -angle)
        return float(np.mean(np.arctan2(np.linalg.norm(turned[1:], axis=0), np.abs(turned[0])) ** 2))

    start = float(np.angle(np.mean(np.exp(2j * np.arctan2(e[3], e[0])))))
    found = minimize_scalar(cost, bracket=(start - 0.05, start + 0.05))
    return float(found.x)
