"""How far the clock of the inertial log is from that of GNSS, found before any filter runs."""

from __future__ import annotations

from dataclasses import dataclass

from navfuse.data.logs import GnssLog, ImuLog


@dataclass(frozen=True, slots=True)
class TimeOffset:
    """Offset between the stamps of an inertial log and those of GNSS.

    Attributes
    ----------
    offset : float [s] or None
        To be ADDED to the inertial stamps, as ``imu.time_offset_s``. None if the logs do not tell; see `reason`.
    sd : float [s] or None
    correlation : float
        0..1, of what both see, at the offset (or at the best shift, if that is not to be trusted).
    rival : float
        0..1, correlation at the next best shift away from the peak.
    used : str
        What was compared, e.g. "acceleration, from velocities" or "turns, from positions"; "" if nothing was.
    reason : str or None
        Why nothing can be said; None where `offset` is given.
    notes : tuple of str
        What looks odd, such as turns that tell another offset than accelerations.
    """

    offset: float | None
    sd: float | None
    correlation: float
    rival: float
    used: str
    reason: str | None
    notes: tuple[str, ...] = ()


def estimate_time_offset(imu: ImuLog, gnss: GnssLog, *, search_s: float = 5.0) -> TimeOffset:
    """Offset that makes inertial sensors and GNSS see the same motion at the same time.

    Parameters
    ----------
    imu : ImuLog
        In any axes, also those of the file.
    gnss : GnssLog
    search_s : float [s]
        Offsets between -search_s and +search_s are tried.

    Returns
    -------
    TimeOffset
    """
    return TimeOffset(None, None, 0.0, 0.0, "", "not estimated")
