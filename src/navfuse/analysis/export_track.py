"""A trajectory made ready to leave: another point of the vehicle, other times, heights above the geoid."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Literal

import numpy as np

from navfuse.analysis.body_motion import BodyMotion, body_motion
from navfuse.analysis.interpolation import (
    conjugate,
    covered,
    earth_states,
    interpolate_linear,
    longest_bridged,
    multiply,
    ned_axes,
    ned_quaternion,
)
from navfuse.core.constants import WGS84_A, WGS84_E2
from navfuse.core.earth import ecef_to_geodetic_batch
from navfuse.core.rotation import dcm_from_quat_batch, euler_from_quat_batch
from navfuse.data.export_track import ExportTrack
from navfuse.data.gps_epoch import GpsEpoch
from navfuse.data.result import Result
from navfuse.data.trajectory import Trajectory
from navfuse.errors import ConfigError, InputError, NavfuseWarning
from navfuse.gnss.geoid import undulation

Array = np.ndarray
Point = str | Sequence[float] | Array

FIX_AGE_S = 2.0
"""A fix counts as that of an epoch for so long, or for one and a half intervals between fixes if that is longer."""
COARSE_S = 0.25
"""Epochs further apart than this are too coarse to be interpolated without a word."""
FEWEST_S, MOST_EPOCHS = 1e-3, 50_000_000
_NAMED = 5


def export_track(
    source: Result | Trajectory,
    *,
    solution: Literal["best", "smoothed", "forward"] = "best",
    point: Point = "imu",
    rate_hz: float | None = None,
    at: Sequence[float] | Array | None = None,
    labels: Sequence[str] | Array | None = None,
    height: Literal["ellipsoid", "geoid"] = "ellipsoid",
    geoid: str = "egm96",
    epoch: GpsEpoch | None = None,
    name: str = "navfuse",
) -> ExportTrack:
    """Trajectory of a point of the vehicle at chosen times.

    Parameters
    ----------
    source : Result or Trajectory
        A result also gives the antenna's lever arm, the fix types and the epoch.
    solution : {"best", "smoothed", "forward"}
        Which trajectory of a result; the best is the smoothed one where there is one.
    point : "imu", "antenna" or (3,) array-like [m]
        The lever arm from the IMU, forward, right, down; ``"antenna"`` takes that of the project.
    rate_hz : float [Hz], optional
        Epochs at the multiples of 1 / rate in log time, none inside gaps. Default: those of the trajectory.
    at : (n,) array-like [s], optional
        Log times of events instead, any order; the track has them sorted, coinciding ones beside each other.
    labels : (n,) sequence of str, optional
        Names of the events; default their numbers from 1.
    height : {"ellipsoid", "geoid"}
        Which heights go into formats that have room for one and whose standard leaves the choice.
    geoid : {"egm96", "egm2008"}
        See :func:`navfuse.gnss.geoid.undulation`.
    epoch : GpsEpoch, optional
        GPS time from which the times count; default that of the result.
    name : str
        Of the track.

    Returns
    -------
    ExportTrack

    Raises
    ------
    InputError
        If an event list does not fit, none of its times lies inside the trajectory, or another point is asked of a
        trajectory without attitude.
    ConfigError
        If a setting makes no sense: an unknown point, solution, height or geoid, or a rate that gives no epoch.

    Warns
    -----
    NavfuseWarning
        For events before the start, behind the end or in a gap, which are left out: nothing is extrapolated; and if
        the epochs are too far apart to interpolate between them, or to tell how fast the vehicle turned.

    Notes
    -----
    The point moves as that of a rigid body: ``r_e + C_eb l`` and ``v_e + C_eb (w_eb_b x l)`` with the angular rate of
    :mod:`navfuse.analysis.body_motion`. Standard deviations grow to what they can be at most: those of the IMU plus,
    for roll, pitch and heading each, what one standard deviation moves the point by. A trajectory does not hold the
    correlations between position and attitude; whatever they are, the true ones are no larger. (At the antenna they
    are often smaller, as the fixes are the antenna's.) The error of the angular rate is left out. Between epochs
    standard deviations are interpolated linearly.
    """
    result = source if isinstance(source, Result) else None
    trajectory = _chosen(source, solution)
    if not len(trajectory):
        raise InputError(f"{trajectory.source}: no epochs to export")
    if height not in ("ellipsoid", "geoid"):
        raise ConfigError(f'height = "{height}": "ellipsoid" or "geoid"')
    if np.any(~(np.diff(trajectory.time) > 0.0)):
        raise InputError(f"{trajectory.source}: time does not increase; sort it and drop duplicates")
    lever_arm, words = lever_arm_of(point, result)
    time, names = _times(trajectory, rate_hz, at, labels)
    moved, motion = _sampled(trajectory, time, lever_arm)
    fix, satellites = _fixes(result, moved.time)
    if epoch is None and result is not None:
        epoch = result.epoch
    return ExportTrack(
        trajectory=moved,
        name=name,
        point=words,
        epoch=epoch,
        undulation=undulation(moved.lat, moved.lon, geoid),
        height=height,
        fix=fix,
        n_satellites=satellites,
        labels=names,
        a_eb_b=_body_acceleration(motion),
        w_nb_b=_rate_against_level(motion, moved),
    )


def lever_arm_of(point: Point, result: Result | None) -> tuple[Array, str]:
    """Lever arm (3,) [m] of a point, and the point in words.

    Raises
    ------
    ConfigError
        If it is no point, or the antenna of a trajectory that comes without the settings of its run.
    InputError
        If the lever arm among these settings is none.
    """
    if isinstance(point, str):
        if point == "imu":
            return np.zeros(3), "IMU"
        if point != "antenna":
            raise ConfigError(f'point = "{point}": "imu", "antenna", or three numbers: forward, right, down [m]')
        settings = {} if result is None else result.summary.get("settings", {}).get("gnss", {})
        if not isinstance(settings, dict) or "lever_arm_m" not in settings:
            raise ConfigError(
                'point = "antenna": the lever arm stands in the summary.json of a run, which is not here; give three '
                "numbers instead: forward, right, down [m] from the IMU"
            )
        arm = _arm(settings["lever_arm_m"])
        if arm is None:
            raise InputError(
                f"summary.json: settings.gnss.lever_arm_m = {settings['lever_arm_m']!r}: has to be three numbers "
                "within 1000 m: forward, right, down [m]; run the project again"
            )
        return arm, "antenna"
    arm = _arm(point)
    if arm is None:
        raise ConfigError(f"point = {point}: has to be three numbers within 1000 m: forward, right, down [m]")
    return arm, "{:g} m forward, {:g} m right, {:g} m down of the IMU".format(*arm)


def _arm(given: object) -> Array | None:
    """A lever arm (3,) [m] of three sensible numbers, or None."""
    try:
        arm = np.array(given, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        return None
    return arm if arm.shape == (3,) and np.isfinite(arm).all() and np.abs(arm).max() <= 1000.0 else None


def _chosen(source: Result | Trajectory, solution: str) -> Trajectory:
    if solution not in ("best", "smoothed", "forward"):
        raise ConfigError(f'solution = "{solution}": "best", "smoothed" or "forward"')
    if isinstance(source, Trajectory):
        return source
    if solution == "smoothed" and source.smoothed is None:
        raise ConfigError('solution = "smoothed": this run has no smoothed trajectory; "forward" is there')
    return source.forward if solution == "forward" else source.trajectory


def _times(
    trajectory: Trajectory,
    rate_hz: float | None,
    at: Sequence[float] | Array | None,
    labels: Sequence[str] | Array | None,
) -> tuple[Array, Array | None]:
    """Times of the epochs to export, all of them covered by the trajectory, and their labels."""
    epochs = trajectory.time
    if at is not None:
        if rate_hz is not None:
            raise ConfigError("rate_hz and at: either regular epochs or those of events")
        return _events(trajectory, at, labels)
    if labels is not None:
        raise ConfigError("labels: name events, so `at` has to be given with them")
    if rate_hz is None:
        return epochs, None
    span = float(epochs[-1] - epochs[0])
    if not (0.0 < rate_hz <= 1.0 / FEWEST_S) or span * rate_hz > MOST_EPOCHS:
        raise ConfigError(
            f"rate_hz = {rate_hz:g}: has to be above 0 and at most {1.0 / FEWEST_S:g}, and give no more than "
            f"{MOST_EPOCHS} epochs"
        )
    first, last = np.ceil(epochs[0] * rate_hz - 1e-6), np.floor(epochs[-1] * rate_hz + 1e-6)
    time = _snapped(np.arange(first, last + 1.0) / rate_hz, epochs)
    time = time[_inside(epochs, time)]
    if not time.size:
        raise ConfigError(f"rate_hz = {rate_hz:g}: gives no epoch within the {span:.3f} s of the trajectory")
    return time, None


def _snapped(time: Array, epochs: Array) -> Array:
    """Times that are those of epochs but for rounding are made so: the epochs are taken as they are."""
    nearest = epochs[np.clip(np.searchsorted(epochs, time - 1e-6), 0, epochs.size - 1)]
    return np.where(np.abs(nearest - time) < 1e-6, nearest, time)


def _events(
    trajectory: Trajectory, at: Sequence[float] | Array, labels: Sequence[str] | Array | None
) -> tuple[Array, Array]:
    time = np.array(at, dtype=np.float64)
    if time.ndim != 1 or not time.size or not np.isfinite(time).all():
        raise InputError("events: their times have to be a list of finite numbers [s], at least one")
    words = range(1, time.size + 1) if labels is None else labels
    # Half a surrogate pair, which no UTF-8 file can hold, becomes a question mark.
    names = np.array([str(word).encode("utf-8", "replace").decode() for word in words], dtype=np.str_)
    if names.shape != time.shape:
        raise InputError(f"events: {time.size} times but {names.size} labels")
    order = np.argsort(time, kind="stable")
    time, names = _snapped(time[order], trajectory.time), names[order]
    inside = _inside(trajectory.time, time)
    if not inside.all():
        left_out = [
            f"{name!r} at {when:.3f} s" for name, when in zip(names[~inside].tolist(), time[~inside], strict=True)
        ]
        listed = ", ".join(left_out[:_NAMED]) + (", ..." if len(left_out) > _NAMED else "")
        reach = f"{trajectory.source} goes from {trajectory.time[0]:.3f} s to {trajectory.time[-1]:.3f} s"
        what = f"{len(left_out)} of {time.size} events lie outside the trajectory or in a gap of it: {listed}; {reach}"
        if not inside.any():
            raise InputError(f"{what}; are the events in the time of the log?")
        warnings.warn(f"{what}; they are left out", NavfuseWarning, stacklevel=4)
    return time[inside], names[inside]


def _inside(epochs: Array, time: Array) -> Array:
    return time == epochs[0] if epochs.size == 1 else covered(epochs, time)


def _sampled(trajectory: Trajectory, time: Array, lever_arm: Array) -> tuple[Trajectory, BodyMotion]:
    """The trajectory at other times and of another point, and the motion behind it."""
    here = not np.any(lever_arm)
    if not here and trajectory.attitude is None:
        raise InputError(
            f"{trajectory.source}: another point than the IMU needs the attitude, which this trajectory lacks"
        )
    epochs = trajectory.time
    gap = np.inf if epochs.size == 1 else longest_bridged(epochs)
    _warn_of_coarse_epochs(trajectory, time, here)
    motion = body_motion(earth_states(trajectory), time, gap)
    if not here:
        if motion.lone.any() and motion.v_e is not None:
            warnings.warn(
                f"{trajectory.source}: {int(motion.lone.sum())} epochs have no neighbour to tell how the vehicle "
                "turned; the velocity of the point is taken as that of the IMU there",
                NavfuseWarning,
                stacklevel=4,
            )
        motion = motion.moved(lever_arm)
    same_times = time is epochs
    if here and same_times:
        return trajectory, motion
    lat, lon, height = ecef_to_geodetic_batch(np.ascontiguousarray(motion.r_e))
    C_en = ned_axes(lat, lon)
    velocity = None if motion.v_e is None else np.einsum("nji,nj->ni", C_en, motion.v_e)
    attitude = C_nb = None
    if motion.q_eb is not None:
        q_nb = np.ascontiguousarray(multiply(conjugate(ned_quaternion(lat, lon)), motion.q_eb))
        attitude, C_nb = euler_from_quat_batch(q_nb), dcm_from_quat_batch(q_nb)
        attitude[:, 2] = np.mod(attitude[:, 2], 2.0 * np.pi)
    sd = {name: getattr(trajectory, name) for name in ("sd_position", "sd_velocity", "sd_attitude")}
    if not same_times and epochs.size > 1:
        sd = {name: None if value is None else interpolate_linear(epochs, value, time) for name, value in sd.items()}
    if not here and attitude is not None and C_nb is not None and motion.w_eb_b is not None:
        arms = {
            "sd_position": np.broadcast_to(lever_arm, (time.size, 3)),
            "sd_velocity": np.cross(motion.w_eb_b, lever_arm),
        }
        for name, arm in arms.items():
            if sd[name] is not None:
                sd[name] = sd[name] + _swung(attitude, C_nb, arm, sd["sd_attitude"])
    return Trajectory(time, lat, lon, height, velocity, attitude, **sd, source=trajectory.source), motion


def _warn_of_coarse_epochs(trajectory: Trajectory, time: Array, here: bool) -> None:
    """What lies between epochs far apart is guesswork that the standard deviations know nothing of."""
    if len(trajectory) < 2 or (here and np.isin(time, trajectory.time).all()):
        return
    usual = float(np.median(np.diff(trajectory.time)))
    if usual > COARSE_S:
        what = "velocity of the point is" if np.isin(time, trajectory.time).all() else "motion between epochs is"
        warnings.warn(
            f"{trajectory.source}: epochs are {usual:.3g} s apart; the {what} interpolated, with errors that the "
            "standard deviations do not hold (a car at 1 Hz: up to 0.1 m and 4 deg); run with output.rate_hz = 10 or "
            "more",
            NavfuseWarning,
            stacklevel=5,
        )


def _swung(attitude: Array, C_nb: Array, arm: Array, sd_attitude: Array | None) -> Array:
    """What one standard deviation of roll, pitch and heading moves the end of a body-fixed arm (n, 3) by, summed.

    The angles turn about the body's forward axis, the level axis across the heading, and the vertical.
    """
    if sd_attitude is None:
        return np.zeros_like(arm)
    arm_n = np.einsum("nij,nj->ni", C_nb, arm)
    heading, nothing = attitude[:, 2], np.zeros(len(attitude))
    axes = (
        C_nb[:, :, 0],
        np.column_stack((-np.sin(heading), np.cos(heading), nothing)),
        np.column_stack((nothing, nothing, nothing + 1.0)),
    )
    return sum((np.abs(np.cross(axis, arm_n)) * sd_attitude[:, [k]] for k, axis in enumerate(axes)), np.zeros_like(arm))


def _body_acceleration(motion: BodyMotion) -> Array | None:
    if motion.a_e is None or motion.q_eb is None:
        return None
    return np.einsum("nji,nj->ni", dcm_from_quat_batch(motion.q_eb), motion.a_e)


def _rate_against_level(motion: BodyMotion, trajectory: Trajectory) -> Array | None:
    """``w_nb_b = w_eb_b - C_bn w_en_n``; the level frame of a pole turns at no finite rate and is left out there."""
    if motion.w_eb_b is None or motion.q_eb is None or trajectory.velocity_n is None:
        return motion.w_eb_b
    sin_lat, cos_lat = np.sin(trajectory.lat), np.cos(trajectory.lat)
    bend = 1.0 - WGS84_E2 * sin_lat**2
    normal, meridian = WGS84_A / np.sqrt(bend), WGS84_A * (1.0 - WGS84_E2) / bend**1.5
    east = trajectory.velocity_n[:, 1] / (normal + trajectory.height)
    north = trajectory.velocity_n[:, 0] / (meridian + trajectory.height)
    away = np.abs(cos_lat) > 1e-8
    down = np.where(away, -east * sin_lat / np.where(away, cos_lat, 1.0), 0.0)
    w_en_e = np.einsum("nij,nj->ni", ned_axes(trajectory.lat, trajectory.lon), np.column_stack((east, -north, down)))
    return motion.w_eb_b - np.einsum("nji,nj->ni", dcm_from_quat_batch(motion.q_eb), w_en_e)


def _fixes(result: Result | None, time: Array) -> tuple[Array | None, Array | None]:
    """Fix type and satellites of the fix that was used last before each time, where it is not too old.

    A log that tells no types gives "" where a fix is near and "none" where none is: that much is known of any log.
    Rejected and withheld fixes do not count. Only a record without any position (velocities alone) counts all fixes.
    """
    if result is None or result.fixes is None or not result.fixes.time.size:
        return None, None
    fixes = result.fixes
    records = result.innovations.of("gnss_position")
    used = records.row[np.isin(records.status, ("used", "reset"))]
    used = used[(used >= 0) & (used < fixes.time.size)]
    rows = np.unique(used) if len(records) else np.arange(fixes.time.size)
    if not rows.size:
        satellites = None if fixes.n_satellites is None else np.zeros(time.size, dtype=fixes.n_satellites.dtype)
        return np.full(time.size, "none"), satellites
    when = fixes.time[rows]
    age = FIX_AGE_S if fixes.time.size < 2 else max(FIX_AGE_S, 1.5 * float(np.median(np.diff(fixes.time))))
    last = np.searchsorted(when, time + 1e-6, side="right") - 1
    fresh = (last >= 0) & (time - when[np.maximum(last, 0)] <= age)
    row = rows[np.maximum(last, 0)]
    fix = np.where(fresh, "" if fixes.fix is None else fixes.fix[row], "none")
    return fix, None if fixes.n_satellites is None else np.where(fresh, fixes.n_satellites[row], 0)
