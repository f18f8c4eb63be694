"""Stamps: unit, order, rate, gaps, jumps, and which scale they may count on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from navfuse.inspection.findings import Finding, Verdict
from navfuse.io.gps_time import DAY, WEEK
from navfuse.io.repair import MAX_SHARE

Array = np.ndarray

FACTORS = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_WORDS = {"s": "seconds", "ms": "milliseconds", "us": "microseconds", "ns": "nanoseconds"}
USUAL_RATES = {"imu": (10.0, 1e4), "gnss": (0.02, 100.0)}
"""Rates [Hz] that nobody wonders about."""
MISSING = 1.5
"""Steps, in usual ones, from which on rows are missing."""
SLOWEST, FASTEST = 0.2, 350.0
"""Speeds [m/s] of a log that moves, beyond which its stamps are in another unit."""
SHUFFLED = 0.1
"""Share of steps back, and of steps forward, from which on rows are in no order."""
LONGEST_S = 600.0
"""Steps between fixes [s] that nobody chooses."""
GPS_UNIX = 315964800.0
"""GPS epoch in seconds of Unix time."""
_WRAPS = {
    "the GPS week (604800 s)": WEEK,
    "1024 GPS weeks": 1024.0 * WEEK,
    "midnight (86400 s)": DAY,
    "a 32-bit counter of microseconds (4294.967 s)": 4294.967296,
    "a 32-bit counter of milliseconds (4294967 s)": 4294967.296,
}


@dataclass(frozen=True, slots=True)
class Stamps:
    """Stamps after what is plainly wrong with them has been put right, for the checks that follow.

    Attributes
    ----------
    time : (m,) array [s]
        Strictly increasing.
    rows : (m,) int array
        The rows of the file they are from.
    factor : float
        What the stamps were multiplied with because their unit is another one; 1 usually.
    step : float [s]
        Median step.
    findings : tuple of Finding
    """

    time: Array
    rows: Array
    factor: float
    step: float
    findings: tuple[Finding, ...]


def check_stamps(time: Array, column: str, role: str, pace: float = np.nan, values: Array | None = None) -> Stamps:
    """Look at the stamps of a log.

    Parameters
    ----------
    time : (n,) array [s]
        By the unit in the name of their column, as they stand in the file; may hold NaN.
    column : str
        Its name.
    role : str
        "imu", or anything else: rates are judged only where much is known.
    pace : float [m/s]
        How fast the fixes move by these stamps; NaN where they hardly move, or for other sensors.
    values : (n, k) array, optional
        What else the rows hold, to tell rows that are there twice from stamps that are too coarse.
    """
    rows = np.flatnonzero(np.isfinite(time))
    found: list[Finding] = []
    if rows.size < time.size:
        missing = time.size - rows.size
        verdict = Verdict.WRONG if rows.size < 2 else Verdict.LOOK
        found.append(_stamp(verdict, f"column '{column}': {missing} of {time.size} rows have no stamp"))
    time = time[rows]
    if time.size < 2:
        found.append(
            Finding("rows", Verdict.WRONG, f"{time.size} row with a stamp; a log needs two at least", "export it again")
        )
        return Stamps(time, rows, 1.0, np.nan, tuple(found))
    shuffled = SHUFFLED < float(np.mean(np.diff(time) < 0.0)) < 1.0 - SHUFFLED
    # Steps of rows in any order say nothing of the unit: those of the sorted stamps do.
    factor = _unit(np.sort(time) if shuffled else time, column, role, np.nan if shuffled else pace, found)
    time = time * factor
    if not shuffled:
        time = _without_jumps(time, column, found)
    time, rows = _in_order(time, rows, column, found, shuffled, values)
    if time.size < 2:
        return Stamps(time, rows, factor, np.nan, tuple(found))
    steps = np.diff(time)
    step = float(np.median(steps))
    found.append(_rate(steps, step, role))
    found.append(_gaps(time, steps, step, role))
    found.append(_scale(time, column))
    return Stamps(time, rows, factor, step, tuple(found))


def _stamp(verdict: Verdict, message: str, remedy: str = "correct or remove these rows") -> Finding:
    return Finding("stamps", verdict, message, remedy)


def _unit(time: Array, column: str, role: str, pace: float, found: list[Finding]) -> float:
    """Factor that makes the rate one of such a sensor; 1 if it is, or if no unit does."""
    forward = np.diff(time)
    forward = np.abs(forward[forward != 0.0])
    if not forward.size:
        return 1.0
    step = float(np.median(forward))
    least, most = USUAL_RATES["imu" if role == "imu" else "gnss"]
    slow, fast = (2.0, 1e-5) if role == "imu" else (20.0, 2e-3)
    if fast <= step <= slow:
        return 1.0
    if step > slow and role != "imu" and not pace < SLOWEST and step < LONGEST_S:
        return 1.0
    said = column.rsplit("_", 1)[-1] if column.rsplit("_", 1)[-1] in _WORDS else "s"
    by_said = FACTORS.get(said, 1.0)
    for unit, size in {"s": 1.0, **FACTORS}.items():
        factor = size / by_said
        if factor != 1.0 and least <= 1.0 / (step * factor) <= most and not pace / factor > FASTEST:
            name = f"time_{unit}"
            sure = role == "imu" or step < fast or pace / factor > 1.0
            verdict = Verdict.WRONG if sure else Verdict.LOOK
            found.append(
                Finding(
                    "time unit",
                    verdict,
                    f"column '{column}': the rows are {step:.6g} s apart (median); as {_WORDS[unit]} they come at "
                    f"{1.0 / (step * factor):.4g} Hz, so these look like {_WORDS[unit]}, not {_WORDS[said]}",
                    f"rename '{column}' to '{name}'",
                    figures={"step_s": step, "rate_hz": 1.0 / (step * factor)},
                )
            )
            return factor
    found.append(
        Finding(
            "time unit",
            Verdict.LOOK,
            f"column '{column}': the rows are {step:.6g} s apart (median), which is unusual for such a log in any unit",
            "check the unit of the stamps, and whether rows are missing",
            figures={"step_s": step},
        )
    )
    return 1.0


def _without_jumps(time: Array, column: str, found: list[Finding]) -> Array:
    """Stamps with jumps by a week, a day or a counter's range taken out."""
    steps = np.diff(time)
    usual = float(np.median(np.abs(steps)))
    slack = max(60.0, 20.0 * usual)
    for k in np.flatnonzero(np.abs(steps) > slack)[:10]:
        for words, size in _WRAPS.items():
            room = min(slack, 0.01 * size)
            back = steps[k] < 0.0
            if abs(abs(steps[k]) - size) < room and (back or size >= WEEK):
                sign = 1.0 if back else -1.0
                time = time.copy()
                time[k + 1 :] += sign * size
                done = "fall back" if back else "leap ahead"
                found.append(
                    Finding(
                        "rollover",
                        Verdict.WRONG,
                        f"column '{column}': the stamps {done} by {abs(steps[k]):.6g} s behind row {k + 1}, at "
                        f"{time[k]:.9g} s: the clock wraps at {words}",
                        f"{'add' if back else 'subtract'} {size:.10g} s {'to' if back else 'from'} the stamps from "
                        f"row {k + 2} on",
                        figures={"jump_s": float(steps[k]), "row": float(k + 2)},
                    )
                )
                break
    return time


