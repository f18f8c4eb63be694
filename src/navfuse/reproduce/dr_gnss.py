"""A car with odometer and compass, corrected by GNSS: Workshop 3 of a lecture, against the published truth."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from navfuse.analysis.consistency import nis_summary
from navfuse.data.aiding_logs import HeadingLog, OdometerLog
from navfuse.data.logs import GnssLog
from navfuse.data.result import Result
from navfuse.data.trajectory import Trajectory
from navfuse.dead_reckoning.checks import check_heading_unit, check_speed_unit
from navfuse.dead_reckoning.integration import DrModel, integrate
from navfuse.dead_reckoning.odometry import StartPoint, from_speed_and_heading
from navfuse.errors import InputError
from navfuse.report.study_figures import Curve, Panel, Picture
from navfuse.reproduce.drives import consistency_table, difference_n, map_picture, numbers, rms
from navfuse.reproduce.study import Study, Table, Wishes

Array = np.ndarray

START = StartPoint(np.radians(50.4249580), np.radians(-3.5957974), 37.4)
SD_SCATTER, SD_VELOCITY = 0.2, 0.02
"""Of the fixes, as their description says [m], [m/s]."""
LASTING_S = 16.0
"""How long errors of the fixes last, from fixes less the integral of their own velocities."""
HEADING_NOISE = np.radians(2.0)
MODEL = DrModel(velocity_psd=0.2, heading_noise=HEADING_NOISE)
SETTLED_S = 5.0
BAR_M = 0.25
"""Horizontal rms error that a solution should not exceed."""


class Logs(NamedTuple):
    """What the exercise gives, and the truth at its epochs."""

    track: Trajectory
    gnss: GnssLog
    truth: Trajectory


def read(wishes: Wishes) -> Logs:
    """Read the logs of the exercise.

    Raises
    ------
    InputError
        If a file is missing or no such table, its units are not those expected, or the truth does not cover the fixes.
    """
    folder = ("ucl-comp0130", "workshops")
    dead = wishes.file(*folder, "Workshop3_Speed_Heading.csv")
    speed = numbers(dead, 3)
    g = numbers(wishes.file(*folder, "Workshop3_GNSS_Pos_Vel_NED.csv"), 7)
    truth_file = wishes.file("groves-profiles", "Profile_2.csv")
    t = numbers(truth_file, 10)
    interval = float(np.median(np.diff(g[:, 0])))
    # Errors that last count as often as they are given anew.
    sd = SD_SCATTER * np.sqrt(2.0 * LASTING_S / interval)
    gnss = GnssLog(
        g[:, 0], np.radians(g[:, 1]), np.radians(g[:, 2]), g[:, 3], np.full((len(g), 3), sd), g[:, 4:7],
        np.full((len(g), 3), SD_VELOCITY), source="Workshop3_GNSS_Pos_Vel_NED.csv",
    )  # fmt: skip
    odometer = OdometerLog(speed[:, 0], speed[:, 1], source=dead.name)
    heading = HeadingLog(speed[:, 0], np.radians(speed[:, 2]) % (2.0 * np.pi), source=dead.name)
    check_speed_unit(odometer, gnss)
    check_heading_unit(heading, gnss)
    if not (t[0, 0] <= g[0, 0] and g[-1, 0] <= t[-1, 0]):
        raise InputError(
            f"{truth_file}: covers {t[0, 0]:.3f} .. {t[-1, 0]:.3f} s, the fixes {g[0, 0]:.3f} .. {g[-1, 0]:.3f} s; the "
            "truth has to cover them: is the file cut short? Get it anew"
        )
    at = np.column_stack([np.interp(g[:, 0], t[:, 0], t[:, k]) for k in range(1, 7)])
    truth = Trajectory(g[:, 0], np.radians(at[:, 0]), np.radians(at[:, 1]), at[:, 2], at[:, 3:6], source="truth")
    return Logs(from_speed_and_heading(odometer, heading, START), gnss, truth)


def integrated(logs: Logs) -> dict[str, Result]:
    """Both frames, open and closed loop."""
    return {
        f"{frame}, {loop} loop": integrate(logs.track, logs.gnss, MODEL, frame=frame, feedback=loop)
        for frame in ("ned", "ecef")
        for loop in ("open", "closed")
    }


def run(wishes: Wishes) -> Study:
    """The study: dead reckoning, GNSS and both together against the truth; frames and loops against each other."""
    logs = read(wishes)
    found = integrated(logs)
    offset = difference_n(logs.gnss, logs.truth).mean(axis=0)
    best = found["ned, open loop"]
    assert best.smoothed is not None
    gnss = Trajectory(logs.gnss.time, logs.gnss.lat, logs.gnss.lon, logs.gnss.height, logs.gnss.velocity_n)
    dr_error = difference_n(logs.track, logs.truth)
    cases = {
        "dead reckoning alone": (logs.track, dr_error[0]),
        "GNSS alone": (gnss, offset),
        "integrated, forward": (best.forward, offset),
        "integrated, smoothed": (best.smoothed, offset),
    }
    rows, values = [], {}
    for name, (track, taken) in cases.items():
        error = difference_n(track, logs.truth) - taken
        speed = np.asarray(track.velocity_n) - np.asarray(logs.truth.velocity_n)
        late = logs.truth.time >= SETTLED_S
        one = {
            "horizontal_m": rms(error[:, :2]),
            "horizontal_settled_m": rms(error[late, :2]),
            "end_m": float(np.hypot(*error[-1, :2])),
            "velocity_mps": rms(speed[:, :2]),
        }
        values[name] = one
        rows.append((name, *(f"{value:.3f}" for value in one.values())))
    apart = {
        name: max(
            float(np.abs(difference_n(getattr(one, role), getattr(best, role))).max())
            for role in ("forward", "smoothed")
        )
        for name, one in found.items()
    }
    tables = (
        Table(
            "Against the truth (rms)",
            ("solution", "horizontal m", f"after {SETTLED_S:g} s", "at the end m", "horizontal velocity m/s"),
            tuple(rows),
            f"The mean offset of the fixes, north {offset[0]:.2f} m, east {offset[1]:.2f} m, down {offset[2]:.2f} m, "
            "is taken off all that uses them; from dead reckoning its own error at the start.",
        ),
        Table(
            "Frames and loops",
            ("filter", "largest difference from ned, open loop m"),
            tuple((name, f"{value:.1e}") for name, value in apart.items()),
        ),
        consistency_table(
            nis_summary(best.innovations),
            "Sigmas of the fixes stand for errors that last; single innovations of position are far smaller.",
        ),
    )
    numbers_: dict[str, Any] = {
        "solutions": values, "gnss_offset_m": offset.tolist(), "largest_difference_m": apart,
    }  # fmt: skip
    return Study(
        "dr-gnss",
        "Odometer, compass and GNSS of a car: the six-state integration",
        "Workshop 3 of the lecture Multisensor Integrated Navigation (UCL COMP0130)",
        tables,
        _pictures(logs, best, offset, dr_error),
        (_against_the_bar(values), *NOTES),
        numbers_,
    )


def _against_the_bar(values: dict[str, dict[str, float]]) -> str:
    """Whether the solutions are within the error asked of them, the forward one with and without its beginning."""
    forward, smoothed = (values[f"integrated, {role}"] for role in ("forward", "smoothed"))
    judged = [
        f"{name} {error:.3f} m {'meets' if error <= BAR_M else 'misses'} it"
        for name, error in (
            ("forward over the whole drive", forward["horizontal_m"]),
            (f"forward after {SETTLED_S:g} s", forward["horizontal_settled_m"]),
            ("smoothed over the whole drive", smoothed["horizontal_m"]),
        )
    ]
    return f"Horizontal rms asked for: {BAR_M:g} m. {'; '.join(judged).capitalize()}."


def _pictures(logs: Logs, best: Result, offset: Array, dr_error: Array) -> dict[str, Picture]:
    assert best.smoothed is not None
    origin = (float(logs.truth.lat[0]), float(logs.truth.lon[0]), float(logs.truth.height[0]))
    tracks = {
        "truth": (logs.truth, "guide"), "dead reckoning": (logs.track, "line"), "GNSS": (logs.gnss, "points"),
        "smoothed": (best.smoothed, "line"),
    }  # fmt: skip
    t = logs.truth.time
    panels = []
    for k, axis in enumerate(("north", "east")):
        curves = tuple(
            Curve(name, t, (difference_n(track, logs.truth) - offset)[:, k], kind)
            for name, track, kind in (
                ("GNSS", logs.gnss, "points"), ("forward", best.forward, "line"), ("smoothed", best.smoothed, "line"),
            )
        )  # fmt: skip
        panels.append(Panel("time [s]", f"{axis} error [m]", curves, limit=(-1.0, 1.0)))
    errors = Panel(
        "time [s]",
        "error of dead reckoning [m]",
        tuple(
            Curve(name, t, values, kind)
            for k, axis in enumerate(("north", "east"))
            for name, values, kind in (
                (f"{axis}, estimated", -best.states["dr_position_error"].values[:, k], "line"),
                (f"{axis}, true", dr_error[:, k] - offset[k], "guide"),
            )
        ),
    )
    return {
        "map": map_picture("The drive", tracks, origin),
        "errors": Picture("Errors of position less the constant offset of the fixes", tuple(panels), row_in=2.4),
        "dr-errors": Picture("What the filter estimates: the error of dead reckoning", (errors,), row_in=3.0),
    }


NOTES = (
    "S_DR is 0.2 m^2/s^3, as in the lecture; the stated compass noise of 2 deg adds 2 (sigma v)^2 at every step. "
    "Nothing was tuned with the truth.",
    "The fixes come from a filter: the first ones are 3 m off and converge, and later errors last about 16 s, which "
    "fixes less the integral of their own velocities show without the truth. As the filter takes errors for white, the "
    "stated scatter of 0.2 m is multiplied by sqrt(2 x 16 s / 0.5 s) to 1.6 m. So the NIS of position is far below 1.",
    "Forward, the first second rests on the first fixes; that alone is most of its rms over the whole drive.",
    "A scale of the odometer was tried as a constant state: it came out at 18 % instead of 2 %, because the compass "
    "noise is in the velocities that it multiplies (errors in variables). The random walk of velocity takes it up.",
)
