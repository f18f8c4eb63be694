"""What a campaign leaves on disk, and what it tells a person."""

from __future__ import annotations

import os
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from navfuse.analysis.ensemble import SHARE_INSIDE, Average
from navfuse.errors import ConfigError
from navfuse.io.atomic import atomic_folder, refuse_to_replace
from navfuse.io.json_file import write_json
from navfuse.io.tables import write_table
from navfuse.montecarlo.assessment import SETTLE_S, Assessment, assess
from navfuse.montecarlo.campaign import Campaign, Progress, run_campaign
from navfuse.montecarlo.recipes import Recipe
from navfuse.report.montecarlo_figures import figure_averages, figure_rmse

Array = np.ndarray

FILES = (
    "runs.parquet",
    "nis.parquet",
    "nees.parquet",
    "summary.json",
    "nees.png",
    "nis.png",
    "rmse.png",
    "rmse_smoother.png",
    "nees_smoother.png",
)


def montecarlo(
    recipe: Recipe,
    folder: str | os.PathLike[str],
    runs: int = 200,
    *,
    jobs: int | None = None,
    first_seed: int = 0,
    settle_s: float = SETTLE_S,
    progress: Progress | None = None,
) -> tuple[Campaign, dict[str, Assessment]]:
    """Run, judge and write a campaign.

    Parameters
    ----------
    recipe : callable, seed -> Case
    folder : path-like
        Of the results; see :func:`write_campaign`.
    runs, jobs, first_seed, progress
        As :func:`~navfuse.montecarlo.campaign.run_campaign`.
    settle_s : float [s]
        Beginning of each run that is not judged.

    Returns
    -------
    Campaign
    assessments : dict of str to Assessment

    Raises
    ------
    OutputError
        If the folder cannot be written; found out before the work begins.
    ConfigError, FilterError, InputError
        As :func:`~navfuse.montecarlo.campaign.run_campaign` and :func:`~navfuse.montecarlo.assessment.assess`.
    """
    length = getattr(recipe, "duration", np.inf)
    if not 0.0 <= settle_s < length:
        raise ConfigError(
            f"the beginning that is not judged must be at least 0 s and shorter than a run ({length:g} s), not "
            f"{settle_s:g} s"
        )
    refuse_to_replace(getattr(recipe, "inputs", ()), folder, FILES)
    with atomic_folder(folder, stale=FILES) as staging:
        campaign = run_campaign(recipe, runs, jobs=jobs, first_seed=first_seed, progress=progress)
        assessments = assess(campaign, settle_s)
        write_campaign(staging, campaign, assessments, _settings(recipe))
    return campaign, assessments


def write_campaign(
    folder: Path, campaign: Campaign, assessments: dict[str, Assessment], settings: dict[str, Any]
) -> None:
    """Write the tables, the summary and the plots of a campaign into an existing folder.

    ``runs.parquet`` has a row for each run and epoch: NEES of every group, error and sigma of every component in
    printed units. ``nis.parquet`` has a row for each measurement, ``nees.parquet`` the averages with their bounds. All
    three depend on recipe and seeds alone, not on the number of processes.
    """
    write_table(folder / "runs.parquet", run_columns(campaign))
    write_table(folder / "nis.parquet", _nis_columns(campaign))
    write_table(folder / "nees.parquet", _average_columns(assessments))
    write_json(folder / "summary.json", summary(campaign, assessments, settings))
    judged = assessments["filter"]
    figure_averages(list(judged.nees.values()), "NEES", judged.settle_s).savefig(folder / "nees.png")
    if judged.nis:
        figure_averages(list(judged.nis.values()), "NIS", judged.settle_s).savefig(folder / "nis.png")
    figure_rmse(judged.rms).savefig(folder / "rmse.png")
    if "smoother" in assessments:
        smoothed = assessments["smoother"]
        figure_averages(list(smoothed.nees.values()), "NEES", smoothed.settle_s).savefig(folder / "nees_smoother.png")
        figure_rmse(smoothed.rms).savefig(folder / "rmse_smoother.png")


def run_columns(campaign: Campaign) -> dict[str, Array]:
    """Columns of ``runs.parquet``: ``seed, time_s, nees_*, err_*, sd_*``, and of a smoother ``smoothed_err_*, ...``."""
    runs = campaign.runs
    columns = {
        "seed": np.repeat([run.seed for run in runs], [run.time.size for run in runs]),
        "time_s": np.concatenate([run.time for run in runs]),
    }
    for prefix in ("", "smoothed_"):
        for name in getattr(runs[0], f"{prefix}nees"):
            values = [getattr(run, f"{prefix}nees")[name] for run in runs]
            columns[f"{prefix}nees_{name.replace(' ', '_')}"] = np.concatenate(values)
    tables = {"err": "error", "sd": "sd"}
    if runs[0].smoothed_error is not None:
        tables |= {"smoothed_err": "smoothed_error", "smoothed_sd": "smoothed_sd"}
    for prefix, attribute in tables.items():
        stacked = np.concatenate([getattr(run, attribute) for run in runs])
        for k, component in enumerate(runs[0].components):
            columns[f"{prefix}_{component.name}_{component.unit}"] = stacked[:, k] * component.factor
    return columns


