"""Positions, velocities and clock of a receiver: Workshops 1 and 2 of a lecture, least squares and Kalman filter."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from navfuse.core.earth import ecef_to_geodetic_batch, geodetic_to_ecef_batch
from navfuse.data.logs import GnssLog
from navfuse.data.raw_gnss import RawGnssLog
from navfuse.data.trajectory import Trajectory
from navfuse.gnss.receiver_filter import ReceiverModel, filter_receiver
from navfuse.gnss.single_point import single_point_position, single_point_velocity
from navfuse.report.study_figures import Curve, Panel, Picture
from navfuse.reproduce.drives import map_panel, numbers, rms
from navfuse.reproduce.multisensor_course import read_exercise
from navfuse.reproduce.study import Study, Table, Wishes

Array = np.ndarray

SD_RANGE, SD_RATE = 10.0, 0.05
"""As the lecture states them."""
START = np.array([2447023.4, -5884195.9, -284784.3, 184.5, 76.9, -0.1, 9901.1, 99.9])
START_P = np.diag([100.0, 100.0, 100.0, 0.01, 0.01, 0.01, 100.0, 0.01])
START_TIME = -1.0


def solved(log: RawGnssLog) -> tuple[Array, Array]:
    """Position, clock offset; velocity, clock drift of every epoch alone, by least squares: (n, 4) each, in e."""
    times, first = log.epochs()
    place, motion = np.empty((2, times.size, 4))
    assert log.range_rate is not None
    assert log.sat_v_e is not None
    for k in range(times.size):
        at = slice(int(first[k]), int(first[k + 1]))
        fix = single_point_position(log.pseudorange[at], log.sat_r_e[at], SD_RANGE)
        moving = single_point_velocity(log.range_rate[at], log.sat_r_e[at], log.sat_v_e[at], fix.vector_e, SD_RATE)
        place[k], motion[k] = (*fix.vector_e, fix.clock), (*moving.vector_e, moving.clock)
    return place, motion


def run(wishes: Wishes) -> Study:
    """The study: least squares against the printed answers, and the eight-state filter and smoother."""

    def file(name: str) -> Path:
        return wishes.file("ucl-comp0130", "workshops", name)

    logs = [
        read_exercise(
            file(f"Workshop{k}_Pseudo_ranges.csv"), file(f"Workshop{k}_Pseudo_range_rates.csv"), SD_RANGE, SD_RATE
        )
        for k in (1, 2)
    ]
    (one, one_moving), (two, two_moving) = (solved(log) for log in logs)
    from scipy.io import loadmat

    answer = np.asarray(loadmat(file("W1_answer_task_2.mat"))["W1_answer_task_2"], dtype=float)
    degree = np.pi / 180.0
    printed_1 = geodetic_to_ecef_batch(*np.ascontiguousarray((answer * (degree, degree, 1.0)).T))
    printed_2 = numbers(file("Workshop2_GNSS_Pos_ECEF.csv"), 4)[:, 1:]
    begin = (START_TIME, START, START_P)
    forward, smoothed = (filter_receiver(logs[1], ReceiverModel(), begin, smooth=s) for s in (False, True))
    apart = [float(np.abs(one[:, :3] - printed_1).max()), float(np.abs(two[:, :3] - printed_2).max())]

    def rough(r: Array) -> float:
        # The second difference of white noise of sigma has sqrt(6) sigma.
        return rms(np.diff(r, n=2, axis=0)) / np.sqrt(6.0)

    rows = []
    for name, r, v in (
        ("least squares", two[:, :3], two_moving[:, :3]),
        ("Kalman filter", forward.x[:, :3], forward.x[:, 3:6]),
        ("smoother", smoothed.x[:, :3], smoothed.x[:, 3:6]),
    ):
        rows.append((name, f"{rms(r - printed_2):.2f}", f"{rough(r):.3f}", f"{rough(v):.4f}"))
    nis = float(forward.nis[1:].sum() / forward.dof[1:].sum())
    tables = (
        Table(
            "Least squares against the printed answers",
            ("exercise", "epochs", "largest difference of a coordinate m"),
            (("Workshop 1", str(len(one)), f"{apart[0]:.1e}"), ("Workshop 2", str(len(two)), f"{apart[1]:.1e}")),
            "The answers of Workshop 1 turn the Earth to first order while signals are under way only.",
        ),
        Table(
            "Workshop 2: how rough the solutions are",
            ("solution", "off the printed rms m", "noise of position m", "noise of velocity m/s"),
            tuple(rows),
            "Noise: rms of second differences over sqrt(6), in which a smooth flight hardly shows. The printed "
            f"solution is least squares. NIS of the filter per measurement: {nis:.2f}, {forward.dof.sum()} used of "
            f"{2 * len(logs[1])}.",
        ),
        Table(
            "Clock of the receiver",
            ("exercise", "offset at the start m", "at the end m", "drift at the end m/s"),
            (
                ("Workshop 1, least squares", f"{one[0, 3]:.1f}", f"{one[-1, 3]:.1f}", f"{one_moving[-1, 3]:.2f}"),
                ("Workshop 2, filter", f"{forward.x[0, 6]:.1f}", f"{forward.x[-1, 6]:.1f}", f"{forward.x[-1, 7]:.2f}"),
            ),
        ),
    )
    return Study(
        "gnss-course",
        "Position, velocity and clock of a receiver from raw measurements",
        "Workshops 1 and 2 of the lecture Multisensor Integrated Navigation (UCL COMP0130)",
        tables,
        _pictures(forward.time, two, two_moving, forward.x, smoothed.x),
        NOTES,
        {"largest_difference_m": apart, "nis_per_measurement": nis, "off_printed_m": rms(forward.x[:, :3] - printed_2)},
    )


def _pictures(t: Array, place: Array, motion: Array, x: Array, smoothed: Array) -> dict[str, Picture]:
    def log(r: Array) -> GnssLog:
        return GnssLog(t, *ecef_to_geodetic_batch(np.ascontiguousarray(r)), np.ones((len(r), 3)))

    first = log(place[:, :3])
    origin = (float(first.lat[0]), float(first.lon[0]), float(first.height[0]))
    sections: dict[str, tuple[Trajectory | GnssLog, str]] = {
        "least squares": (first, "points"),
        "smoother": (log(smoothed[:, :3]), "line"),
    }
    panels = []
    for k, axis in enumerate("xyz"):
        curves = (
            Curve("least squares", t, place[:, k] - smoothed[:, k], "points"),
            Curve("filter", t, x[:, k] - smoothed[:, k]),
        )
        panels.append(Panel("time [s]", f"{axis} less smoother [m]", curves))
        curves = (
            Curve("least squares", t, motion[:, k] - smoothed[:, 3 + k], "points"),
            Curve("filter", t, x[:, 3 + k] - smoothed[:, 3 + k]),
        )
        panels.append(Panel("time [s]", f"v{axis} less smoother [m/s]", curves))
    return {
        "map": Picture("The flight of Workshop 2", (map_panel(sections, origin),), row_in=4.5),
        "differences": Picture("Workshop 2: against the smoother", tuple(panels), columns=2, row_in=2.0),
    }


NOTES = (
    "Without a truth the noise of a solution shows in its second differences; what all solutions share, errors that "
    "stay with a satellite, does not.",
    "Start, sigmas and densities of the filter are those of the lecture.",
    "Workshop 1 differs from the printed answers by a few 1e-4 m because here the Earth turns exactly while signals "
    "are under way, there to first order. With the exercise's own rotation, least squares gives the printed "
    "coordinates within 1e-6 m.",
)
