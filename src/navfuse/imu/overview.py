"""Rate, gaps and spectra of an inertial log."""

from __future__ import annotations

import numpy as np

from navfuse.data.imu_overview import ImuOverview
from navfuse.data.logs import ImuLog

Array = np.ndarray

STRETCHES = 600
SEGMENT = 2048
LEAST_SEGMENT = 64
GAP_STEPS = 1.5
"""A step longer than so many median steps is a gap."""


def imu_overview(imu: ImuLog) -> ImuOverview:
    """What an inertial log looks like.

    The spectra are Welch's averages (P. Welch, IEEE Trans. Audio Electroacoust. 15, 1967): Hann windows of up to 2048
    samples, half overlapping, the mean of each taken out. They take the samples as evenly spaced, in runs between gaps
    only. Of increments they are those of the mean rate over each step.

    Parameters
    ----------
    imu : ImuLog
        At least one row.

    Returns
    -------
    ImuOverview
    """
    step = np.diff(imu.time)
    if not step.size:
        nothing = np.empty(0)
        return ImuOverview(nothing, nothing, np.nan, nothing, nothing, nothing, np.empty((0, 3)), np.empty((0, 3)))
    usual = float(np.median(step))
    gaps = np.flatnonzero(step > GAP_STEPS * usual)
    count = int(np.clip(round((imu.time[-1] - imu.time[0]) / max(1.0, 5.0 * usual)), 1, STRETCHES))
    edges = np.linspace(imu.time[0], imu.time[-1], count + 1)
    counts, _ = np.histogram(imu.time[1:] - 0.5 * step, edges)
    frequency, gyro, accel = _spectra(imu, usual, gaps)
    return ImuOverview(
        time=0.5 * (edges[1:] + edges[:-1]),
        rate=counts / np.diff(edges),
        usual_rate=1.0 / usual,
        gap_start=imu.time[gaps],
        gap_length=step[gaps],
        frequency=frequency,
        gyro_psd=gyro,
        accel_psd=accel,
    )


def _spectra(imu: ImuLog, usual: float, gaps: Array) -> tuple[Array, Array, Array]:
    from scipy.signal import welch

    first = 1 if imu.kind == "increments" else 0
    edges = np.concatenate(([first], gaps + 1, [imu.time.size]))
    runs = [(int(a), int(b)) for a, b in zip(edges[:-1], edges[1:], strict=True)]
    longest = max(b - a for a, b in runs)
    segment = min(SEGMENT, longest)
    if segment < LEAST_SEGMENT:
        return np.empty(0), np.empty((0, 3)), np.empty((0, 3))
    scale = 1.0 / usual if imu.kind == "increments" else 1.0
    frequency, total, weight = np.empty(0), np.zeros((segment // 2 + 1, 6)), 0
    for a, b in runs:
        if b - a < segment:
            continue
        piece = np.column_stack((imu.gyro[a:b], imu.accel[a:b])).T * scale
        frequency, psd = welch(piece, fs=1.0 / usual, nperseg=segment, axis=1)
        total += psd.T * (b - a)
        weight += b - a
    total /= weight
    return frequency[1:], total[1:, :3], total[1:, 3:]
