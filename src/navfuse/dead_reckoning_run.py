"""A project without an inertial sensor: ``[dead_reckoning]`` and ``[gnss]`` to a corrected track."""

from __future__ import annotations

import time
import warnings
from dataclasses import fields, replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from navfuse.analysis.plausibility import run_warnings, silence
from navfuse.analysis.summary import summarize_drive
from navfuse.config.dead_reckoning import DeadReckoningProject
from navfuse.data.aiding_logs import BodyVelocityLog, HeadingLog, OdometerLog
from navfuse.data.logs import GnssLog
from navfuse.data.result import Result
from navfuse.data.trajectory import Trajectory, wrapped
from navfuse.dead_reckoning.checks import check_belongs_together, check_heading_unit, check_speed_unit
from navfuse.dead_reckoning.integration import DrModel, integrate
from navfuse.dead_reckoning.odometry import StartPoint, Steps, from_body_velocity, from_speed_and_heading, from_steps
from navfuse.dead_reckoning.wheels import Wheel, WheelGeometry, wheel_motion
from navfuse.errors import ConfigError, InputError, NavfuseWarning
from navfuse.io.aiding_tables import read_body_velocity, read_heading, read_odometer, read_wheel_speeds
from navfuse.io.gnss_table import read_gnss
from navfuse.io.trajectory_table import read_trajectory

Array = np.ndarray
Log = TypeVar("Log", OdometerLog, BodyVelocityLog, Steps)

START_SD = 10.0
"""Of the position at the start [m], where neither the project nor the first fix says more."""
CUT_S = 1.0
"""What is cut off the begin of a track without a word [s]: up to the next fix of a usual receiver."""


def process_drive(project: DeadReckoningProject) -> Result:
    """Read the logs of a project, dead-reckon, and correct by GNSS.

    Parameters
    ----------
    project : DeadReckoningProject

    Raises
    ------
    ConfigError, InputError, FilterError

    Warns
    -----
    NavfuseWarning
        Of what is doubtful in the logs and in the run.
    """
    clock = time.perf_counter()
    gnss = read_fixes(project)
    track = read_track(project, gnss)
    read = time.perf_counter() - clock
    settings, start = project.dead_reckoning, project.start
    model = DrModel(
        velocity_psd=settings.velocity_psd_m2ps3,
        vertical_psd=settings.vertical_psd_m2ps3,
        sd_position=start.sd_position_m or np.maximum(gnss.sd_position[_first_inside(track.time, gnss)], START_SD),
        sd_velocity=start.sd_velocity_mps or 1.0,
        heading_noise=float(np.radians(settings.heading_noise_deg)),
        speed_noise=settings.speed_noise_mps,
        fix_error_sd=settings.fix_error_sd_m or 0.0,
        fix_error_tau=settings.fix_error_tau_s,
        gate_probability=project.gnss.gate_probability,
        patience=settings.patience_s,
    )
    outages = project.gnss.outages_s
    result = integrate(
        track,
        gnss,
        model,
        frame=settings.frame,
        feedback=settings.feedback,
        use=project.gnss.use,
        outages=outages,
        smooth=project.smoother.method == "rts",
    )
    filtered = time.perf_counter() - clock - read
    contradictions = run_warnings(result, outages)
    for note in (*contradictions, *silence(result, outages)):
        warnings.warn(note, NavfuseWarning, stacklevel=2)
    result = replace(
        result,
        forward=_thinned(result.forward, project.output.rate_hz),
        smoothed=None if result.smoothed is None else _thinned(result.smoothed, project.output.rate_hz),
    )
    summary = summarize_drive(
        result,
        settings=project.settings(),
        track=track,
        seconds={"read": read, "filter": filtered},
        contradicted=bool(contradictions),
        exclude=outages,
    )
    return replace(result, summary=summary)


def inputs_of(project: DeadReckoningProject, path: str | Path) -> list[Path]:
    """The files that a project reads: its own and its logs."""
    settings = project.dead_reckoning
    return [Path(path), *(f for f in (settings.file, settings.heading_file, project.gnss.file) if f is not None)]


def read_fixes(project: DeadReckoningProject) -> GnssLog:
    """The GNSS log of a project with its offset and sigmas applied."""
    settings = project.gnss
    assert settings.file is not None
    gnss = read_gnss(
        settings.file,
        time_offset_s=settings.time_offset_s,
        epoch=settings.epoch_week_s,
        sd_position_m=settings.sd_position_m,
        sd_velocity_mps=settings.sd_velocity_mps,
    )
    sd_position = np.maximum(gnss.sd_position * settings.sd_scale, settings.sd_floor_m)
    sd_velocity = None if gnss.sd_velocity is None else gnss.sd_velocity * settings.velocity_sd_scale
    return replace(gnss, sd_position=sd_position, sd_velocity=sd_velocity)


