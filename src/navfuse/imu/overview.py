"""Rate, gaps and spectra of an inertial log."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from navfuse.data.imu_overview import ImuOverview
from navfuse.data.logs import ImuLog

Array = np.ndarray

STRETCHES = 600
SEGMENT = 2048
SEGMENTS = 200
"""More of them are thinned out evenly: the mean of 200 is good to 7 %, and an hour at 200 Hz takes no time."""
LEAST_SEGMENT = 64
GAP_STEPS = 1.5
"""A step longer than so many median steps is a gap."""


def imu_overview(imu: ImuLog) -> ImuOverview:
    """What an inertial log looks like.

    The spectra are Welch's averages (P. Welch, IEEE Trans. Audio Electroacoust. 15, 1967): Hann windows of up to 2048
    samples, half overlapping, at most 200 of them spread over the log, the mean of each taken out. They take the
    samples as evenly spaced, between gaps. Of increments they are those of the mean rate over each step.
    ``scipy.signal.welch`` gives the same, and takes most of a second to import.

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
    first = 1 if imu.kind == "increments" else 0
    runs = list(pairwise([first, *(gaps + 1).tolist(), imu.time.size]))
    segment = min(SEGMENT, max(b - a for a, b in runs))
    if segment < LEAST_SEGMENT:
        return np.empty(0), np.empty((0, 3)), np.empty((0, 3))
    half = segment // 2
    starts = np.concatenate([np.arange(a, b - segment + 1, half) for a, b in runs])
    chosen = starts[np.linspace(0, starts.size - 1, min(starts.size, SEGMENTS)).astype(np.int64)]
    rows = chosen[:, np.newaxis] + np.arange(segment)
    samples = np.concatenate((imu.gyro[rows], imu.accel[rows]), axis=2)
    if imu.kind == "increments":
        samples = samples / usual
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi / segment * np.arange(segment))
    samples -= samples.mean(axis=1, keepdims=True)
    # One-sided: what lies below zero is folded up, but for half the sampling rate, which is its own mirror.
    power = 2.0 * usual / np.sum(window**2) * np.abs(np.fft.rfft(samples * window[:, np.newaxis], axis=1)) ** 2
    psd = power.mean(axis=0)
    if segment % 2 == 0:
        psd[-1] *= 0.5
    return np.fft.rfftfreq(segment, usual)[1:], psd[1:, :3], psd[1:, 3:]
