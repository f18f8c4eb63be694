"""Discrete first-order Gauss-Markov processes and random walks.

No checks are made in any of these functions.
"""

from __future__ import annotations

import math

from numba import njit


@njit(cache=True, error_model="numpy")
def gauss_markov_decay(dt, tau):
    """Factor by which a first-order Gauss-Markov state shrinks over an interval.

    Parameters
    ----------
    dt : float [s]
    tau : float [s]
        Correlation time. Infinite, zero or negative means that the state does not decay (random constant or walk).

    Returns
    -------
    float
        ``exp(-dt / tau)``, or 1 without decay.

    Notes
    -----
    No checks are made. Source: Gelb (1974), section 3.8.
    """
    if tau > 0.0:
        return math.exp(-dt / tau)
    return 1.0


@njit(cache=True, error_model="numpy")
def gauss_markov_noise(sigma, dt, tau):
    """Variance that drives a first-order Gauss-Markov state over an interval and keeps it stationary.

    Parameters
    ----------
    sigma : float
        Stationary standard deviation, in the unit of the state.
    dt, tau : float [s]
        As in :func:`gauss_markov_decay`; without decay the result is 0 (a random constant needs no noise).

    Returns
    -------
    float
        ``sigma^2 (1 - decay^2)`` in the unit of the state squared, without the cancellation of that difference.

    Notes
    -----
    No checks are made. Source: Gelb (1974), section 3.8.
    """
    if tau > 0.0:
        return -sigma * sigma * math.expm1(-2.0 * dt / tau)
    return 0.0


@njit(cache=True, error_model="numpy")
def random_walk_noise(psd, dt):
    """Variance that a random walk gains over an interval: ``psd * dt``.

    Parameters
    ----------
    psd : float
        Power spectral density of the driving white noise [unit^2/s], the square of what data sheets give per sqrt(s).
    dt : float [s]

    Notes
    -----
    No checks are made.
    """
    return psd * dt
