"""What a run used, did and found, as plain data for ``summary.json``."""

from __future__ import annotations

import platform
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from navfuse import __version__
from navfuse.analysis.consistency import NisSummary, nis_summary
from navfuse.analysis.plausibility import worst_factor
from navfuse.data.logs import GnssLog, ImuLog
from navfuse.data.result import Result
from navfuse.io.result_folder import STATE_UNITS

if TYPE_CHECKING:
    from navfuse.data.trajectory import Trajectory
    from navfuse.imu.alignment import Alignment
    from navfuse.imu.error_model import ImuErrorModel


def summarize_run(
    result: Result,
    *,
    settings: dict[str, Any],
    imu: dict[str, Any],
    gnss: GnssLog | None,
    model: ImuErrorModel,
    alignments: Sequence[Alignment],
    seconds: dict[str, float],
    contradicted: bool,
    exclude: Sequence[tuple[float, float]] = (),
) -> dict[str, Any]:
    """Inputs, settings, start, counts, NIS, accuracy, final sensor states, run times and warnings of a run.

    Parameters
    ----------
    result : Result
    settings : dict
        Settings in force, units in the keys.
    imu : dict
        From :func:`describe_imu`.
    gnss : GnssLog or None
        As read.
    model : ImuErrorModel
    alignments : sequence of Alignment
        One per stretch between long gaps.
    seconds : dict
        Run time of each stage [s].
    contradicted : bool
        Whether :func:`navfuse.analysis.plausibility.run_findings` found anything serious.
    exclude : sequence of (from, to) [s]
        Windows left out of the NIS statistics.

    Returns
    -------
    dict
        Every key that is a quantity carries its unit.
    """
    consistency = nis_summary(result.innovations, exclude)
    return {
        "navfuse": __version__,
        "python": platform.python_version(),
        "epoch_week_s": None if result.epoch is None else list(result.epoch),
        "inputs": {"imu": imu, "gnss": None if gnss is None else _gnss(gnss, result)},
        "settings": settings,
        "imu_model": {**model.to_datasheet(), "source": model.source},
        "start": [_start(alignment) for alignment in alignments],
        "states": [*("position", "velocity", "attitude"), *result.states],
        "state_count": 9 + sum(history.values.shape[1] for history in result.states.values()),
        "measurements": {source: summary.to_dict() for source, summary in consistency.items()},
        "verdict": _verdict(result, consistency, contradicted),
        "expected_accuracy": _accuracy(result),
        "final_sensor_states": {name: _final(name, history) for name, history in result.states.items()},
        "run_time_s": {**seconds, "total": sum(seconds.values())},
        "warnings": list(result.warnings),
    }


def summarize_drive(
    result: Result, *, settings: dict[str, Any], track: Trajectory, seconds: dict[str, float], contradicted: bool,
    exclude: Sequence[tuple[float, float]] = (),
) -> dict[str, Any]:  # fmt: skip
    """The same of a run without an inertial sensor; `track` is the dead-reckoned one."""
    consistency = nis_summary(result.innovations, exclude)
    return {
        "navfuse": __version__,
        "python": platform.python_version(),
        "epoch_week_s": None if result.epoch is None else list(result.epoch),
        "inputs": {
            "dead_reckoning": {"source": track.source, **_span(track.time)},
            "gnss": None if result.fixes is None else _gnss(result.fixes, result),
        },
        "settings": settings,
        "states": ["velocity_error", "position_error", *(name for name in result.states if name == "fix_error")],
        "measurements": {source: summary.to_dict() for source, summary in consistency.items()},
        "verdict": _verdict(result, consistency, contradicted),
        "expected_accuracy": _accuracy(result),
        "final_sensor_states": {name: _final(name, history) for name, history in result.states.items()},
        "run_time_s": {**seconds, "total": sum(seconds.values())},
        "warnings": list(result.warnings),
    }


def _verdict(result: Result, consistency: dict[str, NisSummary], contradicted: bool) -> dict[str, Any]:
    """Whether the standard deviations of the run may be relied on, for programs that read thousands of summaries."""
    worst = worst_factor(consistency)
    reliable = False if contradicted else None if worst is None else True
    return {"reliable": reliable, "innovations_over_claim": worst, "warnings": len(result.warnings)}


def _span(time: np.ndarray) -> dict[str, Any]:
    step = np.diff(time)
    return {
        "rows": int(time.size),
        "from_s": float(time[0]),
        "to_s": float(time[-1]),
        "median_step_s": float(np.median(step)) if step.size else None,
        "longest_step_s": float(step.max()) if step.size else None,
    }


def describe_imu(imu: ImuLog) -> dict[str, Any]:
    """Source, kind, number of rows and times of an inertial log."""
    return {"source": imu.source, "kind": imu.kind, **_span(imu.time)}


def _gnss(gnss: GnssLog, result: Result) -> dict[str, Any]:
    forward = result.forward.time
    return {
        "source": gnss.source,
        **_span(gnss.time),
        "velocity": gnss.velocity_n is not None,
        "rows_before_start": int(np.count_nonzero(gnss.time < forward[0] - 1e-6)) if forward.size else 0,
        "rows_after_end": int(np.count_nonzero(gnss.time > forward[-1] + 1e-6)) if forward.size else 0,
        "median_sd_north_east_down_m": np.median(gnss.sd_position, axis=0).tolist(),
    }


def _start(alignment: Alignment) -> dict[str, Any]:
    from navfuse.core.rotation import euler_from_quat

    nav = alignment.start.nav
    sd = np.sqrt(np.diagonal(alignment.start.P))
    return {
        "time_s": alignment.start.time,
        "lat_deg": float(np.degrees(nav[0])),
        "lon_deg": float(np.degrees(nav[1])),
        "height_m": float(nav[2]),
        "velocity_mps": nav[3:6].tolist(),
        "roll_pitch_heading_deg": np.degrees(euler_from_quat(nav[6:10])).tolist(),
        "sd_position_m": sd[:3].tolist(),
        "sd_velocity_mps": sd[3:6].tolist(),
        "sd_attitude_north_east_down_deg": np.degrees(sd[6:9]).tolist(),
        "level_from": alignment.level_source,
        "heading_from": alignment.heading_source,
        "standing_s": alignment.standing_s,
    }


def _accuracy(result: Result) -> dict[str, Any]:
    found = {}
    for name, trajectory in (("forward", result.forward), ("smoothed", result.smoothed)):
        if trajectory is None or trajectory.sd_position is None or not len(trajectory):
            continue
        horizontal = np.hypot(trajectory.sd_position[:, 0], trajectory.sd_position[:, 1])
        worst = int(np.argmax(horizontal))
        found[name] = {
            "sd_horizontal_at_end_m": float(horizontal[-1]),
            "sd_horizontal_median_m": float(np.median(horizontal)),
            "sd_horizontal_worst_m": float(horizontal[worst]),
            "worst_at_s": float(trajectory.time[worst]),
        }
    return found


def _final(name: str, history: Any) -> dict[str, Any]:
    unit, factor = STATE_UNITS.get(name, ("", 1.0))
    suffix = f"_{unit}" if unit else ""
    if not history.time.size:
        return {}
    return {f"value{suffix}": (history.values[-1] * factor).tolist(), f"sd{suffix}": (history.sd[-1] * factor).tolist()}
