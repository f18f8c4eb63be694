"""What the x, y, z of an inertial log point to in the vehicle, and how it is tilted in its mount."""

from __future__ import annotations

from dataclasses import dataclass

from navfuse.data.logs import GnssLog, ImuLog


@dataclass(frozen=True, slots=True)
class FoundAxes:
    """Where the axes of an inertial log point. A land vehicle, aircraft or boat whose nose goes along its course.

    Attributes
    ----------
    axes : str or None
        As ``imu.axes`` takes them, e.g. "BRU"; None if the log does not tell, see `reason`.
    confidence : float
        0..1.
    second : str or None
        The next best candidate.
    score, second_score : float
        -1..1: how well accelerations along and across the track agree with the axes, and with the next best.
    up : str or None
        Axis of the file that points up, e.g. "+z" or "-y".
    tilt : float [rad] or None
        Between that axis and the vertical.
    forward : str or None
        Axis of the file that points along the course, e.g. "-x".
    roll, pitch, yaw : float [rad] or None
        Angles of the sensor in the vehicle that remain once `axes` are applied: the attitude it would show in a level
        vehicle that heads north. `yaw` needs motion.
    gyro_sense : int or None
        1 if the gyroscopes turn about the vertical as the course does, -1 if the other way round (then their signs,
        or the handedness of the axes, are wrong); None if it does not turn enough to tell.
    gyro_up : str or None
        Axis of the gyroscopes that turns with the course, with the sign that points up; another than `up` means that
        gyroscopes and accelerometers are in different order.
    left_handed : bool or None
        Whether the axes of the accelerometers are left-handed, or all their signs inverted.
    reason : str or None
        Why `axes` is None.
    notes : tuple of str
        Findings for people, e.g. that the gyroscopes turn the other way.
    """

    axes: str | None
    confidence: float
    second: str | None
    score: float
    second_score: float
    up: str | None
    tilt: float | None
    forward: str | None
    roll: float | None
    pitch: float | None
    yaw: float | None
    gyro_sense: int | None
    gyro_up: str | None
    left_handed: bool | None
    reason: str | None
    notes: tuple[str, ...] = ()


def find_axes(imu: ImuLog, gnss: GnssLog | None, offset_s: float = 0.0) -> FoundAxes:
    """Find what the axes of a file point to.

    Parameters
    ----------
    imu : ImuLog
        In the axes of the file, as they stand there (read with ``axes = "FRD"``).
    gnss : GnssLog or None
        Without it, only the vertical is found.
    offset_s : float [s]
        Added to the inertial stamps; see :func:`navfuse.imu.time_offset.estimate_time_offset`.

    Returns
    -------
    FoundAxes
    """
    return FoundAxes(
        axes=None,
        confidence=0.0,
        second=None,
        score=0.0,
        second_score=0.0,
        up=None,
        tilt=None,
        forward=None,
        roll=None,
        pitch=None,
        yaw=None,
        gyro_sense=None,
        gyro_up=None,
        left_handed=None,
        reason="not estimated",
    )
