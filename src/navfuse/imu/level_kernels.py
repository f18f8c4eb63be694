"""Loops of :mod:`navfuse.imu.level_match`: reading integrals between samples, and comparing at many shifts."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, error_model="numpy")
def _place(time, at, k):
    """Index k with time[k] <= at < time[k + 1], as far as there is one, from a first guess; and how far between."""
    last = time.size - 2
    if k < 0 or k > last or at < time[k] or at > time[min(k + 8, last + 1)]:
        k = min(max(np.searchsorted(time, at, side="right") - 1, 0), last)
    while k < last and time[k + 1] <= at:
        k += 1
    u = (at - time[k]) / (time[k + 1] - time[k])
    return k, min(max(u, 0.0), 1.0)


@njit(cache=True, error_model="numpy")
def read_rows(time, values, at, out):
    """Interpolate the columns of `values` (n, 3) linearly at the times `at` (m,) into `out` (m, 3), n >= 2.

    Outside of `time` the first or last row is returned. Fast for times that increase. No checks are made.
    """
    k = 0
    for row in range(at.size):
        k, u = _place(time, at[row], k)
        for i in range(3):
            out[row, i] = values[k, i] + u * (values[k + 1, i] - values[k, i])


@njit(cache=True, error_model="numpy")
def correlate(time, integral, basis, rows, weight, nuisance, seen, lags, power, plain, mirrored):
    """Products of two detrended signals at every shift.

    Parameters
    ----------
    time, integral : (n,), (n, 3) arrays
        What is shifted, in three axes.
    basis : (w, 2, 3) array
        Axes of each stretch that become real and imaginary part.
    rows, weight : (w, m) arrays
        Times and weights of each stretch; weights of 0 are passed over.
    nuisance : (w, m, p) array
        Orthonormal columns that are taken out, p <= 4.
    seen : (w, m) complex array
        The other signal, weighted and with them taken out.
    lags : (k,) array [s]
        Subtracted from `rows`.
    power, plain, mirrored : (k, w) arrays, real, complex, complex
        Receive the sum of A conj(A), conj(A) seen and A seen.

    Notes
    -----
    What is taken out of both need only be taken out of one in a product. No checks are made.
    """
    count = nuisance.shape[2]
    taken = np.empty(4, dtype=np.complex128)
    for w in range(rows.shape[0]):
        for j in range(lags.size):
            taken[:] = 0.0
            total, product, mirror = 0.0, 0.0 + 0.0j, 0.0 + 0.0j
            k, begun = 0, False
            x0, y0, z0 = 0.0, 0.0, 0.0
            for row in range(rows.shape[1]):
                if weight[w, row] <= 0.0:
                    continue
                k, u = _place(time, rows[w, row] - lags[j], k)
                x = integral[k, 0] + u * (integral[k + 1, 0] - integral[k, 0])
                y = integral[k, 1] + u * (integral[k + 1, 1] - integral[k, 1])
                z = integral[k, 2] + u * (integral[k + 1, 2] - integral[k, 2])
                if not begun:
                    x0, y0, z0, begun = x, y, z, True
                x, y, z = x - x0, y - y0, z - z0
                real = x * basis[w, 0, 0] + y * basis[w, 0, 1] + z * basis[w, 0, 2]
                imag = x * basis[w, 1, 0] + y * basis[w, 1, 1] + z * basis[w, 1, 2]
                A = complex(real, imag) * weight[w, row]
                total += A.real * A.real + A.imag * A.imag
                product += A.conjugate() * seen[w, row]
                mirror += A * seen[w, row]
                for p in range(count):
                    taken[p] += nuisance[w, row, p] * A
            for p in range(count):
                total -= taken[p].real * taken[p].real + taken[p].imag * taken[p].imag
            power[j, w], plain[j, w], mirrored[j, w] = max(total, 0.0), product, mirror
