"""Ways to make a covariance larger, in place, where the filter has reason to trust itself less."""

from __future__ import annotations

import numpy as np

from navfuse.filters.settings import FilterSettings

Array = np.ndarray

RESET_ATTITUDE_SD = np.radians(10.0)
GAP_FULL_S = 0.5


def loosen(P: Array, sensor_sd: Array, factor: float) -> None:
    """Add variance as if each state had wandered: by a factor, but no sensor state beyond its start, no attitude beyond
    RESET_ATTITUDE_SD.

    Parameters
    ----------
    P : (n, n) array
    sensor_sd : (n - 9,) array
        Standard deviations at the start of the states after the ninth.
    factor : float
        Of the variances.
    """
    n = P.shape[0]
    sd = np.sqrt(np.maximum(np.diagonal(P), 1e-300))
    most = np.full(n, np.inf)
    most[6:9] = RESET_ATTITUDE_SD
    most[9:] = np.maximum(sensor_sd, sd[9:])
    grow = np.clip(most / sd, 1.0, np.sqrt(factor))
    P[range(n), range(n)] *= grow**2


def bridge(P: Array, settings: FilterSettings, gap: float, crossed: float) -> None:
    """Add what is unknown of the motion in a stretch without inertial data.

    Parameters
    ----------
    P : (n, n) array
    settings : FilterSettings
    gap, crossed : float [s]
        Length of the gap, and of the part of it that is to be accounted for.
    """
    share = min(1.0, gap / GAP_FULL_S)
    q_angle = (settings.gap_gyro_sd * share) ** 2 * gap * crossed
    q_speed = (settings.gap_accel_sd * share) ** 2 * gap * crossed
    for i in range(3):
        P[6 + i, 6 + i] += q_angle
        P[3 + i, 3 + i] += q_speed
        P[i, i] += 0.25 * crossed**2 * q_speed
        P[i, 3 + i] += 0.5 * crossed * q_speed
        P[3 + i, i] += 0.5 * crossed * q_speed
