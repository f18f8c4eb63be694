"""Shortcuts for tests of error dynamics: sensor errors of all kinds, motions, differences of the mechanization."""

from __future__ import annotations

import numpy as np

from navfuse.data.nav_state import boxplus_navigation
from navfuse.mechanization.error_dynamics import imu_state_map
from navfuse.mechanization.propagate import Propagator, identity_transition
from navfuse.simulation import car_drive, circle_flight, figure_eight_flight
from reference.engine_runs import nav_at
from reference.error_dynamics_twin import propagate_covariance
from reference.navigation_algebra import error, frame_of

NAMES = ("gyro_bias", "accel_bias", "gyro_scale", "accel_scale", "gyro_cross", "accel_cross")
COUNTS = (3, 3, 3, 3, 6, 6)
SIZES = np.repeat([1.0, 0.1, 1e-3, 1e-3, 1e-2, 1e-3, 1e-3, 1e-3, 1e-3], [3, 3, 3, *COUNTS])
"""What counts as a large error of each state: 1 m, 0.1 m/s, 1 mrad, 1 mrad/s, 10 mm/s^2 and 1e-3."""
N = SIZES.size
SENSOR_ERRORS = np.random.default_rng(0).standard_normal(N - 9) * SIZES[9:]
BIASES = SENSOR_ERRORS * (np.arange(N - 9) < 6)

MOTIONS = {
    "car": car_drive(30.0, seed=3, standing=2.0),
    "car on the equator": car_drive(30.0, seed=4, standing=2.0, lat=0.0),
    "steep turns at 150 m/s": figure_eight_flight(30.0, straight=2.0, speed=150.0, bank=0.8, lat=-0.6),
    "steep turns at 86 degrees": circle_flight(30.0, straight=2.0, speed=150.0, bank=0.8, lat=1.5),
}


def propagate(increments, nav, sensor_errors, ecef, period=0.0, P=None, noise=(0.0, 0.0), stochastic=None):
    """Navigation state, covariance and (9, n) transition after the increments."""
    stochastic = np.zeros((N - 9, 3)) if stochastic is None else stochastic
    propagator = Propagator(imu_state_map(NAMES), np.array(noise), stochastic, ecef, period, -1.0)
    nav, s, F = nav.copy(), sensor_errors.copy(), identity_transition(N)
    P = np.zeros((N, N)) if P is None else P.copy()
    begin, end = float(increments.time[0]), float(increments.time[-1])
    out, acc, last = propagator.buffers(0, transitions=False), propagator.accumulator(), np.zeros(6)
    propagator.advance(increments, 0, begin, end, nav, s, np.zeros(N), P, F, acc, 0, out, last)
    return nav, P, F


def differences(increments, nav, sensor_errors, ecef):
    """(9, n) derivative of the mechanized state with respect to the true state, by central differences."""
    base = propagate(increments, nav, sensor_errors, ecef)[0]
    columns = []
    for j, size in enumerate(0.1 * SIZES):
        moved = []
        for d in (size, -size):
            delta = np.zeros(N)
            delta[j] = d
            start = nav.copy()
            boxplus_navigation(start, delta[:9], ecef)
            moved.append(error(propagate(increments, start, sensor_errors + delta[9:], ecef)[0], base, ecef))
        columns.append((moved[0] - moved[1]) / (2.0 * size))
    return np.column_stack(columns)


def effects(transition, reference):
    """Largest difference of position [m], velocity [m/s] and attitude [rad] that a large error of a state makes."""
    return (np.abs(transition - reference) * SIZES).reshape(3, -1).max(axis=1)


def start_covariance(sd):
    root = np.random.default_rng(1).standard_normal((N, N)) + 2.0 * np.eye(N)
    P = root @ root.T
    scale = sd / np.sqrt(np.diagonal(P))
    return P * np.outer(scale, scale)


VARIANCE = (3.0 * SIZES[9:]) ** 2
WALK = np.where(np.arange(N - 9) % 2 == 0, (0.3 * SIZES[9:]) ** 2, 0.0)
RATES = np.where(np.arange(N - 9) % 2 == 0, 0.0, 1.0 / 300.0)
NOISE = (1e-3**2, 0.05**2)


def by_van_loan(motion, begin, end, P_m, ecef):
    """Covariance at `end` by the twin, in the frame of the filter."""

    def at(t):
        state = motion.at(t)
        return state.r_e[0], motion.C_eb(t), state.w_ib_b[0], state.f_b[0]

    def to_e(t):
        C = np.eye(N)
        C[:9, :9] = np.kron(np.eye(3), frame_of(nav_at(motion, t, ecef), ecef).T)
        return C

    P = to_e(begin) @ P_m @ to_e(begin).T
    steps = np.linspace(begin, end, round((end - begin) / 0.02) + 1)
    P, _ = propagate_covariance(NAMES, at, steps, P, NOISE, VARIANCE, WALK, RATES)
    return to_e(end).T @ P @ to_e(end)


def in_sigmas(P, reference):
    """Largest difference of two covariances, as a part of the product of the deviations."""
    sd = np.sqrt(np.diagonal(reference))
    return np.abs((P - reference) / np.outer(sd, sd)).max()
