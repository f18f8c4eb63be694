"""What an inertial log looks like at a glance: its rate over time, its gaps, its spectra."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Array = np.ndarray


@dataclass(frozen=True, slots=True)
class ImuOverview:
    """Rate, gaps and spectra of an inertial log, small enough to keep with a result.

    Attributes
    ----------
    time : (m,) array [s]
        Middles of equal stretches of the log.
    rate : (m,) array [Hz]
        Samples in each stretch over its length.
    usual_rate : float [Hz]
        One over the median step.
    gap_start, gap_length : (g,) arrays [s]
        Steps longer than half more than the median: the stamp before each, and its length.
    frequency : (k,) array [Hz]
        Of the spectra; empty where the log is too short for one.
    gyro_psd : (k, 3) array [(rad/s)^2/Hz]
        One-sided power spectral densities of the angular rate, body axes.
    accel_psd : (k, 3) array [(m/s^2)^2/Hz]
        The same of the specific force.
    """

    time: Array
    rate: Array
    usual_rate: float
    gap_start: Array
    gap_length: Array
    frequency: Array
    gyro_psd: Array
    accel_psd: Array
