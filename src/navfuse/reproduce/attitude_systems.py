"""Heading and attitude from gyros, accelerometers and a magnetometer: two studies."""

from __future__ import annotations

import numpy as np

from navfuse.attitude_study import ahrs_study, gyro_heading_study
from navfuse.errors import InputError
from navfuse.reproduce.study import Study, Table, Wishes

DEGREES = 180.0 / np.pi
SEEDS = 12
METHODS = ("navfuse", "VQF", "navfuse smoothed", "VQF offline", "navfuse 6-D", "VQF 6-D")


def heading(wishes: Wishes) -> Study:
    """The two-state gyro-magnetometer filter on simulated drives."""
    seeds = wishes.number_of_runs(SEEDS)
    found = gyro_heading_study(seeds=seeds)
    rows = tuple(
        (
            name,
            *(f"{DEGREES * rmse[kind]:.2f}" for kind in ("compass", "gyro", "forward", "smoothed")),
            f"{DEGREES * found.bias_error[name]:.4f}",
            f"{found.nis[name]:.3f}",
        )
        for name, rmse in found.rmse.items()
    )
    header = (
        "scenario",
        "compass deg",
        "gyro alone deg",
        "forward deg",
        "smoothed deg",
        "bias error deg/s",
        "mean NIS",
    )
    table = Table(f"Heading, root mean square after 120 s over {seeds} seeds; largest error of the bias", header, rows)
    return Study(
        "gyro-magnetometer",
        "Heading from a gyro and a compass",
        "the lecture Multisensor Integrated Navigation (P. Groves, COMP0130)",
        (table,),
        {"gyro-magnetometer": found.figure()},
        ("Compass noise of 4 deg at 2 Hz, a gyro with a bias of 1 deg/s; all drawn anew for every seed.",),
        {"rmse_deg": {name: {kind: DEGREES * v for kind, v in rmse.items()} for name, rmse in found.rmse.items()}},
    )


def ahrs(wishes: Wishes) -> Study:
    """The attitude and heading reference on trials with optical truth, beside VQF where that is installed."""
    if wishes.data is None:
        raise InputError("this study reads trials of BROAD: give the folder that holds broad/ with --data")
    folder = wishes.data / "broad"
    found = ahrs_study(folder if folder.is_dir() else wishes.data)
    rows = []
    for trial in found.trials:
        for method in (*METHODS, *(name for name in trial.errors if name not in METHODS)):
            if method in trial.errors:
                error = trial.errors[method]
                values = (DEGREES * value for value in (error.total, error.heading, error.inclination))
                rows.append((f"{trial.name}: {method}", *(f"{value:.2f}" for value in values)))
    table = Table(
        "RMS orientation error", ("trial: method", "total deg", "heading deg", "inclination deg"), tuple(rows)
    )
    beside = any("VQF" in trial.errors for trial in found.trials)
    return Study(
        "ahrs",
        "Attitude and heading reference on the BROAD trials",
        "the data set BROAD (Laidig and others 2021) and the filter VQF (Laidig and Seel 2023)",
        (table,),
        {"ahrs": found.figure()},
        (
            "While the body moves and has a reference; the constant heading offset with the least error is taken out.",
            "navfuse: one set of parameters for all trials, chosen while looking at them; VQF: its defaults."
            if beside
            else "VQF is not installed, so it is not beside.",
        ),
    )
