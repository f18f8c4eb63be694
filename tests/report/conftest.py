"""A made-up drive with a filter consistent by construction: two states per axis, estimated and smoothed exactly."""

from __future__ import annotations

import numpy as np
import pytest

from navfuse.data.logs import GnssLog
from navfuse.data.result import Innovations, Result, StateHistory
from navfuse.data.trajectory import Trajectory

LAT0, LON0 = np.radians(48.2), np.radians(16.4)
METRES_PER_RADIAN = 6.37e6
OUTAGE = (60.0, 80.0)
REJECTED_ROWS = (25, 26, 97)
ACCELERATION_NOISE = 0.05
FIX_SD = 0.8


def path(time, start_s=1000.0):
    """Truth: standing, then a loop with turns; velocity and position agree to the integration error."""
    t = time - start_s
    speed = 12.0 * np.clip((t - 8.0) / 6.0, 0.0, 1.0) * (1.0 - 0.5 * np.exp(-(((t - 70.0) / 6.0) ** 2)))
    heading = np.radians(40.0) + 0.05 * np.clip(t - 15.0, 0.0, None) + 0.4 * np.sin(np.clip(t - 8.0, 0.0, None) / 7.0)
    velocity = np.column_stack((speed * np.cos(heading), speed * np.sin(heading), 0.1 * np.sin(t / 9.0)))
    step = np.diff(time, prepend=time[0])[:, np.newaxis]
    middle = 0.5 * (velocity + np.vstack((velocity[:1], velocity[:-1])))
    attitude = np.column_stack((0.02 * np.sin(t / 3.0), 0.01 * np.cos(t / 5.0), np.mod(heading, 2.0 * np.pi)))
    return np.cumsum(step * middle, axis=0), velocity, attitude


def place(local, time, velocity=None, attitude=None, sd=(None, None, None), source="made up"):
    lat = LAT0 + local[:, 0] / METRES_PER_RADIAN
    lon = LON0 + local[:, 1] / (METRES_PER_RADIAN * np.cos(LAT0))
    return Trajectory(time, lat, lon, 200.0 - local[:, 2], velocity, attitude, *sd, source=source)


def estimate(time, fixes_at, usable, rng):
    """Errors (estimate minus truth) and sigmas of a position-velocity filter and smoother on one axis."""
    n, dt = time.size, np.diff(time)
    true = np.zeros((n, 2))
    x, P = np.array([0.5, 0.0]) * rng.standard_normal(2), np.diag([1.0, 0.01])
    x_pred, P_pred, x_filt, P_filt = np.zeros((n, 2)), np.zeros((n, 2, 2)), np.zeros((n, 2)), np.zeros((n, 2, 2))
    steps, records = [], []
    for k in range(n):
        if k:
            F = np.array([[1.0, dt[k - 1]], [0.0, 1.0]])
            Q = np.diag([1e-8, ACCELERATION_NOISE**2 * dt[k - 1]])
            true[k] = F @ true[k - 1] + np.sqrt(np.diag(Q)) * rng.standard_normal(2)
            x, P = F @ x, F @ P @ F.T + Q
            steps.append(F)
        x_pred[k], P_pred[k] = x, P
        found = np.flatnonzero(np.abs(fixes_at - time[k]) < 1e-6)
        if found.size:
            row = int(found[0])
            z = true[k, 0] + FIX_SD * rng.standard_normal() + (9.0 if row in REJECTED_ROWS else 0.0) - x[0]
            S = P[0, 0] + FIX_SD**2
            records.append((row, z, np.sqrt(S)))
            if usable[row]:
                gain = P[:, 0] / S
                x, P = x + gain * z, P - np.outer(gain, P[0])
        x_filt[k], P_filt[k] = x, P
    x_smooth, P_smooth = x_filt.copy(), P_filt.copy()
    for k in range(n - 2, -1, -1):
        gain = P_filt[k] @ steps[k].T @ np.linalg.inv(P_pred[k + 1])
        x_smooth[k] = x_filt[k] + gain @ (x_smooth[k + 1] - x_pred[k + 1])
        P_smooth[k] = P_filt[k] + gain @ (P_smooth[k + 1] - P_pred[k + 1]) @ gain.T
    sds = [np.sqrt(np.stack((P[:, 0, 0], P[:, 1, 1]), axis=-1)) for P in (P_filt, P_smooth)]
    return x_filt - true, sds[0], x_smooth - true, sds[1], records