def read_track(project: DeadReckoningProject, gnss: GnssLog) -> Trajectory:
    """The dead-reckoned track of a project; without a place to start from it begins at the first fix in it.

    Raises
    ------
    ConfigError
        If wheels have no heading to begin with, or their geometry cannot be.
    InputError
        If a log cannot be used, is in another unit than it says, or has no fix in it.

    Warns
    -----
    NavfuseWarning
        If the log begins more than a second before the first fix: where it was before is not known.
    """
    settings = project.dead_reckoning
    if settings.source == "trajectory":
        track = read_trajectory(settings.file)
        return replace(track, time=track.time + settings.time_offset_s)
    offset = settings.time_offset_s
    heading = None
    if settings.heading_file is not None:
        heading = read_heading(settings.heading_file, time_offset_s=offset)
        check_heading_unit(heading, gnss)
        turned = wrapped(heading.heading + np.radians(settings.heading_offset_deg), 2.0 * np.pi)
        heading = replace(heading, heading=turned)
    if settings.source == "wheels":
        return _wheeled(project, gnss, heading)
    assert heading is not None
    if settings.source == "odometer":
        odometer = read_odometer(settings.file, time_offset_s=offset)
        check_speed_unit(odometer, gnss)
        make, log = from_speed_and_heading, odometer
    else:
        radar = read_body_velocity(settings.file, time_offset_s=offset)
        check_speed_unit(OdometerLog(radar.time, radar.velocity_b[:, 0], source=radar.source), gnss)
        make, log = from_body_velocity, radar
    inside = np.flatnonzero((log.time >= heading.time[0]) & (log.time <= heading.time[-1]))
    rows = inside if inside.size else np.arange(log.time.size)
    first, start = _start(project, gnss, log.time[rows], log.source)
    return make(_rows_from(log, int(rows[first])), heading, start)  # type: ignore[arg-type]


def _wheeled(project: DeadReckoningProject, gnss: GnssLog, heading: HeadingLog | None) -> Trajectory:
    settings = project.dead_reckoning
    log = read_wheel_speeds(settings.file, time_offset_s=settings.time_offset_s)
    wheels = {
        name: Wheel(*place, steered=name in settings.steered_wheels)
        for name, place in zip(settings.wheel_names, settings.wheel_places_m, strict=True)
    }
    geometry = WheelGeometry(wheels)
    if heading is None:
        if project.start.heading_deg is None:
            raise ConfigError(
                "start.heading_deg: missing; wheels without dead_reckoning.heading_file need the heading to begin with"
            )
        motion = wheel_motion(log, geometry, sd_speed=settings.sd_wheel_mps)
        check_speed_unit(OdometerLog(motion.time, motion.speed, source=log.source), gnss)
        steps = motion.steps()
        first, start = _start(project, gnss, steps.time, log.source)
        # The heading given is that at the begin of the log.
        start = replace(start, heading=start.heading + float(steps.turn[:first].sum()))
        return from_steps(_rows_from(steps, first), start, geometry.lever)
    rows = (log.time >= heading.time[0]) & (log.time <= heading.time[-1])
    if np.count_nonzero(rows) < 2:
        raise InputError(f"{log.source} and {heading.source} have fewer than two epochs in common")
    log = replace(log, time=log.time[rows], speed=log.speed[rows])
    psi = np.interp(log.time, heading.time, np.unwrap(heading.heading))
    rate = np.gradient(psi, log.time)
    motion = wheel_motion(log, geometry, sd_speed=settings.sd_wheel_mps, yaw_rate=rate, sd_yaw_rate=0.1)
    check_speed_unit(OdometerLog(motion.time, motion.speed, source=log.source), gnss)
    steps = Steps(log.time, motion.speed[1:] * np.diff(log.time), np.diff(psi), source=log.source)
    first, start = _start(project, gnss, log.time, log.source)
    return from_steps(_rows_from(steps, first), replace(start, heading=float(psi[first])), geometry.lever)


def _start(project: DeadReckoningProject, gnss: GnssLog, times: Array, source: str) -> tuple[int, StartPoint]:
    """Row of `times` at which a track begins, and where: the last row that is no later than the first fix inside.

    Where the project says no place, a row before that has none: a fix is no place of a moving vehicle half a minute
    earlier.
    """
    start = project.start
    heading = float(np.radians(start.heading_deg or 0.0))
    if start.lat_deg is not None and start.lon_deg is not None and start.height_m is not None:
        place = StartPoint(float(np.radians(start.lat_deg)), float(np.radians(start.lon_deg)), start.height_m, heading)
        return 0, place
    nothing = np.zeros(times.size)
    check_belongs_together(Trajectory(times, nothing, nothing, nothing, source=source), gnss)
    k = _first_inside(times, gnss)
    # Two rows are left at least: a step.
    first = min(int(np.searchsorted(times, gnss.time[k], side="right")) - 1, max(times.size - 2, 0))
    if times[first] - times[0] > CUT_S:
        warnings.warn(
            f"{source} begins at {times[0]:.3f} s and the first fix of {gnss.source} inside is at {gnss.time[k]:.3f} "
            f"s: {times[first] - times[0]:.1f} s before it are cut off; give start.lat_deg, start.lon_deg and "
            "start.height_m, the place at which the log begins, to keep them",
            NavfuseWarning,
            stacklevel=2,
        )
    return first, StartPoint(float(gnss.lat[k]), float(gnss.lon[k]), float(gnss.height[k]), heading)


def _first_inside(times: Array, gnss: GnssLog) -> int:
    """Row of the first fix that is not before the first of `times`; the last row where none is."""
    return min(int(np.searchsorted(gnss.time, times[0])), gnss.time.size - 1)


def _rows_from(log: Log, first: int) -> Log:
    """A log without the rows before one."""
    kept = {e.name: v[first:] for e in fields(log) if isinstance(v := getattr(log, e.name), np.ndarray)}
    return replace(log, **kept)


def _thinned(track: Trajectory, rate: float) -> Trajectory:
    """A track at about a rate [Hz], its ends kept; 0 for all of it."""
    if rate == 0.0 or not len(track):
        return track
    slot = np.floor((track.time - track.time[0]) * rate + 1e-6)
    keep = np.concatenate(([True], np.diff(slot) > 0.0))
    keep[-1] = True
    return track.take(keep)
