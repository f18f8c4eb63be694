"""A first INS/GNSS in the plane (tutorial, NASA 2015): three algorithms on a model car, and on two real logs."""

from __future__ import annotations

import numpy as np

from navfuse.planar.position_filter import PlanarTrack
from navfuse.report.study_figures import Curve, Panel, Picture
from navfuse.reproduce.planar_drives import Drive, model_car
from navfuse.reproduce.planar_real import real_logs
from navfuse.reproduce.planar_runs import (
    DEG,
    GAIN,
    SPARSE,
    WINDOW_S,
    Yaws,
    dead_reckoned,
    held,
    rms,
    rms_length,
    track,
    yaw_error,
    yaws,
)
from navfuse.reproduce.study import Study, Table, Wishes

Array = np.ndarray

RUNS = 10
_WITHOUT = "as it comes"
_DECLINED = "declination added"
_CALIBRATED = "declination added, iron removed"


def run(wishes: Wishes) -> Study:
    """The study; real data too if their folder is given."""
    runs = wishes.number_of_runs(RUNS)
    real = None if wishes.data is None else real_logs(wishes)
    found_yaw: dict[str, list[tuple[float, float]]] = {_WITHOUT: [], _DECLINED: [], _CALIBRATED: []}
    found_position: dict[str, list[tuple[float, float]]] = {}
    claimed, pictures = [], {}
    for k in range(runs):
        drive = model_car(wishes.seed + k)
        for name, told in ((_WITHOUT, (False, False)), (_DECLINED, (True, False)), (_CALIBRATED, (True, True))):
            both = yaws(drive, north=told[0], iron=told[1])
            found_yaw[name].append((rms(yaw_error(both.first, drive)) * DEG, rms(yaw_error(both.second, drive)) * DEG))
        both = yaws(drive)
        full = track(drive, both.second)
        for name, (position, velocity) in _positions(drive, both, full).items():
            speed = np.nan if velocity is None else rms_length(velocity - drive.velocity)
            found_position.setdefault(name, []).append((rms_length(position - drive.position), speed))
        claimed.append(float(np.mean(((full.position - drive.position) / full.sd_position) ** 2)))
        if k == 0:
            pictures = _pictures(drive)
        wishes.tell("model car", (k + 1) / runs)
    tables = [_yaw_table(found_yaw, runs), _position_table(found_position, runs)]
    notes = [*NOTES, f"The mean square of position error over claimed sigma is {np.mean(claimed):.0f}, not 1: errors of"
             " GPS that last for minutes are told to the filter as if each fix had its own. It is sure of what it"
             " cannot see."]  # fmt: skip
    numbers = {
        "runs": runs,
        "yaw_rms_deg": {name: np.sqrt(np.mean(np.square(v), axis=0)).tolist() for name, v in found_yaw.items()},
        "position_rms_m": {name: rms(np.array(v)[:, 0]) for name, v in found_position.items()},
        "velocity_rms_mps": {
            name: rms(np.array(v)[:, 1]) for name, v in found_position.items() if np.isfinite(v[0][1])
        },
    }
    if real is not None:
        table, drawn, found, more = real
        tables.append(table)
        pictures |= drawn
        numbers["real_data"] = found
        notes += more
    return Study(
        "first-ins-gnss",
        "Your first INS/GNSS: a model car in the plane",
        "Smalling and Eure, A Short Tutorial on INS and GPS Integration (NASA/TM-2015-218803, 2015)",
        tuple(tables),
        pictures,
        tuple(notes),
        numbers,
    )


NOTES = (
    f"Algorithm 2 has K_p = {GAIN:g} 1/s, the least that the tutorial takes.",
    f"Dead reckoning begins anew every {WINDOW_S:g} s from the fix of that time, position and velocity; its error is"
    " taken over all times of all windows, so that Algorithms 1 and 2 differ in nothing but yaw. Both use yaw with"
    " declination and iron taken care of.",
    "The log of the tutorial is not public: the drive is the scenario 'rc-car'. The tutorial compares with the VN-200's"
    " own solution, here the truth is known.",
)


def _positions(drive: Drive, both: Yaws, full: PlanarTrack) -> dict[str, tuple[Array, Array | None]]:
    """Positions, and velocities where there are any, of everything that is compared."""
    found: dict[str, tuple[Array, Array | None]] = {
        "1: dead reckoned": (dead_reckoned(drive, both.first), None),
        "2: dead reckoned": (dead_reckoned(drive, both.second), None),
    }
    for rate, every in (("5 Hz", 1), ("1 Hz", SPARSE)):
        ours = full if every == 1 else track(drive, both.second, every)
        bare = track(drive, None, every)
        found[f"3: filter, GPS at {rate}"] = ours.position, ours.velocity
        found[f"GPS at {rate} alone, last fix held"] = held(drive, every), None
        found[f"GPS at {rate}, filter without accelerations"] = bare.position, bare.velocity
    return found


