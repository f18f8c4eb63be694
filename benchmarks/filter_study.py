"""When does an unscented filter win? Monte Carlo runs of four estimators beside each other, on the same draws.

    python -m benchmarks.filter_study --case heading-60 --runs 200 --save study.json --figure figures

Without ``--case`` all cases are run, each with as many runs as in the manual. A file that is there already is added to.
``--runs 0`` runs nothing and prints and draws what was saved. Every row gives root mean square errors, and the average
NEES per degree of freedom with its 99 % bounds from the number of runs and the share of the epochs at which the average
over the runs keeps to them.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.filter_cases import CASES, DRIVING, ESTIMATORS, Study, StudyRecipe
from navfuse.analysis.consistency import average_bounds
from navfuse.analysis.ensemble import average
from navfuse.errors import ConfigError, FilterError
from navfuse.filters.kinds import FILTERS
from navfuse.imu.gaps import gap_limit
from navfuse.imu.increments import to_increments
from navfuse.montecarlo.campaign import Campaign, run_campaign
from navfuse.montecarlo.single import RunRecord

FOUND = 3.0
"""Heading error [deg] below which the heading counts as found."""
WITHIN = 60.0
"""Seconds of driving after which it is asked whether it is found."""
GROUPS = ("position", "velocity", "attitude", "gyro_bias", "accel_bias", "whole state")
CURVE = 300
"""Points of a saved curve at most."""
REPEATS = 2
COLUMNS = (
    "runs",
    "position m",
    "velocity m/s",
    "level deg",
    "heading deg",
    "NEES whole",
    "attitude",
    "biases",
    "rejected, resets",
    "us",
)


def study(name: str, estimator: str, runs: int, jobs: int = 1) -> dict[str, Any]:
    """Figures of one case with one estimator, ready for JSON."""
    case = CASES[name]
    recipe = StudyRecipe(case, estimator)
    try:
        campaign = run_campaign(recipe, runs, jobs=jobs)
    except ConfigError as error:
        return {"runs": 0, "refused": str(error)}
    except FilterError as error:
        return {"runs": 0, "failed": runs, "why": str(error)}
    return figures(case, campaign) | {"microseconds_per_sample": cost(recipe)}


def cost(recipe: StudyRecipe) -> float:
    """CPU time per IMU sample [us] of the filter with its updates, the least of some repetitions."""
    case = recipe(0)
    increments = to_increments(case.logs.imu, gap_limit(case.logs.imu.time))
    spent = []
    for _ in range(REPEATS):
        estimator = FILTERS[recipe.estimator](case.start, case.model, case.sensors, case.settings)
        begin = process_time()
        estimator.feed(increments)
        spent.append(process_time() - begin)
    return 1e6 * min(spent) / len(increments)


def figures(case: Study, campaign: Campaign) -> dict[str, Any]:
    """What the runs say."""
    runs = campaign.runs
    since = runs[0].time - runs[0].time[0]
    error, sd = (np.array([getattr(run, name) for run in runs]) for name in ("error", "sd"))
    judged = (since >= case.judged[0]) & (since <= case.judged[1])
    nees = {}
    for group in (group for group in GROUPS if group in runs[0].dof):
        values = np.array([run.nees[group] for run in runs])
        found = average(group, since[judged], values[:, judged], runs[0].dof[group])
        nees[group] = {
            "mean": float(np.mean(found.mean)),
            "bounds": average_bounds(float(len(runs) * runs[0].dof[group])),
            "share_inside": found.share_inside,
            "curve": _curve(np.mean(values, axis=0) / runs[0].dof[group]),
        }
    result = {
        "runs": len(runs),
        "failed": len(campaign.failed),
        "why": next(iter(campaign.failed.values()), ""),
        "rmse": _rmse(error[:, judged]),
        "nees": nees,
        "rejected": _count(runs, "rejected"),
        "resets": _count(runs, "reset"),
        "time": _curve(since),
        "horizontal": _curve(_rms(error[:, :, :2])),
        "horizontal_sd": _curve(_rms(sd[:, :, :2])),
        "heading_rms": _curve(np.degrees(_rms(error[:, :, 8:9]))),
    }
    if case.heading:
        result |= _heading(since, np.degrees(np.abs(error[:, :, 8])))
    if case.outage is not None:
        last = int(np.searchsorted(since, case.outage[1] - 1e-3)) - 1
        off, says = np.hypot(error[:, last, 0], error[:, last, 1]), _rms(sd[:, last : last + 1, :2])[0]
        values = np.array([run.nees["position"][last] for run in runs]) / 3.0
        result |= {"outage_rms": float(np.sqrt(np.mean(off**2))), "outage_sd": float(says)}
        result |= {"outage_worst": float(off.max()), "outage_nees": float(values.mean())}
    return result


def _heading(since: np.ndarray, off: np.ndarray) -> dict[str, Any]:
    """How the heading [deg] is found: `off` (runs, epochs)."""
    at = int(np.searchsorted(since, DRIVING + WITHIN - 1e-3))
    wrong = off >= FOUND
    last = np.where(wrong.any(axis=1), off.shape[1] - 1 - np.argmax(wrong[:, ::-1], axis=1), -1)
    ends = np.append(since, np.inf)[last + 1] - DRIVING
    return {
        "found": int(np.sum(off[:, at] < FOUND)),
        "median_s": _number(np.median(ends)),
        "slowest_s": _number(ends.max()),
        "heading_median": _curve(np.median(off, axis=0)),
        "heading_90": _curve(np.percentile(off, 90.0, axis=0)),
        "share_found": _curve(np.mean(off < FOUND, axis=0)),
    }


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _rms(values: np.ndarray) -> np.ndarray:
    """Over runs (first axis) of the length of vectors (last axis)."""
    return np.sqrt(np.mean(np.sum(values**2, axis=2), axis=0))


def _rmse(error: np.ndarray) -> dict[str, float]:
    """Over runs and epochs; `error` (runs, epochs, n) in SI units."""
    found = {}
    for name, first, last in (("position_m", 0, 3), ("velocity_mps", 3, 6), ("level_deg", 6, 8), ("heading_deg", 8, 9)):
        rms = np.sqrt(np.mean(np.sum(error[:, :, first:last] ** 2, axis=2)))
        found[name] = float(np.degrees(rms) if name.endswith("_deg") else rms)
    return found


def _count(runs: list[RunRecord], status: str) -> int:
    return int(sum(np.sum(run.innovations.status == status) for run in runs))


def _curve(values: np.ndarray) -> list[float]:
    """Evenly thinned, four digits."""
    step = max(1, -(-values.size // CURVE))
    return [float(f"{value:.4g}") for value in values[::step]]


def report(results: dict[str, dict[str, Any]], console: Console | None = None) -> None:
    """Print a table for each case."""
    console = console or Console(width=170)
    for name, of_case in results.items():
        table = Table(title=f"{name}: {CASES[name].title}")
        table.add_column()
        for column in COLUMNS:
            table.add_column(column)
        for estimator, found in of_case.items():
            if not found["runs"]:
                table.add_row(estimator, "0", found.get("refused", found.get("why", ""))[:60])
                continue
            rmse, nees = found["rmse"], found["nees"]
            table.add_row(
                estimator,
                f"{found['runs']}" + (f" ({found['failed']} failed)" if found["failed"] else ""),
                *(f"{value:.4g}" for value in rmse.values()),
                _cell(nees["whole state"]),
                _cell(nees["attitude"]),
                " ".join(f"{nees[g]['mean']:.3f}" for g in ("gyro_bias", "accel_bias") if g in nees),
                f"{found['rejected']}, {found['resets']}",
                f"{found['microseconds_per_sample']:.2f}",
            )
        console.print(table)
        for estimator, found in of_case.items():
            if "found" in found:
                first = f"  {estimator}: heading within {FOUND:g} deg {WITHIN:g} s after driving begins in"
                console.print(
                    f"{first} {found['found']} of {found['runs']} runs; for good after {found['median_s']} s (median), "
                    f"{found['slowest_s']} s (slowest)"
                )
            if "outage_rms" in found:
                console.print(
                    f"  {estimator}: end of the outage: {found['outage_rms']:.1f} m, says {found['outage_sd']:.1f} m, "
                    f"worst {found['outage_worst']:.1f} m, NEES/dof of the position {found['outage_nees']:.3f}"
                )


def _cell(nees: dict[str, Any]) -> str:
    low, high = nees["bounds"]
    return f"{nees['mean']:.3f} ({low:.2f}..{high:.2f}) {100.0 * nees['share_inside']:.0f} %"


def main(arguments: list[str] | None = None) -> None:
    """Run, print, save, draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--case", action="append", choices=list(CASES), help="may be given several times")
    parser.add_argument("--estimators", default=",".join(ESTIMATORS))
    parser.add_argument("--runs", type=int, help="of every case; 0 only prints what was saved")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--save", type=Path, help="JSON of all results")
    parser.add_argument("--figure", type=Path, help="folder for the figures")
    given = parser.parse_args(arguments)
    results: dict[str, dict[str, Any]] = {}
    if given.save and given.save.exists():
        results = json.loads(given.save.read_text(encoding="utf-8"))
    for name in given.case or CASES if given.runs != 0 else ():
        for estimator in given.estimators.split(","):
            found = study(name, estimator, CASES[name].runs if given.runs is None else given.runs, given.jobs)
            results.setdefault(name, {})[estimator] = found
            if given.save:
                given.save.write_text(json.dumps(results), encoding="utf-8")
        report({name: results[name]})
    if given.runs == 0:
        report(results)
    if given.figure:
        from benchmarks.filter_figures import draw

        draw(results, given.figure)


if __name__ == "__main__":
    main()
