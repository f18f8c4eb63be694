"""How a filter works."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class FilterSettings:
    """How a filter works.

    Attributes
    ----------
    ecef : bool
        Mechanize in e instead of n.
    open_loop : bool
        Leave the inertial solution uncorrected and estimate its errors, instead of feeding the corrections back.
    covariance_period : float [s]
        Length of a covariance step; 0 = one per increment.
    output_period : float [s]
        Output at its multiples; 0 = at every stamp; negative = no output.
    gate_probability : float
        Share of good measurements that the chi-square gate lets pass; 1 = no gate.
    reset_count, reset_s : int, float [s]
        After this many rejections of one sensor in a row over at least this time the covariance is enlarged until the
        next one passes.
    gated : bool
        False opens every gate, whatever probabilities are given.
    gap_s : float [s]
        An increment longer than this is a gap, in which samples are missing. Over 0.5 s and more the motion inside is
        unknown by `gap_gyro_sd` [rad/s] and `gap_accel_sd` [m/s^2], over less by as much less: it had no time to
        change.
    checkpoints : bool
        Keep what a smoother needs.
    alpha, beta, kappa : float or None, float, float
        Where the points of an unscented filter lie, see :class:`navfuse.core.unscented.SigmaSpread`.
    iterations : int
        Linearizations of an iterated filter at one measurement, at most.
    """

    ecef: bool = False
    open_loop: bool = False
    covariance_period: float = 0.1
    output_period: float = 0.1
    gate_probability: float = 0.9999
    reset_count: int = 10
    reset_s: float = 30.0
    gated: bool = True
    gap_s: float = np.inf
    gap_gyro_sd: float = np.radians(20.0)
    gap_accel_sd: float = 2.0
    checkpoints: bool = False
    alpha: float | None = None
    beta: float = 2.0
    kappa: float = 0.0
    iterations: int = 10
