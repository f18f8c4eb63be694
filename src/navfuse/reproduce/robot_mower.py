"""A robot mower with wheel odometry, a fibre gyro and rare RTK fixes: data set Plaza 1 of Djugash and Singh (2009)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from navfuse.analysis.consistency import nis_summary
from navfuse.data.logs import GnssLog
from navfuse.data.result import Result
from navfuse.data.trajectory import Trajectory
from navfuse.dead_reckoning.odometry import StartPoint, Steps, from_steps, metres_per_radian
from navfuse.dead_reckoning.planar import OdometryModel, filter_odometry, first_heading
from navfuse.errors import InputError
from navfuse.report.study_figures import Curve, Panel, Picture
from navfuse.reproduce.drives import consistency_table, difference_n, map_picture, rms
from navfuse.reproduce.study import Study, Table, Wishes

Array = np.ndarray

PLACE = (np.radians(40.44), np.radians(-79.95))
"""Where its metres are put on the Earth; the data set does not say."""
EVERY_S = 10.0
SD_RTK = 0.02
MODEL = OdometryModel(
    distance_noise=0.082, slip_noise=0.057, turn_noise=1.2e-4, turn_slip=0.0144, gyro_bias_sd=1e-3,
    gyro_bias_walk=8.6e-6, scale_sd=0.03, scale_walk=2.8e-6, height_walk=0.01, sd_position=SD_RTK, gate_probability=1.0,
)  # fmt: skip
INTERVALS_S = (2.0, 5.0, 10.0, 30.0, 60.0)


class Logs(NamedTuple):
    """Steps of odometer and raw gyro, the RTK track, and the heading that the data set begins with [rad]."""

    steps: Steps
    rtk: GnssLog
    heading: float


def read(path: Path) -> Logs:
    """Read the file of the data set.

    Raises
    ------
    InputError
        If it is no MATLAB file, or lacks the tables GT, DR and DRp.

    Notes
    -----
    The turns in DR are differences of the headings in GT, which were corrected afterwards. What the gyro measured is
    found in the courses of DRp, the dead-reckoned track of the authors, which is DR's distances along the raw headings.
    """
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    try:
        file = loadmat(path)
        truth, dead, drawn = (np.asarray(file[name], dtype=float) for name in ("GT", "DR", "DRp"))
    except (OSError, ValueError, KeyError, NotImplementedError, MatReadError) as error:
        raise InputError(f"{path}: not the file of the data set, with GT, DR and DRp: {error}") from error
    n = len(truth)
    if truth.shape != (n, 4) or drawn.shape != (n, 4) or dead.shape != (n - 1, 3):
        raise InputError(f"{path}: GT {truth.shape}, DRp {drawn.shape} and DR {dead.shape} do not belong together")
    moved = np.diff(drawn[:, 1:3], axis=0)
    # x is taken for east; their angles run against the clock.
    heading = -np.unwrap(np.arctan2(moved[:, 1], moved[:, 0]))
    steps = Steps(drawn[:, 0], dead[:, 1], np.diff(heading, prepend=heading[0]), source=path.name)
    metres = metres_per_radian(np.array(PLACE[:1]), np.zeros(1))[0]
    # Two distances on a plane are two on the ellipsoid to 1e-5 over these 70 m.
    lat, lon = PLACE[0] + truth[:, 2] / metres[0], PLACE[1] + truth[:, 1] / metres[1]
    rtk = GnssLog(drawn[:, 0], lat, lon, np.zeros(n), np.full((n, 3), SD_RTK), source=path.name)
    return Logs(steps, rtk, float(0.5 * np.pi - truth[0, 3]) % (2.0 * np.pi))


def sparse(log: GnssLog, every: float) -> Array:
    """Rows of a log not nearer to each other than `every` [s]."""
    rows = [0]
    for k in range(1, log.time.size):
        if log.time[k] - log.time[rows[-1]] >= every - 0.05:
            rows.append(k)
    return np.array(rows)


def filtered(logs: Logs, every: float, model: OdometryModel = MODEL) -> tuple[Result, Array]:
    """The filter with a fix every so many seconds, and which epochs had none."""
    rows = sparse(logs.rtk, every)
    fixes = logs.rtk.take(rows)
    heading, sd = first_heading(logs.steps, fixes)
    start = StartPoint(float(fixes.lat[0]), float(fixes.lon[0]), 0.0, heading)
    result = filter_odometry(logs.steps, fixes, start, replace(model, sd_heading=max(sd, 0.1)))
    between = np.ones(len(result.forward), dtype=bool)
    between[rows] = False
    return result, between


def run(wishes: Wishes) -> Study:
    """The study: dead reckoning alone, the filter and the smoother with rare fixes against the RTK between them."""
    logs = read(wishes.file("cmu-plaza", "Plaza1_.mat"))
    rtk = Trajectory(logs.rtk.time, logs.rtk.lat, logs.rtk.lon, logs.rtk.height)
    rows, values = [], {}
    kept: tuple[Result, Array] | None = None
    for k, every in enumerate(INTERVALS_S):
        result, between = filtered(logs, every)
        assert result.smoothed is not None
        if every == EVERY_S:
            kept = result, between
        nis = nis_summary(result.innovations)["gnss_position"]
        errors = [difference_n(track, rtk)[between, :2] for track in (result.forward, result.smoothed)]
        sigma = [
            float(np.sqrt(np.mean((error / np.asarray(track.sd_position)[between, :2]) ** 2)))
            for error, track in zip(errors, (result.forward, result.smoothed), strict=True)
        ]
        one = [*(rms(error) for error in errors), *(float(np.hypot(*error.T).max()) for error in errors), *sigma]
        names = (
            "forward_m",
            "smoothed_m",
            "forward_max_m",
            "smoothed_max_m",
            "forward_over_sigma",
            "smoothed_over_sigma",
        )
        # Heights are zero and without error: they fill a third of the components with nothing.
        values[f"{every:g} s"] = dict(zip(names, one, strict=True)) | {"nis_horizontal": 1.5 * nis.mean_nis_per_dof}
        rows.append(
            (
                f"{every:g} s",
                *(f"{v:.3f}" for v in one[:4]),
                f"{1.5 * nis.mean_nis_per_dof:.2f}",
                *(f"{v:.2f}" for v in one[4:]),
            )
        )
        wishes.tell("intervals", (k + 1) / len(INTERVALS_S))
    assert kept is not None
    result, between = kept
    start = StartPoint(float(rtk.lat[0]), float(rtk.lon[0]), 0.0, logs.heading)
    alone = from_steps(logs.steps, start)
    off = difference_n(alone, rtk)[:, :2]
    way = float(np.abs(logs.steps.distance).sum())
    states = {name: (float(h.values[-1, 0]), float(h.sd[-1, 0])) for name, h in result.states.items()}
    bias, scale = states["yaw_gyro_bias"], states["odometer_scale"]
    tables = (
        Table(
            "Position between the fixes against RTK",
            ("a fix every", "forward rms m", "smoothed rms m", "forward max m", "smoothed max m", "NIS, horizontal",
             "forward / sigma", "smoothed / sigma"),
            tuple(rows),
            "Rms of distances; the last columns are 1 for a filter that knows its errors.",
        ),
        Table(
            "Dead reckoning alone",
            ("quantity", "value"),
            (
                ("way m", f"{way:.0f}"),
                ("rms m", f"{rms(off):.2f}"),
                ("at the end m", f"{np.hypot(*off[-1]):.2f}"),
                ("gyro bias found deg/h", f"{np.degrees(bias[0]) * 3600:.0f} +- {np.degrees(bias[1]) * 3600:.0f}"),
                ("odometer scale found %", f"{100 * scale[0]:.2f} +- {100 * scale[1]:.2f}"),
            ),
            f"The two below are the filter's at the end, with a fix every {EVERY_S:g} s.",
        ),
        consistency_table(nis_summary(result.innovations), "Of three components, one of which, height, is empty."),
    )  # fmt: skip
    return Study(
        "robot-mower",
        "A robot mower between rare RTK fixes",
        "data set Plaza 1 of J. Djugash and S. Singh, Carnegie Mellon University",
        tables,
        _pictures(logs, alone, result, rtk),
        NOTES,
        {"intervals": values, "dr_end_m": float(np.hypot(*off[-1])), "dr_rms_m": rms(off), "states": states},
    )


def _pictures(logs: Logs, alone: Trajectory, result: Result, rtk: Trajectory) -> dict[str, Picture]:
    assert result.smoothed is not None
    tracks = {
        "RTK": (rtk, "guide"), "dead reckoning": (alone, "line"), "smoothed": (result.smoothed, "line"),
        "fixes used": (result.fixes, "points"),
    }  # fmt: skip
    t = rtk.time - rtk.time[0]
    panels = []
    for name, track in (("forward", result.forward), ("smoothed", result.smoothed)):
        error = np.hypot(*difference_n(track, rtk)[:, :2].T)
        sd = np.asarray(track.sd_position)
        curves = (Curve("sigma", t, np.hypot(sd[:, 0], sd[:, 1]), "guide"), Curve(name, t, error))
        panels.append(Panel("time [s]", "horizontal error [m]", curves, title=name))
    constants = []
    for name, unit, factor in (("yaw_gyro_bias", "deg/h", np.degrees(3600.0)), ("odometer_scale", "%", 100.0)):
        history = result.states[name]
        curves = (
            Curve("estimate", t, factor * history.values[:, 0]),
            Curve("+- sigma", t, factor * (history.values[:, 0] + history.sd[:, 0]), "guide"),
            Curve("+- sigma", t, factor * (history.values[:, 0] - history.sd[:, 0]), "guide"),
        )
        constants.append(Panel("time [s]", f"{name.replace('_', ' ')} [{unit}]", curves))
    drawn = {name: entry for name, entry in tracks.items() if entry[0] is not None}
    return {
        "map": map_picture("The mown plaza", drawn, (*PLACE, 0.0)),  # type: ignore[arg-type]
        "errors": Picture(f"Errors with a fix every {EVERY_S:g} s", tuple(panels), row_in=2.4),
        "constants": Picture("What the filter learns", tuple(constants), row_in=2.2),
    }


NOTES = (
    "The filter carries position, height, heading, gyro bias and odometer scale; six states with a velocity error "
    "would not do, because a fix every 10 s says nothing of a velocity.",
    "The turns in the table DR of the data set are those of its corrected headings, with which dead reckoning is "
    "only 4.4 m off at the end. Here the raw gyro is used, which the track DRp of the authors holds.",
    "The densities of the noise maximise the likelihood of the innovations, which takes the fixes and nothing between "
    "them. They are those of this mower, grass and slopes.",
    "There is no gate: the fixes are RTK and right, while wheels slip now and then by more than a Gaussian would. With "
    "the usual gate of 99.9 % seven of 194 good fixes are rejected and the forward rms doubles.",
)
