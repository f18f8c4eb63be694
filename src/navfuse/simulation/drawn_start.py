"""A start as a filter is told it: wrong by a draw from the covariance it states."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from navfuse.core.rotation import euler_from_quat
from navfuse.data.nav_state import boxplus_navigation, to_ned
from navfuse.data.start import Start

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from navfuse.simulation.motion import Motion

Array = np.ndarray


def drawn_start(
    motion: Motion,
    time: float,
    sd_position: ArrayLike,
    sd_velocity: ArrayLike,
    sd_euler: ArrayLike,
    rng: np.random.Generator,
) -> Start:
    """A start that is wrong by a draw from the covariance it states.

    Parameters
    ----------
    motion : Motion
    time : float [s]
    sd_position, sd_velocity : (3,) arrays [m], [m/s]
        North, east, down.
    sd_euler : (3,) array [rad]
        Roll, pitch, heading.
    rng : numpy Generator
    """
    return wrong_start(*true_start(motion, time, sd_position, sd_velocity, sd_euler), rng)


def true_start(
    motion: Motion, time: float, sd_position: ArrayLike, sd_velocity: ArrayLike, sd_euler: ArrayLike
) -> tuple[Start, Array]:
    """The right start, and a square root (9, 9) of its covariance; parameters as for :func:`drawn_start`."""
    state = motion.at(time)
    nav = to_ned(np.concatenate([state.r_e[0], state.v_e[0], state.q_eb[0]]))
    euler = np.array(euler_from_quat(nav[6:10]))
    start = Start.from_parts(
        time, nav[:3], nav[3:6], euler, np.asarray(sd_position), np.asarray(sd_velocity), np.asarray(sd_euler)
    )
    root = np.zeros((9, 9))
    for block in (slice(0, 3), slice(3, 6), slice(6, 9)):
        values, vectors = np.linalg.eigh(start.P[block, block])
        root[block, block] = vectors * np.sqrt(np.maximum(values, 0.0))
    return start, root


def wrong_start(right: Start, root: Array, rng: np.random.Generator) -> Start:
    """The right start with a draw from its covariance, ``root @ root.T``, as its error."""
    wrong = right.nav.copy()
    boxplus_navigation(wrong, -root @ rng.standard_normal(9), False)
    return replace(right, nav=wrong)