def simulate(duration_s=120.0, rate_hz=10.0, start_s=1000.0, seed=1):
    """A result and its truth, with a withheld window, three rejected fixes, and sensor biases."""
    rng = np.random.default_rng(seed)
    time = start_s + np.arange(round(duration_s * rate_hz) + 1) / rate_hz
    fixes_at = start_s + np.arange(1.0, duration_s)
    since = fixes_at - start_s
    withheld = (since >= OUTAGE[0]) & (since < OUTAGE[1])
    status = np.where(
        withheld, "withheld", np.where(np.isin(np.arange(fixes_at.size), REJECTED_ROWS), "rejected", "used")
    )
    local, velocity, attitude = path(time, start_s)
    axes = [estimate(time, fixes_at, status == "used", rng) for _ in range(3)]
    solutions = []
    for smoothed in (False, True):
        error = np.stack([axis[2 if smoothed else 0] for axis in axes], axis=-1)
        sd = np.stack([axis[3 if smoothed else 1] for axis in axes], axis=-1)
        t = (time - start_s)[:, np.newaxis]
        sd_attitude = np.radians([0.05, 0.05, 0.3]) + (0 if smoothed else 1) * np.radians([0.3, 0.3, 4.0]) * np.exp(
            -t / 15.0
        )
        slow = np.cumsum(rng.standard_normal((time.size, 3)), axis=0) / np.sqrt(time.size)
        turned = attitude + sd_attitude * np.clip(slow, -2.5, 2.5)
        sds = (sd[:, 0], sd[:, 1], sd_attitude)
        name = "smoothed" if smoothed else "forward"
        solutions.append(place(local + error[:, 0], time, velocity + error[:, 1], turned, sds, name))
    z = np.array([[record[1] for record in axis[4]] for axis in axes]).T
    sd = np.array([[record[2] for record in axis[4]] for axis in axes]).T
    m = fixes_at.size
    position = Innovations(
        fixes_at, np.full(m, "gnss_position"), status, ((z / sd) ** 2).sum(axis=1), np.full(m, 3), z, sd, np.arange(m)
    )
    offset = np.where(status == "rejected", 9.0, 0.0)[:, np.newaxis]
    truth_at = np.column_stack([np.interp(fixes_at, time, local[:, k]) for k in range(3)])
    antenna = place(truth_at + FIX_SD * rng.standard_normal((m, 3)) + offset, fixes_at)
    fixes = GnssLog(fixes_at, antenna.lat, antenna.lon, antenna.height, np.full((m, 3), FIX_SD))
    settle = np.exp(-(time - start_s) / 25.0)[:, np.newaxis]
    gyro_sd = np.radians(30.0) / 3600.0 * (0.2 + 0.8 * settle) * np.ones(3)
    accel_sd = 1.5e-3 * (0.3 + 0.7 * settle) * np.ones(3)
    states = {
        "gyro_bias": StateHistory(time, np.radians([20.0, -12.0, 5.0]) / 3600.0 * (1.0 - settle), gyro_sd),
        "accel_bias": StateHistory(time, np.array([1e-3, -5e-4, 2e-3]) * (1.0 - settle), accel_sd),
    }
    summary = {
        "imu": {"file": "imu.parquet", "rows": 24000},
        "filter": {"frame": "ned"},
        "run_time_s": {"filter": 0.0123},
    }
    warnings = ("GNSS log: 3 rows have no sigma; 1.5 m was taken. Give sd_north_m, sd_east_m, sd_down_m.",)
    result = Result(*solutions, position, states, summary, warnings, fixes)
    return result, place(local, time, velocity, attitude, source="truth")


@pytest.fixture(scope="session")
def drive():
    """The result and the truth of a two-minute drive; not to be changed."""
    return simulate()


@pytest.fixture(scope="session")
def make_drive():
    """Makes a drive of its own: duration [s], rate [Hz], start [s], seed."""
    return simulate
