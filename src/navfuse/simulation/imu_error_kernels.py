"""Loops over the samples of a simulated sensor. No checks are made in any of these functions.

Steps that differ by less than one part in 10^5 share their transition factors: rounded time stamps differ by that much.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from navfuse.core.stochastic import gauss_markov_decay, gauss_markov_noise

SAME_STEP = 1e-5


@njit(cache=True, error_model="numpy")
def add_gauss_markov(dt, tau, sd, normals, out):
    """Add a stationary first-order Gauss-Markov process on three axes.

    Parameters
    ----------
    dt : (n,) array [s]
        Interval before each sample; that of row 0 is not used.
    tau : float [s]
    sd : (3,) array
        Stationary standard deviations, in the unit of `out`.
    normals : (n, 3) array
        Unit normals.
    out : (n, 3) array
        Added to.
    """
    x, y, z = sd[0] * normals[0, 0], sd[1] * normals[0, 1], sd[2] * normals[0, 2]
    out[0, 0] += x
    out[0, 1] += y
    out[0, 2] += z
    step, decay, drive = -1.0, 1.0, 0.0
    for k in range(1, dt.size):
        if abs(dt[k] - step) > SAME_STEP * dt[k]:
            step = dt[k]
            decay = gauss_markov_decay(step, tau)
            drive = math.sqrt(gauss_markov_noise(1.0, step, tau))
        x = decay * x + drive * sd[0] * normals[k, 0]
        y = decay * y + drive * sd[1] * normals[k, 1]
        z = decay * z + drive * sd[2] * normals[k, 2]
        out[k, 0] += x
        out[k, 1] += y
        out[k, 2] += z


@njit(cache=True, error_model="numpy")
def add_sinusoid(time, dt, mean, frequency, amplitude, phase, out):
    """Add ``amplitude sin(2 pi frequency t + phase)`` on three axes: at the stamps, or its mean over each interval.

    Parameters
    ----------
    time, dt : (n,) arrays [s]
        Stamps, and the interval that ends at each.
    mean : bool
    frequency : float [Hz]
    amplitude, phase : (3,) arrays
        In the unit of `out`, and [rad].
    out : (n, 3) array
        Added to.

    Notes
    -----
    The mean over an interval is the value at its middle times ``sin(x) / x`` with x = pi frequency dt.
    """
    omega = 2.0 * math.pi * frequency
    cos_phase, sin_phase = np.cos(phase), np.sin(phase)
    for k in range(time.size):
        t, gain = time[k], 1.0
        if mean:
            half = 0.5 * omega * dt[k]
            t, gain = t - 0.5 * dt[k], math.sin(half) / half
        s, c = gain * math.sin(omega * t), gain * math.cos(omega * t)
        for j in range(3):
            out[k, j] += amplitude[j] * (s * cos_phase[j] + c * sin_phase[j])


@njit(cache=True, error_model="numpy")
def add_band_noise(dt, mean, frequency, width, sd, normals, out):
    """Add noise in a band on three axes: at the stamps, or its mean over each interval.

    The noise is the real part of a complex Ornstein-Uhlenbeck process ``dz = (-a + 2 pi i frequency) z dt + dW`` with
    ``a = pi width``. Its autocorrelation is ``sd^2 exp(-a |t|) cos(2 pi frequency t)``, its spectrum a resonance whose
    width between the half-power points is `width`. Value and integral are drawn jointly, without approximation.

    Parameters
    ----------
    dt : (n,) array [s], > 0
        Interval that ends at each stamp.
    mean : bool
    frequency, width : float [Hz]
    sd : (3,) array
        In the unit of `out`.
    normals : (n + 1, 3, 3) array
        Unit normals: per step and axis real and imaginary part of the state, and what only the integral has. Row 0
        starts the process, one interval before the first sample.
    out : (n, 3) array
        Added to.
    """
    damping = math.pi * width
    pole = complex(-damping, 2.0 * math.pi * frequency)
    z = np.empty(3, dtype=np.complex128)
    for j in range(3):
        z[j] = complex(normals[0, j, 0], normals[0, j, 1])
    step, root, extra = -1.0, 0.0, 0.0
    turn, gain, shared = complex(1.0, 0.0), complex(0.0, 0.0), complex(0.0, 0.0)
    for k in range(dt.size):
        if abs(dt[k] - step) > SAME_STEP * dt[k]:
            step = dt[k]
            turn = np.exp(pole * step)
            gain = (turn - 1.0) / pole
            variance = -math.expm1(-2.0 * damping * step)
            root = math.sqrt(variance)
            shared = (variance - 2.0 * damping * gain.conjugate()) / pole / root
            whole = (variance - 4.0 * damping * gain.real + 2.0 * damping * step) / abs(pole) ** 2
            extra = math.sqrt(max(whole - abs(shared) ** 2, 0.0))
        for j in range(3):
            drawn = complex(normals[k + 1, j, 0], normals[k + 1, j, 1])
            if mean:
                integral = (gain * z[j] + shared * drawn).real + extra * normals[k + 1, j, 2]
                out[k, j] += sd[j] * integral / step
            z[j] = turn * z[j] + root * drawn
            if not mean:
                out[k, j] += sd[j] * z[j].real


@njit(cache=True, error_model="numpy")
def quantise_increments(lsb, values):
    """Round increments (n, 3) to multiples of `lsb` in place; the remainder is carried to the next one."""
    for j in range(3):
        rest = 0.0
        for k in range(values.shape[0]):
            rest += values[k, j]
            values[k, j] = lsb * math.floor(rest / lsb + 0.5)
            rest -= values[k, j]


@njit(cache=True, error_model="numpy")
def in_order(least, stamps):
    """Move stamps (n,) in place so that none comes earlier than `least` after the one before."""
    for k in range(1, stamps.size):
        stamps[k] = max(stamps[k], stamps[k - 1] + least)