def _in_order(
    time: Array, rows: Array, column: str, found: list[Finding], shuffled: bool, values: Array | None
) -> tuple[Array, Array]:
    steps = np.diff(time)
    if (steps > 0.0).all():
        found.append(Finding("stamps", Verdict.OK, f"{time.size} rows, strictly increasing"))
        return time, rows
    if np.mean(steps < 0.0) > 0.5:
        found.append(
            _stamp(Verdict.WRONG, f"column '{column}': the stamps decrease from row to row", "reverse the rows")
        )
        time, rows, steps = time[::-1], rows[::-1], np.diff(time[::-1])
    late = int(np.count_nonzero(time < np.maximum.accumulate(time)))
    order = np.argsort(time, kind="stable")
    first = np.concatenate(([True], np.diff(time[order]) > 0.0))
    repeated = int(np.count_nonzero(~first))
    if late or repeated:
        share = (late + repeated) / time.size
        row = int(np.argmin(steps > 0.0)) + 2
        usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
        remedy = "sort the rows and remove what is there twice"
        same = _identical(values, rows[order], ~first)
        cause = ""
        if shuffled:
            cause = ": the rows are in no order; sorted they are judged below"
            remedy = "sort the rows by their stamps"
        elif repeated and same > 0.99 * repeated:
            cause = f": {same} of these rows are exact duplicates of others"
            remedy = "remove the rows that are there twice"
        elif repeated > 0.05 * time.size and late == 0 and usual:
            cause = f": stamps in steps of {usual:.3g} s are too coarse for the rows"
            remedy = "write the stamps with more digits"
        found.append(
            _stamp(
                Verdict.WRONG if share >= MAX_SHARE else Verdict.LOOK,
                f"column '{column}': {late} rows are out of order and {repeated} repeat a stamp, of {time.size}; the "
                f"first is row {row}{cause}",
                remedy,
            )
        )
    return time[order][first], rows[order][first]


