"""Cases of the filter study: what is simulated, how the filters are told their start, and what is judged.

Every case is a recipe of seeds, so that all estimators see the same sensors and the same start.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Any

import numpy as np

from navfuse.aiding import AidingSensor, GnssPosition, GnssVelocity
from navfuse.core.earth import geodetic_to_ecef
from navfuse.data.nav_state import boxplus_navigation
from navfuse.data.start import Start
from navfuse.montecarlo import Case, ScenarioRecipe
from navfuse.simulation.scenario import StartErrors
from navfuse.simulation.scenario_run import section_stream, told_start

Changes = tuple[tuple[str, str, Any], ...]

ESTIMATORS = ("ekf", "iekf", "ukf", "ckf")
DRIVING = 20.0
"""The car of the scenario ``city-car`` stands still before it [s]."""


@dataclass(frozen=True)
class Told:
    """A start that is told with other standard deviations than the scenario's.

    Attributes
    ----------
    position, level, heading : float [m], [deg], [deg]
        Standard deviations that the filter is told; a zero leaves those of :class:`StartErrors`.
    off : float or str [deg]
        Error of the heading: ``"drawn"`` from the normal distribution, ``"anywhere"`` on the compass with the same
        chance, or so much, to the left or to the right.
    """

    position: float = 0.0
    level: float = 0.3
    heading: float = 1.0
    off: float | str = "drawn"

    def start(self, case: Case, seed: int) -> Start:
        """The start of a seed."""
        motion, time = case.logs.motion, float(case.logs.imu.time[0])
        sd = StartErrors().sd_position if self.position == 0.0 else (self.position, self.position, 1.0)
        errors = StartErrors(sd_position=sd, sd_attitude=tuple(np.radians([self.level, self.level, self.heading])))
        told = told_start(motion, time, errors, seed)
        if self.off == "drawn":
            return told
        draws = section_stream(seed, "heading")
        off = draws.uniform(-180.0, 180.0) if self.off == "anywhere" else draws.choice([-1.0, 1.0]) * float(self.off)
        right = replace(errors, sd_attitude=(*errors.sd_attitude[:2], 0.0))
        nav = told_start(motion, time, right, seed).nav.copy()
        turn = np.zeros(9)
        turn[8] = -math.radians(off)
        boxplus_navigation(nav, turn, False)
        return replace(told, nav=nav)


class Ranges(AidingSensor):
    """Ranges to radio anchors, all at once or one after the other; `anchors_e` (m, d, 3)."""

    name = "ranges"

    def __init__(self, times, anchors_e, ranges, sd):
        self.times, self.anchors_e, self.ranges, self.sd = times, anchors_e, ranges, sd

    def value(self, k):
        return self.ranges[k]

    def predict(self, nav, k):
        return np.linalg.norm(nav.r_e - self.anchors_e[k], axis=1)

    def noise(self, k):
        return self.sd

    def jacobian(self, nav, k):
        away = nav.r_e - self.anchors_e[k]
        H = np.zeros((len(away), nav.layout.size))
        H[:, :3] = away / np.linalg.norm(away, axis=1)[:, None]
        H[:, :3] = H[:, :3] if nav.ecef else H[:, :3] @ nav.C_en
        return H


ANCHORS = ((-6.0, -8.0, 2.5), (34.0, -6.0, 3.0), (32.0, 26.0, 2.0), (-4.0, 24.0, 3.5))
"""East, north, up [m] of the first position of the mower."""
LEVER_ARM = np.array([0.8, -0.5, -1.4])
"""IMU to GNSS antenna of the car [m]."""
RANGE_RATE, RANGE_SD = 4.0, 0.1


def without_fixes(case: Case, seed: int, begin: float, until: float) -> tuple[AidingSensor, ...]:
    """The fixes of a case, withheld for a while."""
    windows = ((case.start.time + begin, case.start.time + until),)
    lever = LEVER_ARM
    return (GnssPosition(case.logs.gnss, lever, windows), GnssVelocity(case.logs.gnss, lever, windows))


def with_ranges(case: Case, seed: int, polled: bool = False) -> tuple[AidingSensor, ...]:
    """Ranges in the place of the fixes."""
    first = case.logs.truth
    lat, lon, height = float(first.lat[0]), float(first.lon[0]), float(first.height[0])
    north, east = 1.0 / 6.37e6, 1.0 / (6.37e6 * math.cos(lat))
    corners = np.array([geodetic_to_ecef(lat + n * north, lon + e * east, height + u) for e, n, u in ANCHORS])
    motion = case.logs.motion
    times = np.arange(math.ceil((motion.end - motion.start) * RANGE_RATE)) / RANGE_RATE + motion.start
    times = times[(times > case.start.time) & (times <= case.logs.imu.time[-1])]
    order = np.arange(times.size)
    anchors = (
        corners[(order % len(corners))[:, None]] if polled else corners[order[:, None] * 0 + np.arange(len(corners))]
    )
    ranges = np.linalg.norm(anchors - motion.at(times).r_e[:, None], axis=2)
    ranges += section_stream(seed, "ranges").normal(0.0, RANGE_SD, ranges.shape)
    return (Ranges(times, anchors, ranges, RANGE_SD),)


def with_polled_ranges(case: Case, seed: int) -> tuple[AidingSensor, ...]:
    """The same, one after the other."""
    return with_ranges(case, seed, polled=True)


@dataclass(frozen=True)
class Study:
    """One case of the study.

    Attributes
    ----------
    title : str
    scenario : str
    changes : tuple
        As of :class:`~navfuse.montecarlo.ScenarioRecipe`.
    told : Told or None
        None: as the scenario tells it.
    sensors : callable or None
        Makes other sensors than the scenario's, from a case and a seed.
    judged : (float, float) [s]
        RMSE and NEES are those from the first to the second time since the first IMU sample.
    heading : bool
        Report how the heading is found.
    outage : (float, float) or None [s]
        Report the error at the end of it.
    runs : int
        So many are in the manual.
    """

    title: str
    scenario: str
    changes: Changes = ()
    told: Told | None = None
    sensors: Callable[[Case, int], tuple[AidingSensor, ...]] | None = None
    judged: tuple[float, float] = (10.0, math.inf)
    heading: bool = False
    outage: tuple[float, float] | None = None
    runs: int = 30


@dataclass(frozen=True)
class StudyRecipe:
    """The runs of a case with one estimator."""

    study: Study
    estimator: str

    def __call__(self, seed: int) -> Case:
        case = _scenario(self.study.scenario, self.study.changes)(seed)
        if self.study.told is not None:
            case = replace(case, start=self.study.told.start(case, seed))
        if self.study.sensors is not None:
            case = replace(case, sensors=self.study.sensors(case, seed))
        return replace(case, estimator=self.estimator)


@lru_cache(maxsize=2)
def _scenario(name: str, changes: Changes) -> ScenarioRecipe:
    return ScenarioRecipe(name, changes)


def _heading(told: Told, runs: int = 30, *changes: tuple[str, str, Any]) -> Study:
    off = told.off if isinstance(told.off, str) else f"{told.off:g} deg"
    title = f"heading told to {told.heading:g} deg, error {off}"
    drive = (("motion", "duration_s", 140.0), *changes)
    return Study(title, "city-car", drive, told, judged=(80.0, math.inf), heading=True, runs=runs)


_INDUSTRIAL = (
    ("imu", "grade", "industrial-mems"),
    ("imu", "gyro_noise_degps_per_sqrt_hz", 0.2 / 60.0),
    ("imu", "accel_noise_ug_per_sqrt_hz", 0.06 / 60.0 / 9.80665e-6),
    ("imu", "gyro_bias_sd_dph", math.hypot(100.0, 7.0)),
    ("imu", "accel_bias_sd_mg", math.hypot(2.0, 0.03)),
)
_ROUGH = (("start", "sd_attitude_deg", (0.5, 0.5, 0.5)),)


_MOWN = (
    ("", "duration_s", 120.0),
    ("imu", "gyro_bias_sd_degps", 0.03),
    ("imu", "accel_bias_sd_mg", 2.0),
    ("imu", "gyro_scale_sd_ppm", 500.0),
    ("imu", "accel_scale_sd_ppm", 500.0),
)
"""Two minutes of the mower, with a sensor better than its own, so that the ranges are what is difficult."""


_STILL = (("", "duration_s", 20.0), ("gnss", "position_correlated_sd_m", 0.0))


def _outage(seconds: float) -> Study:
    begin, until = 300.0, 300.0 + seconds
    drive = (("motion", "duration_s", 120.0 + until),)
    hidden = partial(without_fixes, begin=begin, until=until)
    title = f"no fixes for {seconds:g} s"
    return Study(title, "city-car", drive, None, hidden, (until, math.inf), outage=(begin, until), runs=12)


def _ranges(known: float, sensors: Callable[[Case, int], tuple[AidingSensor, ...]], what: str) -> Study:
    told = Told(position=known, heading=5.0)
    return Study(f"{what}, start known to {known:g} m", "lawnmower", _MOWN, told, sensors, runs=20)


CASES = {
    "everyday": Study("a car in town, start known to 1 deg", "city-car", runs=20),
    "heading-30": _heading(Told(heading=30.0)),
    "heading-60": _heading(Told(heading=60.0), 200),
    "heading-90": _heading(Told(heading=90.0)),
    "heading-off-150": _heading(Told(heading=60.0, off=150.0)),
    "heading-unknown": _heading(Told(heading=100.0, off="anywhere"), 100),
    "lever-arm": replace(
        _heading(Told(heading=60.0), 50, ("gnss", "lever_arm_m", (10.0, 0.0, -2.0))),
        title="heading told to 60 deg, antenna 10 m ahead",
    ),
    "aircraft-1hz": Study("an airliner at one sample a second", "aircraft-1hz", judged=(60.0, math.inf)),
    "car-10hz": Study("a car at ten samples a second", "city-car", (("imu", "rate_hz", 10.0),)),
    "outage-60": _outage(60.0),
    "outage-300": replace(_outage(300.0), runs=8),
    "consumer": Study("a consumer sensor in a car", "city-car", (("imu", "grade", "consumer"),), runs=20),
    "at-rest": Study("a gyro bias of 1 deg/s at rest", "lawnmower", _STILL, judged=(15.0, math.inf)),
    "dense-industrial": Study(
        "100 fixes a second, start known to 0.5 deg", "aircraft-300s", (*_ROUGH, *_INDUSTRIAL), runs=6
    ),
    "ranges": _ranges(5.0, with_ranges, "four ranges at once"),
    "ranges-polled": replace(_ranges(3.0, with_polled_ranges, "ranges one after the other"), runs=6),
}
"""By the names that ``--case`` takes."""
