"""Does a record of a sensor at rest hold what it is said to hold? Units, rates, increments, columns that are none."""

from __future__ import annotations

import numpy as np

from navfuse.core.constants import STANDARD_GRAVITY
from navfuse.errors import InputError
from navfuse.io.static_columns import RawColumns

Array = np.ndarray

SAME_RATE = 0.01
"""Relative difference of two sampling rates that are taken for one."""

_UNITS_OF_TIME = {"seconds": 1.0, "milliseconds": 1e-3, "microseconds": 1e-6, "nanoseconds": 1e-9}
_USUAL_RATES = (0.5, 1e5)


def check_axes(source: str, raw: RawColumns) -> list[str]:
    """Refuse axes that cannot be sensors.

    Returns
    -------
    list of str
        What is odd and may pass: infinite values, which count as missing.

    Raises
    ------
    InputError
        For an axis without any number, one that rises by the same step at every row, or one that repeats another.
    """
    notes = []
    for name, values in raw.values.items():
        told = f"{source}: {name} (column {raw.names[name]!r})"
        good = np.isfinite(values)
        if not good.any():
            raise InputError(
                f"{told} has no number in any of its {values.size} rows; choose other columns with --gyro and --accel, "
                "or export the log again"
            )
        if steady_step(values) is not None:
            raise InputError(
                f"{told} changes by the same step at every row: it is a time or a counter, no sensor; choose other "
                "columns with --gyro and --accel"
            )
        infinite = np.isinf(values)
        if infinite.any():
            notes.append(
                f"{told}: values that are infinite count as missing: {np.count_nonzero(infinite)}, the first in row "
                f"{int(np.argmax(infinite)) + 1}"
            )
    _refuse_copies(source, raw)
    return notes


def _refuse_copies(source: str, raw: RawColumns) -> None:
    """Noise never comes twice; constant axes are told elsewhere."""
    entries = list(raw.values.items())
    for k, (name, values) in enumerate(entries):
        for other, before in entries[:k]:
            if np.array_equal(values, before, equal_nan=True) and np.nanmax(values) > np.nanmin(values):
                raise InputError(
                    f"{source}: {name} (column {raw.names[name]!r}) is a copy of {other} (column "
                    f"{raw.names[other]!r}); choose the columns with --gyro and --accel, or leave the copy out"
                )


def steady_step(values: Array) -> float | None:
    """The step of a column that changes by the same step from row to row, as time stamps do; None if it does not."""
    step = np.diff(values)
    usual = float(step[0]) if step.size else 0.0
    if step.size < 10 or not (np.isfinite(usual) and usual != 0.0):
        return None
    slack = 1e-3 * abs(usual) + 4.0 * float(np.spacing(np.max(np.abs(values[[0, -1]]))))
    return float(np.mean(step)) if (np.abs(step - usual) <= slack).all() else None


def check_rate(source: str, raw: RawColumns, rate: float) -> list[str]:
    """Compare a rate with columns that look like time stamps and that nobody asked for.

    Returns
    -------
    list of str
        Warnings.
    """
    if not _USUAL_RATES[0] <= rate <= _USUAL_RATES[1]:
        likely = raw.time is not None and _USUAL_RATES[0] <= 1000.0 * rate <= _USUAL_RATES[1]
        hint = f" Stamps in milliseconds, divided by 1000, would make it {1000.0 * rate:.6g} Hz" if likely else ""
        return [
            f"{source}: a sampling rate of {rate:.6g} Hz is unusual for an inertial sensor; is the unit of the time "
            f"stamps right?{hint}"
        ]
    if raw.time is not None:
        return []
    for name, column in raw.unused.items():
        step = steady_step(np.asarray(column, dtype=np.float64)) if column.size == _size(raw) else None
        if step is None or step <= 0.0 or step == 1.0:
            continue
        rates = {unit: 1.0 / (step * size) for unit, size in _UNITS_OF_TIME.items()}
        if any(abs(one / rate - 1.0) <= SAME_RATE for one in rates.values()):
            return []
        told = next(((unit, one) for unit, one in rates.items() if _USUAL_RATES[0] <= one <= _USUAL_RATES[1]), None)
        if told is not None:
            return [
                f"{source}: column {name!r} rises steadily by {step:.6g}, as time stamps in {told[0]} at {told[1]:.6g} "
                f"Hz do, but the rate is given as {rate:g} Hz; if it is the time, every result is wrong: say --time "
                f"{name} (in seconds) instead of --rate, or give the right rate"
            ]
    return []


def _size(raw: RawColumns) -> int:
    return next(iter(raw.values.values())).size


def check_force(source: str, raw: RawColumns, rate: float) -> None:
    """A sensor at rest feels one g, which tells increments from rates, and a wrong rate, where there are three axes.

    Raises
    ------
    InputError
        If it does not.
    """
    axes = [raw.values[name] for name in ("accel x", "accel y", "accel z") if name in raw.values]
    if len(axes) < 3:
        return
    sample = slice(None, None, max(1, axes[0].size // 10000))
    force = float(np.nanmedian(np.sqrt(sum(axis[sample] ** 2 for axis in axes))))
    shown = force * rate if raw.kind == "increments" else force
    if 0.7 < shown / STANDARD_GRAVITY < 1.4:
        return
    if raw.kind == "rates" and 0.7 < force * rate / STANDARD_GRAVITY < 1.4:
        raise InputError(
            f"{source}: |acceleration| is {force:.4g} m/s^2, one g times the sampling interval: these are increments; "
            "give units of angle and speed, or name the columns dtheta_*_rad and dvel_*_mps"
        )
    if raw.kind == "increments" and 0.7 < force / STANDARD_GRAVITY < 1.4:
        raise InputError(
            f"{source}: |velocity increment| is {force:.4g} m/s, which is one g without a sampling interval: these are "
            "rates; give units of rate and acceleration, or name the columns gyro_*_radps and accel_*_mps2"
        )
    told = "the unit" if raw.kind == "rates" else "the unit or the sampling rate"
    raise InputError(
        f"{source}: the specific force is {shown / STANDARD_GRAVITY:.4g} g, at rest it has to be about 1 g: {told} is "
        "wrong, or the columns are not those of an accelerometer"
    )
