"""Where a filter starts."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from navfuse.core.rotation import dcm_from_euler, quat_from_euler

Array = np.ndarray


@dataclass(frozen=True, slots=True)
class Start:
    """Navigation state and its covariance at the first moment of a filter.

    Attributes
    ----------
    time : float [s]
    nav : (10,) array
        Latitude, longitude [rad], height [m], v_n [m/s], q_nb.
    P : (9, 9) array
        Covariance of position [m], velocity [m/s] and attitude [rad] error, resolved in n.
    states : dict of str to (value, sd)
        Start values (k,) and standard deviations (k,) of sensor states that are known better than their error model
        says, e.g. a gyro bias measured at rest.
    """

    time: float
    nav: Array
    P: Array
    states: dict[str, tuple[Array, Array]] = field(default_factory=dict)

    @classmethod
    def from_parts(
        cls,
        time: float,
        position: Array,
        velocity_n: Array,
        euler: Array,
        sd_position: Array,
        sd_velocity: Array,
        sd_euler: Array,
        states: dict[str, tuple[Array, Array]] | None = None,
    ) -> Start:
        """Start of latitude, longitude [rad], height [m], velocity [m/s], roll, pitch, heading [rad] and their
        standard deviations.

        Deviations of the position [m] and the velocity are along north, east, down; those of the attitude belong to
        roll, pitch and heading.
        """
        roll, pitch, heading = (float(a) for a in euler)
        nav = np.concatenate([position, velocity_n, quat_from_euler(roll, pitch, heading)])
        P = np.zeros((9, 9))
        P[:3, :3] = np.diag(np.square(sd_position))
        P[3:6, 3:6] = np.diag(np.square(sd_velocity))
        J = euler_axes(roll, pitch, heading)
        P[6:9, 6:9] = J @ np.diag(np.square(sd_euler)) @ J.T
        return cls(float(time), nav, P, dict(states or {}))


@dataclass(frozen=True, slots=True)
class Known:
    """What a user states about the start; None where it is to be found.

    Attributes
    ----------
    time : float or None [s]
    position : (3,) array or None
        Latitude, longitude [rad], height [m] of the IMU.
    velocity_n : (3,) array or None [m/s]
    roll, pitch, heading : float or None [rad]
    sd_position, sd_velocity, sd_attitude : (3,) array or None
        [m], [m/s], [rad] (roll, pitch, heading).
    """

    time: float | None = None
    position: Array | None = None
    velocity_n: Array | None = None
    roll: float | None = None
    pitch: float | None = None
    heading: float | None = None
    sd_position: Array | None = None
    sd_velocity: Array | None = None
    sd_attitude: Array | None = None


def euler_axes(roll: float, pitch: float, heading: float) -> Array:
    """(3, 3) array: the axes, resolved in n, about which small changes of roll, pitch and heading turn the body."""
    C_nb = np.array(dcm_from_euler(roll, pitch, heading)).reshape(3, 3)
    return np.column_stack([C_nb[:, 0], [-np.sin(heading), np.cos(heading), 0.0], [0.0, 0.0, 1.0]])
