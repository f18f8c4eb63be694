"""Do two logs lie at the same time, and how far are their clocks apart?"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from navfuse.data.logs import GnssLog, ImuLog
from navfuse.imu.time_offset import estimate_time_offset
from navfuse.inspection.declared import Declared
from navfuse.inspection.findings import Finding, Verdict
from navfuse.inspection.time_checks import GPS_UNIX
from navfuse.io.gps_time import DAY, WEEK

LEAP = 18.0
LEAST_TOLD_S = 0.03
"""Offsets below are of no account: no vehicle moves enough in that time."""
SIGMAS = 4.0
SURE_SIGMAS, SURELY_S = 6.0, 0.1
"""Beyond both a setting that somebody wrote down is wrong, rather than worth a look."""
FAR_S = 0.8
"""Beyond it, turns are believed where accelerations are not."""

_APART = {
    "GPS time and Unix time (315964800 s)": GPS_UNIX,
    "GPS time and Unix time with leap seconds (315964782 s)": GPS_UNIX - LEAP,
    "a rollover of 1024 GPS weeks": 1024.0 * WEEK,
}


@dataclass(frozen=True, slots=True)
class Overlap:
    """Where two logs lie, and what to add to the inertial stamps for them to meet."""

    finding: Finding
    shift: float
    met: bool


def check_overlap(imu: ImuLog, gnss: GnssLog, declared: Declared) -> Overlap:
    """Do the two share time; if not, which usual difference of scales brings them together?"""
    spans = (float(imu.time[0]), float(imu.time[-1])), (float(gnss.time[0]), float(gnss.time[-1]))
    shared, shorter = _shared(*spans), min(end - begin for begin, end in spans)
    text = (
        f"inertial data from {spans[0][0]:.10g} to {spans[0][1]:.10g} s, fixes from {spans[1][0]:.10g} to "
        f"{spans[1][1]:.10g} s"
    )
    figures = {"shared_s": max(shared, 0.0)}
    if shared >= 0.5 * shorter:
        return Overlap(Finding("overlap", Verdict.OK, f"{shared:.6g} s in common: {text}", figures=figures), 0.0, True)
    if shared > 10.0:
        finding = Finding("overlap", Verdict.LOOK, f"only {shared:.6g} s in common: {text}",
                          "are these the logs of one drive?", figures=figures)  # fmt: skip
        return Overlap(finding, 0.0, True)
    words, shift = _difference(*spans)
    settings = {"imu.time_offset_s": declared.imu_time_offset + shift} if shift else {}
    if words:
        remedy = f"set imu.time_offset_s = {declared.imu_time_offset + shift:.13g}: {words}"
    else:
        remedy = "bring both to one scale (GPS time), with imu.time_offset_s, gnss.time_offset_s or gnss.epoch_week_s"
    finding = Finding("overlap", Verdict.WRONG, f"no time in common: {text}", remedy, settings, figures)
    return Overlap(finding, shift, bool(words))


def _shared(a: tuple[float, float], b: tuple[float, float]) -> float:
    return min(a[1], b[1]) - max(a[0], b[0])


def _difference(imu: tuple[float, float], gnss: tuple[float, float]) -> tuple[str, float]:
    """What brings the spans together, in words, and the shift [s] of the inertial stamps; "" and 0 if nothing does."""
    apart = 0.5 * (gnss[0] + gnss[1] - imu[0] - imu[1])
    shorter = min(imu[1] - imu[0], gnss[1] - gnss[0])

    def meets(shift: float) -> bool:
        moved = (imu[0] + shift, imu[1] + shift)
        return _shared(moved, gnss) > 0.5 * shorter

    for words, size in _APART.items():
        for shift in (np.sign(apart) * size,):
            if meets(shift):
                return f"the scales differ as {words}", float(shift)
    weeks = round(apart / WEEK)
    if weeks and meets(weeks * WEEK):
        return f"the scales differ by {abs(weeks)} week{'s' * (abs(weeks) > 1)} of 604800 s", weeks * WEEK
    for base, words in ((GPS_UNIX, "the GPS epoch"), (GPS_UNIX - LEAP, "the GPS epoch less leap seconds")):
        for sign in (1.0, -1.0):
            weeks = round((apart - sign * base) / WEEK)
            shift = sign * base + weeks * WEEK
            if meets(shift):
                return f"the scales differ by {words} and {abs(weeks)} weeks", float(shift)
    days = round(apart / DAY)
    if days and abs(days) < 8 and meets(days * DAY):
        return f"the scales differ by {abs(days)} day{'s' * (abs(days) > 1)} of 86400 s", days * DAY
    hours = round(apart / 1800.0) * 0.5
    if 0.5 <= abs(hours) <= 14.0 and meets(3600.0 * hours):
        return f"the clocks are {abs(hours):g} hours apart, as time zones are", 3600.0 * hours
    if abs((imu[1] - imu[0]) - (gnss[1] - gnss[0])) < 0.1 * shorter + 5.0:
        return "the logs are about equally long, and this makes them begin together; a guess", round(
            gnss[0] - imu[0], 3
        )
    return "", 0.0


@dataclass(frozen=True, slots=True)
class Clocks:
    """What was found of the offset, what to add to the inertial stamps [s], and how well accelerations then agree.

    `best` is the largest correlation at any shift if none is to be believed, None if nothing was compared.
    `contradicted` says that positions and velocities tell different offsets.
    """

    finding: Finding
    offset: float
    correlation: float | None = None
    best: float | None = None
    contradicted: bool = False


def check_offset(imu: ImuLog, gnss: GnssLog, shift: float, turn_lag: float | None, declared: Declared) -> Clocks:
    """Offset of the clocks.

    Parameters
    ----------
    imu, gnss
        With their stamps as a run would have them.
    shift : float [s]
        From :func:`check_overlap`.
    turn_lag : float [s] or None
        How late the inertial stamps are by the turns, if that is sure.
    declared : Declared
    """
    far = -turn_lag if turn_lag is not None and abs(turn_lag) > FAR_S else 0.0
    begin = shift + far
    found = estimate_time_offset(replace(imu, time=imu.time + begin) if begin else imu, gnss)
    if found.offset is None:
        if far:
            return Clocks(_told(shift, far, 0.1, "turns", declared), begin)
        return Clocks(Finding("time offset", Verdict.UNKNOWN, found.reason or "the logs do not tell"), shift,
                      best=found.correlation if "different drives" in (found.reason or "") else None)  # fmt: skip
    sd = found.sd if found.sd is not None else 0.01
    used = f"{found.used}, correlation {found.correlation:.3f}"
    offset = found.offset
    slack = SIGMAS * sd
    if found.by_positions is not None and found.by_velocities is not None:
        # Positions carry most: an offset moves them by the speed times it, velocities by the acceleration times it.
        offset = found.by_positions
        # Which of the two holds is not known: the standard deviation covers both, half of their distance and more.
        # An offset larger than that half is worth telling all the same.
        slack = min(slack, 0.5 * abs(found.by_positions - found.by_velocities))
        used = (
            f"by positions; velocities say {far + found.by_velocities:+.3f} s: the receiver's velocities lag or lead "
            'its positions. Look whether the run fits better with gnss.use = ["position"]'
        )
    return Clocks(_told(shift, far + offset, sd, used, declared, slack), begin + offset, found.correlation,
                  contradicted=found.by_positions is not None)  # fmt: skip


def _told(shift: float, offset: float, sd: float, used: str, declared: Declared, slack: float | None = None) -> Finding:
    """What to say of an offset that remains after `shift`, which the overlap has told already.

    It is told beyond `slack` [s], four standard deviations if that is not given.
    """
    figures = {"offset_s": shift + offset, "sd_s": sd}
    slack = max(LEAST_TOLD_S, SIGMAS * sd if slack is None else slack)
    after = f" after {shift:+.10g} s" if shift else ""
    if abs(offset) <= slack:
        text = f"{offset:+.3f} s{after}, give or take {sd:.3f} s ({used})"
        return Finding("time offset", Verdict.OK, text, figures=figures)
    text = (
        f"the stamps of the inertial log are {abs(offset):.3f} s too {'late' if offset < 0 else 'early'} against "
        f"GNSS{after}, give or take {sd:.3f} s ({used})"
    )
    if abs(abs(offset) - LEAP) < max(slack, 0.2):
        text += "; GPS time and UTC are 18 s apart: one of the logs is in UTC"
        if abs(abs(offset) - LEAP) <= slack:
            offset = LEAP if offset > 0.0 else -LEAP
    value = round(declared.imu_time_offset + shift + offset, 3)
    remedy = f"set imu.time_offset_s = {value!r}"
    verdict = Verdict.LOOK
    if declared.explicit & {"imu.time_offset_s", "gnss.time_offset_s"}:
        text += f"; the project says imu.time_offset_s = {declared.imu_time_offset:g}"
        if declared.gnss_time_offset:
            text += f" and gnss.time_offset_s = {declared.gnss_time_offset:g}"
        if abs(offset) > max(SURELY_S, SURE_SIGMAS * sd):
            verdict = Verdict.WRONG
    return Finding("time offset", verdict, text, remedy, {"imu.time_offset_s": value}, figures)