def _yaw_table(found: dict[str, list[tuple[float, float]]], runs: int) -> Table:
    rows = []
    for name, pairs in found.items():
        one, two = np.sqrt(np.mean(np.square(pairs), axis=0))
        better = sum(second < first for first, second in pairs)
        rows.append((name, f"{one:.2f}", f"{two:.2f}", f"{better} of {runs}"))
    return Table(
        f"Yaw on the simulated drive: rms over {runs} runs",
        ("magnetometer", "Algorithm 1 deg", "Algorithm 2 deg", "2 better in"),
        tuple(rows),
    )


def _position_table(found: dict[str, list[tuple[float, float]]], runs: int) -> Table:
    rows = []
    for name, pairs in found.items():
        position, velocity = np.array(pairs).T
        speed = f"{rms(velocity):.3f}" if np.isfinite(velocity).all() else "-"
        rows.append((name, f"{rms(position):.2f}", f"{position.min():.2f} .. {position.max():.2f}", speed))
    return Table(
        f"Horizontal position and velocity on the simulated drive: rms over {runs} runs",
        ("algorithm", "position m", "single runs m", "velocity m/s"),
        tuple(rows),
    )


def _pictures(drive: Drive) -> dict[str, Picture]:
    """The comparison plots of the tutorial, of one drive."""
    magnetic, both = yaws(drive, north=False), yaws(drive)
    full, sparse = track(drive, both.second), track(drive, both.second, SPARSE)
    t = drive.time

    def panel(title: str, low: float, high: float, unwrapped: bool) -> Panel:
        at = (t >= low) & (t <= high)
        curves = []
        for name, yaw in (("Algorithm 1", both.first), ("Algorithm 2", both.second), ("truth", drive.yaw)):
            shown = drive.yaw + yaw_error(yaw, drive) if unwrapped else np.angle(np.exp(1j * yaw))
            curves.append(Curve(name, t[at], shown[at] * DEG))
        return Panel("time [s]", "yaw [deg]", tuple(curves), title)

    offset = tuple(
        Curve(name, t, yaw_error(yaw, drive) * DEG)
        for name, yaw in (("Algorithm 1", magnetic.first), ("Algorithm 2", magnetic.second))
    )
    guide = Curve("minus declination", t[[0, -1]], np.full(2, -drive.declination * DEG), "guide")
    return {
        "yaw": Picture("Yaw: wrapped, unwrapped, a closer look",
                       (panel("wrapped", t[0], t[-1], False), panel("unwrapped", t[0], t[-1], True),
                        panel("closer", 34.0, 40.0, True))),
        "declination": Picture("Yaw minus truth: a compass points to magnetic north",
                               (Panel("time [s]", "yaw error [deg]", (*offset, guide)),), row_in=2.8),
        "velocity": Picture("Velocity east and north", tuple(
            Panel("time [s]", f"{side} [m/s]", (
                Curve("GPS", drive.fix_time, drive.fix_velocity[:, k], "points"),
                Curve("filter", t, full.velocity[:, k])))
            for k, side in ((1, "east"), (0, "north")))),
        "position": Picture("Position east and north", tuple(
            Panel("time [s]", f"{side} [m]", (
                Curve("GPS", drive.fix_time, drive.fix_position[:, k], "points"),
                Curve("filter", t, full.position[:, k])))
            for k, side in ((1, "east"), (0, "north")))),
        "gaps": _gaps(drive, sparse, both),
    }  # fmt: skip


def _gaps(drive: Drive, sparse: PlanarTrack, both: Yaws) -> Picture:
    at = (drive.time >= 100.0) & (drive.time <= 110.0)
    fixes = np.arange(0, drive.fix_time.size, SPARSE)
    fixes = fixes[(drive.fix_time[fixes] >= 100.0) & (drive.fix_time[fixes] <= 110.0)]
    bare = track(drive, None, SPARSE)
    panels = []
    for k, side in ((1, "east"), (0, "north")):
        panels.append(
            Panel(
                "time [s]",
                f"{side} [m]",
                (
                    Curve("GPS at 1 Hz", drive.fix_time[fixes], drive.fix_position[fixes, k], "points"),
                    Curve("filter", drive.time[at], sparse.position[at, k]),
                    Curve("filter without accelerations", drive.time[at], bare.position[at, k]),
                    Curve("truth", drive.time[at], drive.position[at, k]),
                ),
            )
        )
    return Picture("Between fixes: GPS at 1 Hz", tuple(panels), row_in=2.6)
