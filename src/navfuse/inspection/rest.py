"""What an inertial sensor says while it stands: noise, biases, and the grade that goes with them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from navfuse.core.constants import EARTH_RATE, STANDARD_GRAVITY
from navfuse.data.logs import GnssLog, ImuLog
from navfuse.imu.grades import GRADES
from navfuse.inspection.findings import Finding, Verdict

Array = np.ndarray

WINDOW_S = 1.0
SHORTEST_S = 10
QUIET_RATE, QUIET_FORCE = np.radians(0.5), 0.12
"""How far means over a second may change from one to the next [rad/s], [m/s^2] while a sensor stands."""
SLOW = 0.3
GENERIC = ("navigation", "tactical", "industrial-mems", "consumer")
"""Grades to choose from, the best first."""
_PER_SQRT_HOUR = 60.0


@dataclass(frozen=True, slots=True)
class Rest:
    """The longest stand of a log.

    Attributes
    ----------
    begin, end : float [s]
    arw, vrw : float [rad/sqrt(s)], [m/s/sqrt(s)]
        Allan deviation at one second, the worst axis: white noise, and what an engine shakes.
    rate : float [rad/s]
        Largest mean rate of an axis: bias, and the rotation of the Earth.
    force : float [m/s^2]
        Mean specific force.
    """

    begin: float
    end: float
    arw: float
    vrw: float
    rate: float
    force: float


def find_rest(imu: ImuLog, gnss: GnssLog | None = None) -> Rest | None:
    """The longest stand of ten seconds or more, None if there is none.

    Parameters
    ----------
    imu : ImuLog
        In any axes.
    gnss : GnssLog, optional
        Without it, quiet motion (an aeroplane in calm air) cannot be told from a stand.
    """
    time = imu.time
    if time[-1] - time[0] < SHORTEST_S:
        return None
    grid = np.arange(time[0], time[-1], WINDOW_S)
    edges = np.searchsorted(time, grid)
    edges = np.append(edges, time.size)
    counts = np.diff(edges)
    full = counts >= max(1, round(0.8 * np.median(counts)))
    means, step = [], np.diff(time, prepend=2.0 * time[0] - time[1])
    for values in (imu.gyro, imu.accel):
        rows = values / step[:, None] if imu.kind == "increments" else values
        total = np.vstack((np.zeros((1, 3)), np.cumsum(rows, axis=0)))
        means.append(np.diff(total[edges], axis=0) / np.maximum(counts, 1)[:, None])
    rate, force = means
    quiet = full[1:] & full[:-1]
    quiet &= np.linalg.norm(np.diff(rate, axis=0), axis=1) < QUIET_RATE
    quiet &= np.linalg.norm(np.diff(force, axis=0), axis=1) < QUIET_FORCE
    quiet &= np.linalg.norm(rate[1:] - np.median(rate, axis=0), axis=1) < 10.0 * QUIET_RATE
    if gnss is not None:
        quiet &= _stands(gnss, grid[1:] + 0.5 * WINDOW_S)
    ends = np.flatnonzero(np.diff(np.concatenate(([False], quiet, [False])).astype(np.int8)))
    if not ends.size:
        return None
    longest = int(np.argmax(ends[1::2] - ends[::2]))
    first, last = int(ends[2 * longest]), int(ends[2 * longest + 1])
    if last - first + 1 < SHORTEST_S:
        return None
    rate, force = rate[first : last + 1], force[first : last + 1]
    sd = [np.sqrt(0.5 * np.mean(np.diff(means, axis=0) ** 2, axis=0)).max() for means in (rate, force)]
    return Rest(
        begin=float(grid[first]),
        end=float(grid[last] + WINDOW_S),
        arw=float(sd[0] * np.sqrt(WINDOW_S)),
        vrw=float(sd[1] * np.sqrt(WINDOW_S)),
        rate=float(np.abs(rate.mean(axis=0)).max()),
        force=float(np.linalg.norm(force.mean(axis=0))),
    )


def _stands(gnss: GnssLog, at: Array) -> Array:
    """Whether the fixes around these times [s] say that the antenna stands; False where there are none."""
    if gnss.velocity_n is not None and np.isfinite(gnss.velocity_n).all(axis=1).mean() > 0.5:
        speed = np.linalg.norm(gnss.velocity_n[:, :2], axis=1)
        known = np.isfinite(speed)
        time, speed, limit = gnss.time[known], speed[known], SLOW
    else:
        every = max(1, round(4.0 / float(np.median(np.diff(gnss.time)))))
        if gnss.time.size <= every:
            return np.zeros(at.size, dtype=bool)
        north, east = gnss.lat * 6.37e6, gnss.lon * 6.37e6 * np.cos(gnss.lat[0])
        span = gnss.time[every:] - gnss.time[:-every]
        speed = np.hypot(north[every:] - north[:-every], east[every:] - east[:-every]) / span
        time = 0.5 * (gnss.time[every:] + gnss.time[:-every])
        limit = SLOW + 3.0 * float(np.median(gnss.sd_position[:, :2])) / 4.0
    near = np.clip(np.searchsorted(time, at), 1, time.size - 1)
    speed = np.maximum(speed[near - 1], speed[near])
    close = (np.abs(time[near - 1] - at) < 5.0) & (np.abs(time[near] - at) < 5.0)
    return close & (speed < limit)


def check_rest(imu: ImuLog, gnss: GnssLog | None) -> Finding:
    """Noise and biases of the longest stand, and the grade for a project file.

    Fixes that hardly share time with the inertial log cannot confirm a stand; then it is looked for without them.
    """
    if gnss is not None and min(imu.time[-1], gnss.time[-1]) - max(imu.time[0], gnss.time[0]) < SHORTEST_S:
        gnss = None
    rest = find_rest(imu, gnss)
    if rest is None:
        return Finding(
            "noise at rest",
            Verdict.UNKNOWN,
            f"no stand of {SHORTEST_S} s or more, so that nothing is known of the noise of the sensor",
            "log half a minute at rest before moving; or set imu.grade from the data sheet",
        )
    arw, vrw = np.degrees(rest.arw) * _PER_SQRT_HOUR, rest.vrw * _PER_SQRT_HOUR
    excess = rest.force - STANDARD_GRAVITY
    name = _grade(rest)
    settings: dict[str, object] = {"imu.grade": name}
    model = GRADES[name]
    if rest.arw > 1.5 * model.arw:
        settings["imu.arw_deg_per_sqrt_h"] = float(f"{arw:.2g}")
    if rest.vrw > 1.5 * model.vrw:
        settings["imu.vrw_mps_per_sqrt_h"] = float(f"{vrw:.2g}")
    odd = abs(excess) > 0.03 * STANDARD_GRAVITY
    remedy = "the accelerometers are 3 % off or more: check their scale and unit" if odd else ""
    if rest.force < 0.5 * STANDARD_GRAVITY:
        remedy = "the accelerometers miss gravity: see what is said of their unit"
    return Finding(
        "noise at rest",
        Verdict.LOOK if odd else Verdict.OK,
        f"standing from {rest.begin:.4g} to {rest.end:.4g} s: {arw:.2g} deg/sqrt(h), {vrw:.2g} m/s/sqrt(h), rates up "
        f"to {np.degrees(rest.rate):.2g} deg/s, |f| {excess:+.2g} m/s^2 off 9.807",
        remedy,
        settings,
        {
            "arw_deg_per_sqrt_h": arw,
            "vrw_mps_per_sqrt_h": vrw,
            "rate_degps": np.degrees(rest.rate),
            "excess_mps2": excess,
        },
    )


def _grade(rest: Rest) -> str:
    """The best generic grade that does not contradict what the stand shows."""
    for name in GENERIC[:-1]:
        model = GRADES[name]
        force_sd = np.hypot(
            np.max(model.axes("accel_bias_sd")), STANDARD_GRAVITY * np.max(model.axes("accel_scale_sd"))
        )
        slack = 0.03
        if (
            rest.arw < 1.5 * model.arw
            and rest.vrw < 1.5 * model.vrw
            and rest.rate < EARTH_RATE + 3.0 * np.max(model.axes("gyro_bias_sd")) + rest.arw
            and abs(rest.force - STANDARD_GRAVITY) < slack + 3.0 * force_sd
        ):
            return name
    return GENERIC[-1]
