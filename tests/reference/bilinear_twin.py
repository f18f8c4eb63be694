"""The mechanization of a Brno thesis of 2013, whose velocity update is a bilinear (trapezoidal) transform.

For a sensor that gives rates. Attitude by the trapezoid of w_nb_b, no coning; velocity by

    (I + A T/2) v1 = (I - A T/2) v0 + T/2 (C1 f1 + g1 + C0 f0 + g0),      A = [(2 w_ie + w_en) x]

with A and gravity of the position before the step; position by the trapezoid of the velocity. Written from the
differential equations in plain Python; shares nothing with navfuse.
"""

from __future__ import annotations

from math import cos, sin, sqrt

import numpy as np

Array = np.ndarray

A = 6378137.0
F = 1.0 / 298.257223563
E2 = F * (2.0 - F)
W_IE = 7.292115e-5
GAMMA_E = 9.7803253359
GAMMA_P = 9.8321849379
K = (1.0 - F) * GAMMA_P / GAMMA_E - 1.0
M = W_IE**2 * A**2 * A * (1.0 - F) / 3.986004418e14


def _cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _product(p, q):
    return (
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
        p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
        p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0],
    )


def _rotate(q, v):
    return _product(_product(q, (0.0, *v)), (q[0], -q[1], -q[2], -q[3]))[1:]


def _turned(q, r):
    angle = sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2])
    k = sin(0.5 * angle) / angle if angle > 0.0 else 0.5
    return _product(q, (cos(0.5 * angle), k * r[0], k * r[1], k * r[2]))


def _place(lat, height):
    """Gravity, radii (height included), sine and cosine of the latitude."""
    s, c = sin(lat), cos(lat)
    x = 1.0 - E2 * s * s
    g = GAMMA_E * (1.0 + K * s * s) / sqrt(x)
    g *= 1.0 - 2.0 / A * (1.0 + F + M - 2.0 * F * s * s) * height + 3.0 / A**2 * height**2
    return g, A * (1.0 - E2) / x**1.5 + height, A / sqrt(x) + height, s, c


def bilinear_mechanization(time: Array, w_ib_b: Array, f_b: Array, nav: Array, coning: bool = False) -> Array:
    """Free inertial navigation by the thesis.

    Parameters
    ----------
    time : (n,) array [s]
    w_ib_b, f_b : (n, 3) arrays [rad/s], [m/s^2]
        Rates at the stamps.
    nav : (10,) array
        Latitude, longitude [rad], height [m], v_n [m/s], q_nb at the first stamp.
    coning : bool
        Add the coning term T^2/12 w0 x w1 that the thesis leaves out, so that only the velocity update is its own.

    Returns
    -------
    (10,) array
        At the last stamp.
    """
    lat, lon, h, *rest = (float(x) for x in nav)
    v, q = tuple(rest[:3]), tuple(rest[3:])
    rates, forces, stamps = w_ib_b.tolist(), f_b.tolist(), time.tolist()
    f0 = _rotate(q, forces[0])
    for k in range(1, len(stamps)):
        dt = stamps[k] - stamps[k - 1]
        g, rm, rt, s, c = _place(lat, h)
        w_ie = (W_IE * c, 0.0, -W_IE * s)
        w_en = (v[1] / rt, -v[0] / rm, -v[1] * s / (rt * c))
        w_in = tuple(a + b for a, b in zip(w_ie, w_en, strict=True))
        turn = tuple(0.5 * dt * (a + b) for a, b in zip(rates[k - 1], rates[k], strict=True))
        if coning:
            turn = tuple(a + dt * dt / 12.0 * b for a, b in zip(turn, _cross(rates[k - 1], rates[k]), strict=True))
        q = _turned(q, turn)
        back = tuple(-0.5 * dt * a for a in w_in)
        n = sqrt(1.0 + sum(a * a for a in back))
        q = _product((1.0 / n, *(a / n for a in back)), q)
        f1 = _rotate(q, forces[k])
        a = tuple(0.5 * dt * (2.0 * x + y) for x, y in zip(w_ie, w_en, strict=True))
        av = _cross(a, v)
        b = [v[i] - av[i] + 0.5 * dt * (f1[i] + f0[i]) for i in range(3)]
        b[2] += dt * g
        ab, dot, size = _cross(a, b), sum(x * y for x, y in zip(a, b, strict=True)), 1.0 + sum(x * x for x in a)
        v1 = tuple((b[i] - ab[i] + a[i] * dot) / size for i in range(3))
        lat += 0.5 * dt * (v[0] + v1[0]) / rm
        lon += 0.5 * dt * (v[1] + v1[1]) / (rt * c)
        h -= 0.5 * dt * (v[2] + v1[2])
        v, f0 = v1, f1
    return np.array([lat, lon, h, *v, *q])