def _identical(values: Array | None, order: Array, repeats: Array) -> int:
    """How many of the rows that repeat a stamp hold the values of the row before them, too."""
    if values is None or not repeats.any():
        return 0
    k = np.flatnonzero(repeats)
    now, before = values[order[k]], values[order[k - 1]]
    return int(np.count_nonzero(((now == before) | (np.isnan(now) & np.isnan(before))).all(axis=1)))


def _rate(steps: Array, step: float, role: str) -> Finding:
    whole = steps[steps < MISSING * step]
    jitter = float(np.percentile(np.abs(whole - step), 95.0)) if whole.size else 0.0
    rate = 1.0 / step
    shown = f"{rate:.4g} Hz" if rate >= 1.0 else f"one row in {step:.4g} s"
    text = f"{shown}; 95 % of the steps are within {1e3 * jitter:.3g} ms of {1e3 * step:.6g} ms"
    figures = {"rate_hz": rate, "step_s": step, "jitter_s": jitter}
    if role == "imu" and rate < 20.0:
        return Finding(
            "rate",
            Verdict.LOOK,
            f"{text}: slow for an inertial log, turns and vibration between the rows are lost",
            "export the log at the full rate of the sensor, 50 Hz or more",
            figures=figures,
        )
    if role == "imu" and jitter > 0.5 * step:
        return Finding(
            "rate",
            Verdict.LOOK,
            f"{text}: the stamps jump about by half a step and more, as stamps of arrival do",
            "use the sensor's own clock, if it is in the log",
            figures=figures,
        )
    return Finding("rate", Verdict.OK, text, figures=figures)


def _gaps(time: Array, steps: Array, step: float, role: str) -> Finding:
    gaps = np.flatnonzero(steps > MISSING * step)
    figures = {"gaps": float(gaps.size)}
    if not gaps.size:
        return Finding("gaps", Verdict.OK, "none", figures=figures)
    longest = int(gaps[np.argmax(steps[gaps])])
    lost = float(np.sum(steps[gaps] - step))
    share = lost / float(time[-1] - time[0])
    figures |= {"longest_s": float(steps[longest]), "lost_s": lost}
    text = (
        f"{gaps.size} gap{'s' * (gaps.size > 1)}, {lost:.4g} s ({100.0 * share:.2g} %) in all, the longest "
        f"{steps[longest]:.4g} s after {time[longest]:.6g} s"
    )
    limit = max(0.25, 5.0 * step) if role == "imu" else max(5.0, 5.0 * step)
    if steps[longest] <= limit and share < (0.01 if role == "imu" else 0.5):
        return Finding("gaps", Verdict.OK, text, figures=figures)
    remedy = "look for lost packets where the log was written"
    if role == "imu":
        remedy = "a run bridges up to imu.max_gap_s = 2 and starts anew behind longer ones; " + remedy
    return Finding("gaps", Verdict.LOOK, text, remedy, figures=figures)


def _scale(time: Array, column: str) -> Finding:
    """Which scale the stamps may count on; nothing here is wrong by itself."""
    begin, end = float(time[0]), float(time[-1])
    span = f"{begin:.10g} to {end:.10g} s"
    if 1.1e9 <= begin < 1.5e9:
        guess = "seconds since 1980-01-06 (GPS time)"
    elif 1.5e9 <= begin < 2.5e9:
        guess = "Unix time: seconds since 1970, UTC as a rule, 18 s behind GPS time"
    elif 1e9 <= begin < 1.1e9:
        guess = "GPS or Unix time"
    elif begin >= 1e4 and end <= WEEK + DAY:
        guess = "seconds of the GPS week" if begin > DAY else "seconds of the day or of the week"
    else:
        guess = "seconds since a start of its own"
    return Finding("time base", Verdict.OK, f"{span}: {guess}", figures={"begin_s": begin, "end_s": end})
