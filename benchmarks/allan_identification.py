"""Are the identified noise terms right, and their standard deviations honest? Simulated records with known terms.

Each simulated log of six axes gives three records of each grade. Beside the likelihood of navfuse stands what is
usually done: least squares on the Allan variance with the variance of each point from its degrees of freedom, as if
neighbouring averaging times were independent.

    python -m benchmarks.allan_identification --present NBK --records 200
"""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from navfuse.analysis.allan import deviation, identify
from navfuse.analysis.allan.terms import FLOOR
from navfuse.data.logs import ImuLog
from navfuse.imu.error_model import ImuErrorModel
from navfuse.simulation import ImuSensorModel, measure_imu

RATE = 100.0
HOURS = 6.0
DPH = math.radians(1.0) / 3600.0
GRADES = {
    "mems": {"N": 0.2 * 60.0, "B": 5.0 / FLOOR, "K": 30.0 / 60.0},
    "tactical": {"N": 0.04 * 60.0, "B": 0.25 / FLOOR, "K": 1.44 / 60.0},
}
"""In deg/h and seconds: 0.2 deg/sqrt(h), floor 5 deg/h, 30 deg/h/sqrt(h); 0.04, 0.25, 1.44."""

BARS = {"N": 0.02, "B": 0.15, "K": 0.20}


def records(present: str, count: int, hours: float, seed: int):
    """Yield grade and record [deg/h], three of each grade from every simulated log."""
    size = round(hours * 3600.0 * RATE)
    still = ImuLog(np.arange(size) / RATE, np.zeros((size, 3)), np.zeros((size, 3)), "rates")
    mems, tactical = GRADES["mems"], GRADES["tactical"]
    fields: dict[str, float] = {}
    if "B" in present:
        fields |= {"gyro_bias_instability": mems["B"] * DPH, "accel_bias_instability": tactical["B"] * DPH}
    if "K" in present:
        fields |= {"gyro_rate_walk": mems["K"] * DPH, "accel_rate_walk": tactical["K"] * DPH}
    model = ImuSensorModel(ImuErrorModel(arw=mems["N"] * DPH, vrw=tactical["N"] * DPH), **fields)
    for k in range(-(-count // 3)):
        log, _ = measure_imu(still, model, np.random.default_rng(seed + k))
        for axis in range(min(3, count - 3 * k)):
            yield "mems", log.gyro[:, axis] / DPH
            yield "tactical", log.accel[:, axis] / DPH


def usual_way(values: np.ndarray) -> dict[str, tuple[float, float]]:
    """N, B and K by least squares on the Allan variance, with standard deviations that ignore correlation."""
    from scipy.optimize import nnls

    curve = deviation(values, RATE, "oadev", grid=10)
    variance = curve.deviation**2
    design = np.column_stack([1.0 / curve.tau, np.full(curve.tau.size, FLOOR**2), curve.tau / 3.0])
    weight = np.sqrt(curve.edf / 2.0) / variance
    size, _ = nnls(design * weight[:, None], np.ones(variance.size) * weight * variance)
    covariance = np.linalg.inv((design * weight[:, None]).T @ (design * weight[:, None]))
    root = np.sqrt(size)
    with np.errstate(divide="ignore"):
        sigma = np.sqrt(np.diag(covariance)) / (2.0 * root)
    return {name: (float(root[k]), float(sigma[k])) for k, name in enumerate("NBK")}


def run(present: str, count: int, hours: float, seed: int) -> list[dict[str, Any]]:
    """Identify each record."""
    found = []
    for grade, values in records(present, count, hours, seed):
        values = np.ascontiguousarray(values)
        result = identify(values, RATE)
        terms = {t.name: [t.present, t.value, t.sigma, t.limit] for t in result.terms}
        found.append({"grade": grade, "terms": terms, "misfit": result.misfit, "usual": usual_way(values)})
    return found


def report(found: list[dict[str, Any]], present: str) -> None:
    """Print one line for each grade and term."""
    for grade, truth in GRADES.items():
        rows = [row for row in found if row["grade"] == grade]
        print(f"{grade}: {len(rows)} records, {sum(row['misfit'] > 0.0 for row in rows)} without a fit")
        for name in "NBKQR":
            seen = np.array([row["terms"][name][0] for row in rows])
            if name not in present:
                print(f"  {name} absent, reported absent in {100.0 * np.mean(~seen):.1f} %")
                continue
            value = np.array([row["terms"][name][1] for row in rows], dtype=float) / truth[name]
            sigma = np.array([row["terms"][name][2] for row in rows], dtype=float) / truth[name]
            inside = np.abs(value - 1.0) < sigma
            usual = np.array([row["usual"][name] for row in rows]) / truth[name]
            usual_inside = np.abs(usual[:, 0] - 1.0) < usual[:, 1]
            print(
                f"  {name} found in {100.0 * seen.mean():.1f} %, median {np.nanmedian(value):.4f} of the truth, median "
                f"error {100.0 * np.nanmedian(np.abs(value - 1.0)):.2f} % (bar {100.0 * BARS[name]:.0f}), scatter "
                f"{100.0 * np.nanstd(value):.2f} %, stated {100.0 * np.nanmedian(sigma):.2f} %, covers "
                f"{100.0 * inside.mean():.1f} %; least squares on the curve: median error "
                f"{100.0 * np.median(np.abs(usual[:, 0] - 1.0)):.2f} %, covers {100.0 * usual_inside.mean():.1f} %"
            )


def main() -> None:
    """Simulate, identify, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--present", default="NBK", choices=["NBK", "NB", "NK", "N"])
    parser.add_argument("--records", type=int, default=200)
    parser.add_argument("--hours", type=float, default=HOURS)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--save", type=Path, help="JSON of all results")
    given = parser.parse_args()
    found = run(given.present, given.records, given.hours, given.seed)
    report(found, given.present)
    if given.save:
        given.save.write_text(json.dumps(found))


if __name__ == "__main__":
    main()