def _nis_columns(campaign: Campaign) -> dict[str, Array]:
    runs = campaign.runs
    seeds = np.repeat([run.seed for run in runs], [len(run.innovations) for run in runs])
    parts = [run.innovations.to_columns() for run in runs]
    return {"seed": seeds} | {
        name: np.concatenate([part[name] for part in parts]) for name in ("time_s", "source", "status", "nis", "dof")
    }


def _average_columns(assessments: dict[str, Assessment]) -> dict[str, Array]:
    found: list[tuple[str, str, Average]] = []
    for estimator, judged in assessments.items():
        kinds = {"nees": judged.nees, "nis": judged.nis, "squared_ratio": judged.squares}
        found += [(estimator, kind, entry) for kind, entries in kinds.items() for entry in entries.values()]
    lengths = [entry.time.size for _, _, entry in found]
    return {
        "estimator": np.repeat([estimator for estimator, _, _ in found], lengths),
        "kind": np.repeat([kind for _, kind, _ in found], lengths),
        "name": np.repeat([entry.name for _, _, entry in found], lengths),
        "time_s": np.concatenate([entry.time for _, _, entry in found]),
        "mean_per_dof": np.concatenate([entry.mean for _, _, entry in found]),
        "low_99": np.concatenate([entry.low for _, _, entry in found]),
        "high_99": np.concatenate([entry.high for _, _, entry in found]),
    }


def summary(campaign: Campaign, assessments: dict[str, Assessment], settings: dict[str, Any]) -> dict[str, Any]:
    """Content of ``summary.json``."""
    run = campaign.runs[0]
    tested = {component.name for component in run.components} & {
        entry.component.name for entry in assessments["filter"].rms
    }
    return {
        "recipe": settings,
        "runs": {
            "wanted": campaign.wanted,
            "finished": len(campaign.runs),
            "failed": {str(seed): reason for seed, reason in campaign.failed.items()},
            "interrupted": campaign.interrupted,
            "first_seed": run.seed,
        },
        "untested_states": [component.name for component in run.components if component.name not in tested],
        "speed": {
            "jobs": campaign.jobs,
            "seconds": campaign.seconds,
            "filter_epochs_per_s_with_simulation": campaign.throughput,
            "filter_epochs_per_s_and_process_without_simulation": _filter_speed(campaign),
        },
        **{name: assessment.to_dict() for name, assessment in assessments.items()},
    }


def describe(campaign: Campaign, assessments: dict[str, Assessment]) -> list[str]:
    """Lines for a person: verdicts, the table of NEES, what failed."""
    lines = []
    finished = f"{len(campaign.runs)} of {campaign.wanted} runs" + (" (interrupted)" if campaign.interrupted else "")
    for name, assessment in assessments.items():
        lines.append(f"{name}, {finished}: {assessment.verdict}")
    for estimator, judged in assessments.items():
        head = f"{estimator} after {judged.settle_s:g} s:"
        lines += ["", f"{head:24}{'per dof':>8}{'inside 99 %':>13}{'RMSE/sigma':>12}"]
        ratios = judged.ratios
        for kind, entries in (("NEES", judged.nees), ("NIS", judged.nis)):
            for name, entry in entries.items():
                after = entry.after(judged.settle_s)
                ratio = f"{ratios[name]:12.3f}" if name in ratios else ""
                lines.append(f"{kind} {name:19}{np.mean(after.mean):8.3f}{100.0 * after.share_inside:11.1f} %{ratio}")
    lines += [
        "",
        f"expected of a consistent filter: inside for about {100.0 * SHARE_INSIDE:.0f} % of the time or more. An error",
        "that lasts, such as a bias, has one chance in a run, so that a group may stray; the verdict allows for that.",
    ]
    if campaign.failed:
        seed, reason = min(campaign.failed.items())
        lines.append(f"{len(campaign.failed)} runs failed, which no average shows; seed {seed}: {reason}")
    return lines


def _filter_speed(campaign: Campaign) -> float:
    return float(np.median([run.samples / run.seconds for run in campaign.runs]))


def _settings(recipe: Recipe) -> dict[str, Any]:
    if hasattr(recipe, "settings"):
        return recipe.settings()  # pyright: ignore[reportFunctionMemberAccess]
    if is_dataclass(recipe) and not isinstance(recipe, type):
        return {entry.name: getattr(recipe, entry.name) for entry in fields(recipe)}
    return {"callable": getattr(recipe, "__qualname__", type(recipe).__qualname__)}
