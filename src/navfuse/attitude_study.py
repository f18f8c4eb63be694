"""Studies of the two attitude systems: numbers and figures of docs/gyro-magnetometer.md and docs/ahrs.md."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from navfuse.analysis.consistency import nis_summary
from navfuse.analysis.orientation import OrientationErrors, orientation_errors
from navfuse.attitude.ahrs import estimate_attitude
from navfuse.attitude.ahrs_settings import AhrsSettings
from navfuse.attitude.gyro_heading import SOURCE, GyroHeading, GyroHeadingSettings, gyro_heading
from navfuse.attitude.heading_logs import YawRateLog, yaw_rate_from_imu
from navfuse.core.constants import TWO_PI
from navfuse.data.aiding_logs import HeadingLog
from navfuse.data.trajectory import wrapped
from navfuse.errors import InputError
from navfuse.io.broad import BroadTrial, read_broad
from navfuse.simulation.scenario import load_scenario
from navfuse.simulation.scenario_run import scenario_truth

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = np.ndarray

_DEGREE = np.pi / 180.0
COMPASS_SD, GYRO_BIAS, GYRO_NOISE = 4.0 * _DEGREE, 1.0 * _DEGREE, 7e-5
SETTLED_S = 120.0


@dataclass(frozen=True, slots=True, eq=False)
class HeadingStudy:
    """Result of :func:`gyro_heading_study`.

    Attributes
    ----------
    rmse : dict of str to dict of str to float [rad]
        By scenario: of the ``compass``, the ``gyro`` alone, ``forward`` and ``smoothed``, over all seeds and the time
        after the first 120 s.
    bias_error : dict of str to float [rad/s]
        Largest over the seeds, at the end.
    nis : dict of str to float [1]
        Mean NIS by scenario.
    example : GyroHeading
        Of the first scenario, seed 0.
    example_truth : (n,) array [rad]
        True heading at its stamps.
    compass : HeadingLog
        Of the example.
    """

    rmse: dict[str, dict[str, float]]
    bias_error: dict[str, float]
    nis: dict[str, float]
    example: GyroHeading
    example_truth: Array
    compass: HeadingLog

    def figure(self) -> Figure:
        """Errors over time of the example."""
        from navfuse.report.attitude_figures import figure_heading

        return figure_heading(self.example, self.example_truth, self.compass)


def gyro_heading_study(scenarios: tuple[str, ...] = ("lawnmower", "rc-car"), seeds: int = 12) -> HeadingStudy:
    """Gyro-magnetometer heading on simulated scenarios, with a compass of 4 deg and a gyro bias of 1 deg/s.

    Parameters
    ----------
    scenarios : tuple of str
        As ``navfuse scenarios`` lists them; their motion is used, with compass readings at 2 Hz.
    seeds : int
    """
    rmse: dict[str, dict[str, float]] = {}
    bias_error, nis = {}, {}
    example: tuple[GyroHeading, Array, HeadingLog] | None = None
    for name in scenarios:
        truth = scenario_truth(load_scenario(name))
        ideal = yaw_rate_from_imu(truth.ideal_imu)
        step = float(np.diff(ideal.time).mean())
        attitude = truth.motion.trajectory(ideal.time).attitude
        assert attitude is not None
        psi = attitude[:, 2]
        rows = np.arange(0, psi.size, round(0.5 / step))
        late = ideal.time > ideal.time[0] + SETTLED_S
        squares: dict[str, list[float]] = {key: [] for key in ("compass", "gyro", "forward", "smoothed")}
        biases, values = [], []
        for seed in range(seeds):
            rng = np.random.default_rng(seed)
            noise = GYRO_NOISE / np.sqrt(step) * rng.standard_normal(psi.size)
            readings = wrapped(psi[rows] + COMPASS_SD * rng.standard_normal(rows.size), TWO_PI)
            compass = HeadingLog(ideal.time[rows], readings, source="simulated compass")
            run = gyro_heading(
                YawRateLog(ideal.time, ideal.rate + GYRO_BIAS + noise, averaged=True),
                compass,
                GyroHeadingSettings(gyro_noise=GYRO_NOISE, gyro_bias_sd=0.03, heading_sd=COMPASS_SD),
            )
            found = {"gyro": run.gyro_only, "forward": run.forward.heading, "smoothed": run.smoothed.heading}
            for key, heading in found.items():
                squares[key].append(float(np.mean(_apart(heading, psi)[late] ** 2)))
            squares["compass"].append(float(np.mean(_apart(readings, psi[rows])[late[rows]] ** 2)))
            biases.append(abs(float(run.forward.gyro_bias[-1]) - GYRO_BIAS))
            values.append(nis_summary(run.innovations)[SOURCE].mean_nis_per_dof)
            example = example or (run, psi, compass)
        rmse[name] = {key: float(np.sqrt(np.mean(kept))) for key, kept in squares.items()}
        bias_error[name], nis[name] = max(biases), float(np.mean(values))
    if example is None:
        raise InputError("a study of the gyro-magnetometer heading needs at least one scenario and one seed")
    return HeadingStudy(rmse, bias_error, nis, *example)


@dataclass(frozen=True, slots=True, eq=False)
class AhrsTrial:
    """Errors of every method on one trial, and their course.

    Attributes
    ----------
    name : str
    errors : dict of str to OrientationErrors
        By method; see :func:`ahrs_study`.
    time : (n,) array [s]
    course : dict of str to (n,) arrays [rad]
        Total error of the methods with a magnetometer, heading offset removed; NaN where there is no reference.
    """

    name: str
    errors: dict[str, OrientationErrors]
    time: Array
    course: dict[str, Array]


@dataclass(frozen=True, slots=True, eq=False)
class AhrsStudy:
    """Result of :func:`ahrs_study`."""

    trials: tuple[AhrsTrial, ...]

    def figure(self) -> Figure:
        """Total error over time, one panel for each trial."""
        from navfuse.report.attitude_figures import figure_ahrs

        return figure_ahrs([(trial.name, trial.time, trial.course) for trial in self.trials])


def ahrs_study(folder: str | os.PathLike[str], settings: AhrsSettings | None = None) -> AhrsStudy:
    """Attitude and heading reference on every BROAD trial of a folder, beside VQF where that package is installed.

    Parameters
    ----------
    folder : path-like
        With trials as ``.mat`` files.
    settings : AhrsSettings, optional
        The same for all trials.

    Returns
    -------
    AhrsStudy
        Methods ``navfuse``, ``navfuse smoothed``, ``navfuse 6-D``, ``navfuse 6-D smoothed``, and ``VQF``,
        ``VQF offline``, ``VQF 6-D``, ``VQF 6-D offline``. Errors are RMS over the samples marked as movement that have
        a reference, after the constant heading offset with the least total error was removed.

    Raises
    ------
    InputError
        If there is no trial, or one cannot be read.
    """
    paths = sorted(Path(folder).glob("*.mat"))
    if not paths:
        raise InputError(f"{folder}: no trial of BROAD (*.mat) is in this folder")
    return AhrsStudy(tuple(_ahrs_trial(read_broad(path), settings) for path in paths))


def _ahrs_trial(trial: BroadTrial, settings: AhrsSettings | None) -> AhrsTrial:
    full = estimate_attitude(trial.imu, trial.magnetometer, settings)
    horizon = estimate_attitude(trial.imu, None, settings)
    attitudes = {
        "navfuse": full.realtime.q_nb[1:],
        "navfuse smoothed": full.smoothed.q_nb[1:] if full.smoothed else None,
        "navfuse 6-D": horizon.realtime.q_nb[1:],
        "navfuse 6-D smoothed": horizon.smoothed.q_nb[1:] if horizon.smoothed else None,
    } | _vqf(trial)
    errors, course = {}, {}
    for method, q in attitudes.items():
        if q is None:
            continue
        errors[method] = orientation_errors(q, trial.q_nb, trial.movement, remove_offset=True)
        if "6-D" not in method:
            course[method] = _course(q, trial.q_nb, errors[method].offset)
    return AhrsTrial(trial.name, errors, trial.imu.time[1:], course)


def _vqf(trial: BroadTrial) -> dict[str, Array]:
    """VQF (Laidig and Seel 2023) with its default parameters; its frames are forward-left-up and east-north-up."""
    try:
        from vqf import VQF, offlineVQF
    except ImportError:
        return {}
    from navfuse.core.rotation import quat_multiply

    dt = float(np.diff(trial.imu.time).mean())
    flu = np.array([1.0, -1.0, -1.0])
    logs = [
        np.ascontiguousarray(values * flu)
        for values in (trial.imu.gyro[1:] / dt, trial.imu.accel[1:] / dt, 1e6 * trial.magnetometer.field_b)
    ]
    now, later = VQF(dt).updateBatch(*logs), offlineVQF(logs[0], logs[1], logs[2], dt)
    half = float(np.sqrt(0.5))

    def to_ned(q: Array) -> Array:
        return np.stack(
            quat_multiply((0.0, half, half, 0.0), np.stack(quat_multiply(q.T, (0.0, 1.0, 0.0, 0.0)))), axis=1
        )

    return {
        "VQF": to_ned(now["quat9D"]),
        "VQF offline": to_ned(later["quat9D"]),
        "VQF 6-D": to_ned(now["quat6D"]),
        "VQF 6-D offline": to_ned(later["quat6D"]),
    }


def _course(q: Array, reference: Array, offset: float) -> Array:
    from navfuse.core.rotation import quat_conjugate, quat_multiply

    turned = np.stack(quat_multiply((np.cos(0.5 * offset), 0.0, 0.0, -np.sin(0.5 * offset)), q.T))
    e = np.stack(quat_multiply(turned, quat_conjugate(reference.T)))
    return 2.0 * np.arctan2(np.linalg.norm(e[1:], axis=0), np.abs(e[0]))


def _apart(one: Array, other: Array) -> Array:
    return np.angle(np.exp(1j * (one - other)))
