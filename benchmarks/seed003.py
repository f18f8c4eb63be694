"""Two unscented filters of a student report against the same filters as a textbook would have them.

``python -m benchmarks.seed003 [RUNS]`` flies the scenario ``aircraft-1hz`` with another draw of every error for each
run, and prints root mean square errors from one minute after the start on; ``figure FILE`` draws one flight. The
textbook twins are those of ``tests/reference/seed003_twin.py``, tuned on two runs that are not among these. See
docs/seed-003.md.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter

import numpy as np
from rich.console import Console
from rich.table import Table

from navfuse.analysis.interpolation import ned_axes
from navfuse.analysis.nees import navigation_errors
from navfuse.core.earth import geodetic_to_ecef_batch
from navfuse.core.rotation import euler_from_quat, quat_from_euler_batch
from navfuse.filters.feedback import FeedbackFilter, tuning
from navfuse.filters.feedforward import feedforward_filter
from navfuse.filters.kinds import FILTERS
from navfuse.filters.navigation_filter import NavigationFilter
from navfuse.imu.gaps import gap_limit
from navfuse.imu.increments import to_increments
from navfuse.montecarlo.recipes import Case
from navfuse.montecarlo.scenario_recipe import ScenarioRecipe

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from reference.seed003_twin import TextbookFilter, Tuning, run

Array = np.ndarray

RUNS = 20
SETTLED_S = 60.0
SECOND = 1e-6


@dataclass(frozen=True)
class Flight:
    """Errors of one run at its fixes.

    Attributes
    ----------
    error, sd : (m, 9) arrays
        Position [m], velocity [m/s], attitude [rad], true minus estimate, and what the filter says of them.
    nees : (3,) array
        Mean over the fixes of position, velocity and attitude, each over its degrees of freedom.
    seconds : float
    """

    error: Array
    sd: Array
    nees: Array
    seconds: float


def judge(case: Case, time: Array, nav: Array, P: Array, seconds: float) -> Flight:
    """Errors of navigation states (m, 10) with covariances (m, 9, 9) from SETTLED_S on."""
    kept = (time >= case.start.time + SETTLED_S) & (time <= case.logs.motion.end)
    truth = case.logs.motion.at(time[kept])
    error, _ = navigation_errors(truth.r_e, truth.v_e, truth.q_eb, nav[kept], False)
    P = P[kept]
    nees = []
    for part in (slice(0, 3), slice(3, 6), slice(6, 9)):
        e = error[:, part]
        nees.append(np.mean(e * np.linalg.solve(P[:, part, part], e[..., None])[..., 0]))
    return Flight(error, np.sqrt(np.diagonal(P, axis1=1, axis2=2)), np.array(nees), seconds)


def fly(case: Case, build: Callable[..., NavigationFilter], names: tuple[str, ...]) -> Flight:
    """A filter of navfuse with some of the sensors."""
    increments = to_increments(case.logs.imu, gap_limit(case.logs.imu.time))
    increments = increments.piece(int(np.searchsorted(increments.time, case.start.time - SECOND)))
    sensors = [sensor for sensor in case.sensors if sensor.name in names]
    begin = perf_counter()
    filter_ = build(case.start, case.model, sensors, replace(case.settings, checkpoints=True, output_period=-1.0))
    filter_.feed(increments)
    seconds = perf_counter() - begin
    kept = filter_.record.checkpoints[1:]
    time = np.array([checkpoint.time for checkpoint in kept])
    return judge(
        case,
        time,
        np.array([checkpoint.parts[0] for checkpoint in kept]),
        np.array([checkpoint.P[:9, :9] for checkpoint in kept]),
        seconds,
    )


def textbook(case: Case, full_state: bool) -> Flight:
    """A textbook twin: twelve states with positions, or fifteen with positions and velocities."""
    nav, imu, gnss, model = case.start.nav, case.logs.imu, case.logs.gnss, case.model
    x = np.concatenate([nav[:3], euler_from_quat(tuple(nav[6:10])), nav[3:6]])
    sd = np.sqrt(np.diagonal(case.start.P))[[0, 1, 2, 6, 7, 8, 3, 4, 5]]
    plain, walk = tuning(model, case.sensors[0])
    if full_state:
        biases = (float(model.axes("accel_bias_sd")[0]), float(model.axes("gyro_bias_sd")[0]))
        filter_ = TextbookFilter(x, sd, Tuning(20.0 * model.arw, 5.0 * model.vrw, 0.0, 1e-6, 1e-9), biases)
    else:
        filter_ = TextbookFilter(x, sd, Tuning(plain.arw, plain.vrw, walk))
    fixes = {}
    assert gnss.velocity_n is not None
    assert gnss.sd_velocity is not None
    for k in range(gnss.time.size):
        z, s = np.array([gnss.lat[k], gnss.lon[k], gnss.height[k]]), gnss.sd_position[k]
        if full_state:
            z, s = np.concatenate([z, gnss.velocity_n[k]]), np.concatenate([s, gnss.sd_velocity[k]])
        fixes[round(float(gnss.time[k]), 6)] = z, s
    first = int(np.searchsorted(imu.time, case.start.time - SECOND))
    begin = perf_counter()
    X, C = run(filter_, imu.time[first:], imu.gyro[first:], imu.accel[first:], fixes)
    seconds = perf_counter() - begin
    q = quat_from_euler_batch(np.ascontiguousarray(X[:, 3:6]))
    states = np.column_stack([X[:, :3], X[:, 6:9], q])
    return judge(case, imu.time[first + 1 :], states, in_plain_errors(X, C), seconds)


def in_plain_errors(X: Array, C: Array) -> Array:
    """Covariances (m, 9, 9) of position, velocity and small rotations in n, of those of height and Euler angles."""
    J = np.zeros((X.shape[0], 9, C.shape[1]))
    pitch, heading = X[:, 4], X[:, 5]
    J[:, 0, 0] = J[:, 1, 1] = 1.0
    J[:, 2, 2] = -1.0
    J[:, range(3, 6), range(6, 9)] = 1.0
    J[:, 6, 3] = np.cos(pitch) * np.cos(heading)
    J[:, 7, 3] = np.cos(pitch) * np.sin(heading)
    J[:, 8, 3] = -np.sin(pitch)
    J[:, 6, 4] = -np.sin(heading)
    J[:, 7, 4] = np.cos(heading)
    J[:, 8, 5] = 1.0
    return J @ C @ np.swapaxes(J, 1, 2)


def fixes_themselves(case: Case) -> Flight:
    """The noise of the fixes."""
    gnss = case.logs.gnss
    r = geodetic_to_ecef_batch(gnss.lat, gnss.lon, gnss.height)
    inside = gnss.time <= case.logs.motion.end
    truth = case.logs.motion.at(gnss.time[inside])
    place = case.logs.motion.trajectory(gnss.time[inside])
    error = np.full((int(inside.sum()), 9), np.nan)
    error[:, :3] = np.einsum("mji,mj->mi", ned_axes(place.lat, place.lon), truth.r_e - r[inside])
    kept = gnss.time[inside] >= case.start.time + SETTLED_S
    sd = np.full_like(error, np.nan)
    sd[:, :3] = gnss.sd_position[inside]
    return Flight(error[kept], sd[kept], np.full(3, np.nan), 0.0)


POSITION, BOTH = ("gnss_position",), ("gnss_position", "gnss_velocity")


def feedback_with_velocity(start, model, sensors, settings) -> FeedbackFilter:
    """The filter of twelve states, with the velocities beside the positions."""
    return FeedbackFilter(start, model, sensors, settings, observed=BOTH)


FLIGHTS: dict[str, Callable[[Case], Flight]] = {
    "fixes": fixes_themselves,
    "ukf-feedback-12": lambda case: fly(case, FILTERS["ukf-feedback-12"], BOTH),
    "textbook, 12 states": lambda case: textbook(case, False),
    "ukf-feedforward-15": lambda case: fly(case, FILTERS["ukf-feedforward-15"], BOTH),
    "textbook, 15 states": lambda case: textbook(case, True),
    "ukf-feedforward-15, position only": lambda case: fly(case, feedforward_filter, POSITION),
    "ukf-feedback-12, velocity too": lambda case: fly(case, feedback_with_velocity, BOTH),
    "ekf, 21 states": lambda case: fly(case, FILTERS["ekf"], BOTH),
}


def measured(name: str, runs: int, recipe: Callable[[int], Case]) -> list[Flight]:
    """All runs of one filter."""
    return [FLIGHTS[name](recipe(seed)) for seed in range(runs)]


def rms(flights: list[Flight]) -> Array:
    """Root mean squares (9,) over runs and time."""
    return np.sqrt(np.mean(np.concatenate([flight.error for flight in flights]) ** 2, axis=0))


def row(name: str, flights: list[Flight]) -> list[str]:
    """A row of the table."""
    size = rms(flights)
    worst = max(float(np.max(np.abs(flight.error[:, :3] / flight.sd[:, :3]))) for flight in flights)
    nees = np.array([flight.nees for flight in flights])
    spread = nees.std(axis=0, ddof=1) / np.sqrt(len(flights)) if len(flights) > 1 else np.full(3, np.nan)
    cells = [name, *(f"{v:.2f}" for v in size[:3])]
    cells += [f"{np.linalg.norm(size[part]):.3f}" for part in (slice(0, 3), slice(3, 6))]
    cells += [f"{np.degrees(v):.3f}" for v in (np.hypot(size[6], size[7]), size[8])]
    cells += [f"{worst:.1f}", *(f"{m:.2f} +- {s:.2f}" for m, s in zip(nees.mean(axis=0), spread, strict=True))]
    return [*cells, f"{np.median([flight.seconds for flight in flights]):.1f}"]


def table(recipe: Callable[[int], Case], runs: int, names: tuple[str, ...], title: str) -> None:
    """Print the rows of some filters."""
    shown = Table(title=title)
    columns = ["", "N [m]", "E [m]", "D [m]", "3-D [m]", "velocity [m/s]", "level [deg]", "heading [deg]", "worst [sd]"]
    for column in [*columns, "NEES position", "velocity", "attitude", "s"]:
        shown.add_column(column)
    for name in names:
        shown.add_row(*(cells := row(name, measured(name, runs, recipe))))
        print(*cells, sep=", ", file=sys.stderr)
    Console(width=200).print(shown)


def without_biases(recipe: Callable[[int], Case]) -> Callable[[int], Case]:
    """The same flights with a sensor that has next to no constant errors, of which the filters know."""

    def changed(seed: int) -> Case:
        case = recipe(seed)
        truth, imu = case.logs.imu_errors, case.logs.imu
        gyro = (imu.gyro - truth.gyro_bias) / (1.0 + truth.gyro_scale)
        accel = (imu.accel - truth.accel_bias) / (1.0 + truth.accel_scale)
        few = case.model.replace(
            gyro_bias_sd=1e-9, accel_bias_sd=1e-6, accel_bias_walk=0.0, gyro_scale_sd=0.0, accel_scale_sd=0.0
        )
        logs = replace(case.logs, imu=replace(imu, gyro=gyro, accel=accel))
        return replace(case, logs=logs, model=few)

    return changed


def figure(recipe: Callable[[int], Case], file: Path) -> None:
    """Errors of one flight over time, with what the filters say of them."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    flown = {name: FLIGHTS[name](recipe(0)) for name in ("fixes", "ukf-feedback-12", "ukf-feedforward-15")}
    shown, axes = plt.subplots(3, 1, figsize=(9.0, 7.0), sharex=True, constrained_layout=True)
    for part, (axis, label) in enumerate(zip(axes, ("north", "east", "down"), strict=True)):
        for (name, flight), color in zip(flown.items(), ("0.8", "tab:orange", "tab:blue"), strict=True):
            time = SETTLED_S + np.arange(flight.error.shape[0])
            axis.plot(time, -flight.error[:, part], color=color, lw=0.5 if name == "fixes" else 1.0, label=name)
            if name != "fixes":
                for sign in (-3.0, 3.0):
                    axis.plot(time, sign * flight.sd[:, part], color=color, lw=1.0, ls="--")
        axis.set_ylabel(f"{label} [m]")
    axes[0].legend(ncols=3, loc="upper right")
    axes[-1].set_xlabel("time [s]")
    shown.suptitle("Position errors of one flight at 1 Hz; dashed: three standard deviations of the filter")
    shown.savefig(file, dpi=110)


def main() -> None:
    """Measure and print, or draw."""
    recipe = ScenarioRecipe("aircraft-1hz")
    if sys.argv[1:2] == ["figure"]:
        figure(recipe, Path(sys.argv[2]))
        return
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else RUNS
    table(recipe, runs, tuple(FLIGHTS), f"aircraft-1hz, {runs} runs of {recipe.duration:.0f} s")
    same = "ukf-feedback-12", "ukf-feedforward-15, position only", "ukf-feedback-12, velocity too", "ukf-feedforward-15"
    few = max(1, runs // 4)
    table(without_biases(recipe), few, same, f"{few} runs of the same without biases and scale factors")


if __name__ == "__main__":
    main()
