"""An unknown heading is kept unknown until the vehicle moves."""

from __future__ import annotations

from typing import Any

import numpy as np

from navfuse.core.earth import dcm_en
from navfuse.data.nav_state import to_ned

Array = np.ndarray

HELD_SD = np.radians(45.0)
MOVING_SPEED = 1.0


class HeadingHold:
    """Keeps a filter from learning a heading out of nothing.

    At rest nothing tells the heading, but an extended Kalman filter whose level moves about a little believes it learns
    something at every update. So a heading that is known no better than HELD_SD gets no gain, and its correlations are
    dropped, until the velocity has changed.

    Parameters
    ----------
    velocity : (3,) array
        At the start.
    eager : bool
        Let the heading go as soon as the velocity has changed by more than it is uncertain for a given heading. An
        extended filter has to wait until it has changed by more than it is uncertain in all: its covariance does not
        know that a vehicle with an unknown heading goes around an arc.

    Attributes
    ----------
    direction : (3,) array
        Unit vector down in the error frame while the heading is held, otherwise zero. Replaced, never changed in place.
    moved : bool
        Whether it has been let go, for good.
    """

    def __init__(self, velocity: Array, eager: bool = False):
        self.moved = False
        self.eager = eager
        self.direction = np.zeros(3)
        self._first_velocity = velocity.copy()

    def watch(self, nav: Array, x: Array, P: Array, ecef: bool) -> float | None:
        """Hold the heading, to be followed by :meth:`uncorrelate`, or let it go.

        Returns the standard deviation [rad] of a heading let go unknown, otherwise None.
        """
        if self.moved:
            return None
        C_en = np.array(dcm_en(*to_ned(nav)[:2])).reshape(3, 3) if ecef else np.eye(3)
        down = C_en[:, 2].copy()
        variance = float(down @ P[6:9, 6:9] @ down)
        changed = float(np.linalg.norm(nav[3:6] + x[3:6] - self._first_velocity))
        spread = np.diagonal(P)[3:6]
        if self.eager:
            spread = spread - (P[3:6, 6:9] @ down) ** 2 / max(variance, 1e-300)
        sd = float(np.sqrt(max(np.max(spread), 0.0)))
        self.moved = variance < HELD_SD**2 or changed > MOVING_SPEED + 5.0 * sd
        if self.moved:
            self.direction = np.zeros(3)
            return float(np.sqrt(variance)) if variance >= HELD_SD**2 else None
        self.direction = down
        return None

    def uncorrelate(self, P: Array) -> None:
        """Drop the correlations of a held heading, in place."""
        if self.moved or not self.direction.any():
            return
        along = np.outer(self.direction, self.direction)
        variance = self.direction @ P[6:9, 6:9] @ self.direction
        keep = np.eye(3) - along
        P[6:9] = keep @ P[6:9]
        P[:, 6:9] = P[:, 6:9] @ keep
        P[6:9, 6:9] += variance * along

    def state(self) -> Array:
        """What :meth:`restore` needs, (7,)."""
        return np.concatenate([[float(self.moved)], self.direction, self._first_velocity])

    def restore(self, state: Any) -> None:
        """Go on from a saved :meth:`state`."""
        self.moved = bool(state[0])
        self.direction = np.array(state[1:4])
        self._first_velocity = np.array(state[4:7])
