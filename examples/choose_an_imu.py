"""How far do three grades of inertial sensor drift in a tunnel? The table and the figure of the tutorial.

Run the three campaigns first::

    navfuse montecarlo tunnel --grade consumer --runs 40 --smooth -o mc-consumer
    navfuse montecarlo tunnel --grade industrial-mems --runs 40 --smooth -o mc-industrial-mems
    navfuse montecarlo tunnel --grade tactical --runs 40 --smooth -o mc-tactical

then this, in the same folder.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("agg")
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

GRADES = {"consumer": "C3", "industrial-mems": "C1", "tactical": "C0"}
LAST_WITHOUT_FIX_S = 239.0
TUNNEL_S = (180.0, 240.0)


def horizontal(runs: pd.DataFrame, prefix: str = "") -> pd.Series:
    """Horizontal error [m] of every row."""
    return np.hypot(runs[f"{prefix}err_north_m"], runs[f"{prefix}err_east_m"])


def rms(values: pd.Series) -> float:
    return float(np.sqrt(np.mean(values**2)))


def figures_of(folder: Path, grade: str) -> dict[str, float]:
    """Errors at the end of the tunnel, and the worst of the smoother inside it."""
    runs = pd.read_parquet(folder / f"mc-{grade}" / "runs.parquet")
    end = runs[np.isclose(runs.time_s, LAST_WITHOUT_FIX_S)]
    inside = runs[(runs.time_s >= TUNNEL_S[0]) & (runs.time_s < TUNNEL_S[1])]
    worst = horizontal(inside, "smoothed_").groupby(inside.seed).max()
    return {
        "filter, rms [m]": rms(horizontal(end)),
        "filter says [m]": float(np.sqrt(np.mean(end.sd_north_m**2 + end.sd_east_m**2))),
        "filter, 95 % [m]": float(horizontal(end).quantile(0.95)),
        "smoother, worst, rms [m]": rms(worst),
        "heading, rms [deg]": rms(end.err_heading_deg),
    }


def draw(folder: Path, to: Path) -> None:
    """Error over time for every grade, filter and smoother."""
    figure, axes = plt.subplots(figsize=(7.5, 4.2), layout="constrained")
    for grade, colour in GRADES.items():
        runs = pd.read_parquet(folder / f"mc-{grade}" / "runs.parquet")
        runs = runs[(runs.time_s >= TUNNEL_S[0] - 10.0) & (runs.time_s <= TUNNEL_S[1] + 10.0)]
        for prefix, style, name in (("", "-", "filter"), ("smoothed_", "--", "smoother")):
            over_time = (horizontal(runs, prefix) ** 2).groupby(runs.time_s.round(3)).mean() ** 0.5
            axes.semilogy(over_time.index, over_time, style, color=colour, label=f"{grade}, {name}")
    axes.axvspan(*TUNNEL_S, color="0.9", zorder=0)
    axes.set_xlabel("time [s]; grey: no fixes")
    axes.set_ylabel("horizontal error, rms over the runs [m]")
    axes.grid(which="both", alpha=0.3)
    axes.legend(ncols=3, fontsize="small", loc="upper center", bbox_to_anchor=(0.5, 1.2))
    figure.savefig(to, dpi=110)
    plt.close(figure)


def main(folder: Path = Path()) -> None:
    table = pd.DataFrame({grade: figures_of(folder, grade) for grade in GRADES}).T
    print(table.round(2).to_string())
    draw(folder, folder / "choose-an-imu.png")


if __name__ == "__main__":
    main()
