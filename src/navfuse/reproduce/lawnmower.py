"""A lawnmower with raw GNSS, four wheels, a yaw gyro and a compass: the coursework of a lecture."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from navfuse.analysis.consistency import nis_summary
from navfuse.attitude.gyro_heading import GyroHeading, GyroHeadingSettings, gyro_heading
from navfuse.attitude.heading_logs import YawRateLog
from navfuse.core.earth import dcm_en, ecef_to_geodetic_batch
from navfuse.data.aiding_logs import HeadingLog, WheelSpeedLog
from navfuse.data.logs import GnssLog
from navfuse.data.raw_gnss import RawGnssLog
from navfuse.data.result import Result
from navfuse.data.trajectory import Trajectory
from navfuse.dead_reckoning.integration import DrModel, integrate
from navfuse.dead_reckoning.odometry import StartPoint, Steps, from_steps
from navfuse.dead_reckoning.wheels import Wheel, WheelGeometry, WheelMotion, wheel_motion
from navfuse.gnss.outliers import position_without_outliers
from navfuse.gnss.receiver_filter import ReceiverModel, ReceiverTrack, filter_receiver
from navfuse.gnss.single_point import single_point_position, single_point_velocity
from navfuse.report.study_figures import Curve, Panel, Picture
from navfuse.reproduce.drives import consistency_table, map_picture, numbers, plane
from navfuse.reproduce.multisensor_course import read_exercise
from navfuse.reproduce.study import Study, Table, Wishes

Array = np.ndarray

SD_SIGNAL, SD_IONOSPHERE, SD_TROPOSPHERE, SD_CODE, SD_RATE = 1.0, 2.0, 0.2, 2.0, 0.02
"""Signal in space; ionosphere and troposphere left at the zenith; code noise [m]; range rate [m/s]."""
GROSS_M = 20.0
LASTING_S = 3600.0
RECEIVER = ReceiverModel(acceleration_psd=0.05)
REAR = WheelGeometry(
    {
        "front_left": Wheel(0.3, -0.2, steered=True, used=False),
        "front_right": Wheel(0.3, 0.2, steered=True, used=False),
        "rear_left": Wheel(-0.2, -0.2),
        "rear_right": Wheel(-0.2, 0.2),
    }
)
SD_WHEEL = 0.05
HEADING = GyroHeadingSettings(
    gyro_noise=1e-4, gyro_bias_sd=np.radians(1.0), gyro_scale_sd=0.01, heading_sd=np.radians(4.0)
)
LAWN_M = (45.0, 18.0)


class Mower(NamedTuple):
    """Everything the study makes of the logs."""

    raw: RawGnssLog
    elevation: Array
    gross: list[tuple[float, str, float]]
    largest: Array
    fixes: GnssLog
    slow: Array
    white_expected: Array
    receiver: ReceiverTrack
    heading: GyroHeading
    wheels: WheelMotion
    track: Trajectory
    result: Result


def sigmas(elevation: Array) -> tuple[Array, Array]:
    """Lasting and white part of the standard deviation of a pseudo-range [m] at an elevation [rad].

    Mapping of the ionosphere and the troposphere: Groves (2013), eqs. 9.80 and 9.81.
    """
    c2 = np.cos(elevation) ** 2
    ionosphere = SD_IONOSPHERE / np.sqrt(1.0 - 0.899 * c2)
    troposphere = SD_TROPOSPHERE / np.sqrt(1.0 - c2 / 1.001**2)
    return np.sqrt(SD_SIGNAL**2 + ionosphere**2 + troposphere**2), np.full(elevation.shape, SD_CODE)


def study_of(wishes: Wishes) -> Mower:
    """Read the logs and run every stage.

    Raises
    ------
    InputError
        If a file is missing or not the table expected.
    """
    folder = ("ucl-comp0130", "cw1-A")
    raw = read_exercise(
        wishes.file(*folder, "Pseudo_ranges.csv"), wishes.file(*folder, "Pseudo_range_rates.csv"), SD_CODE, SD_RATE
    )
    d = numbers(wishes.file(*folder, "Dead_reckoning.csv"), 7)
    times, first = raw.epochs()
    here = single_point_position(raw.pseudorange[: first[1]], raw.sat_r_e[: first[1]], SD_CODE).vector_e
    line = raw.sat_r_e - here
    line /= np.linalg.norm(line, axis=1)[:, None]
    elevation = np.arcsin(line @ (here / np.linalg.norm(here)))
    lasting, white = sigmas(elevation)
    raw = replace(raw, sd_pseudorange=np.hypot(lasting, white))

    n = times.size
    r, v, largest = np.empty((n, 3)), np.empty((n, 3)), np.empty(n)
    white_P, slow_P, rate_P = (np.empty((n, 3, 3)) for _ in range(3))
    gross: list[tuple[float, str, float]] = []
    for k in range(n):
        at = slice(int(first[k]), int(first[k + 1]))
        largest[k] = np.abs(single_point_position(raw.pseudorange[at], raw.sat_r_e[at], SD_CODE).residuals).max()
        found, used, _ = position_without_outliers(raw.pseudorange[at], raw.sat_r_e[at], raw.sd_pseudorange[at])
        rows = np.arange(at.start, at.stop)
        r[k] = found.vector_e
        u = raw.sat_r_e[rows] - found.vector_e
        u /= np.linalg.norm(u, axis=1)[:, None]
        H = np.column_stack((-u, np.ones(rows.size)))
        for j in np.flatnonzero(~used):
            # Against the position of the others.
            reach = np.linalg.norm(raw.sat_r_e[rows[j]] - found.vector_e)
            good = np.flatnonzero(used)[0]
            other = np.linalg.norm(raw.sat_r_e[rows[good]] - found.vector_e)
            gross.append(
                (float(times[k]), str(raw.satellite[rows[j]]),
                 float(raw.pseudorange[rows[j]] - reach - raw.pseudorange[rows[good]] + other))
            )  # fmt: skip
        W = raw.sd_pseudorange[rows[used]] ** -2.0
        G = np.linalg.solve((H[used].T * W) @ H[used], H[used].T * W)[:3]
        white_P[k], slow_P[k] = (G * white[rows[used]] ** 2) @ G.T, (G * lasting[rows[used]] ** 2) @ G.T
        assert raw.range_rate is not None
        assert raw.sat_v_e is not None
        moving = single_point_velocity(
            raw.range_rate[rows[used]], raw.sat_r_e[rows[used]], raw.sat_v_e[rows[used]], r[k], SD_RATE
        )
        v[k], rate_P[k] = moving.vector_e, moving.covariance[:3, :3]
    lat, lon, height = ecef_to_geodetic_batch(r)
    C = np.reshape(dcm_en(lat[0], lon[0]), (3, 3))

    def spread(P: Array) -> Array:
        return np.sqrt(np.einsum("ji,kjl,li->ki", C, P, C))

    fixes = GnssLog(times, lat, lon, height, spread(white_P), v @ C, spread(rate_P), source="single epochs")
    slow = spread(slow_P).mean(axis=0)

    time = d[:, 0]
    wheels = wheel_motion(WheelSpeedLog(time, tuple(REAR.wheels), d[:, 1:5]), REAR, sd_speed=SD_WHEEL)
    heading = gyro_heading(
        YawRateLog(time, d[:, 5], averaged=True), HeadingLog(time, np.radians(d[:, 6]) % (2.0 * np.pi)), HEADING
    )
    psi = np.unwrap(heading.forward.heading)
    steps = Steps(time, wheels.speed[1:] * np.diff(time), np.diff(psi), source="wheels and gyro-magnetometer heading")
    start = StartPoint(float(lat[0]), float(lon[0]), float(height[0]), float(psi[0]))
    track = from_steps(steps, start, REAR.lever)
    model = DrModel(
        velocity_psd=0.005, vertical_psd=1e-3, speed_noise=SD_WHEEL,
        heading_noise=float(heading.forward.sd_heading[-1]),
        fix_error_sd=slow, fix_error_tau=LASTING_S, gate_probability=0.9999,
    )  # fmt: skip
    result = integrate(track, fixes, model)
    receiver = filter_receiver(raw, RECEIVER, smooth=True)
    return Mower(
        raw, elevation, gross, largest, fixes, slow, fixes.sd_position, receiver, heading, wheels, track, result
    )


def run(wishes: Wishes) -> Study:
    """The study: outliers listed, heading, wheels, and the integrated track."""
    mower = study_of(wishes)
    result = mower.result
    assert result.smoothed is not None
    origin = (float(mower.fixes.lat[0]), float(mower.fixes.lon[0]), float(mower.fixes.height[0]))
    rows = []
    tracks = {
        "single epochs without outliers": mower.fixes, "receiver filter, smoothed": mower.receiver.to_gnss_log(),
        "dead reckoning": mower.track, "integrated, forward": result.forward, "integrated, smoothed": result.smoothed,
    }  # fmt: skip
    extents = {}
    for name, track in tracks.items():
        east, north = plane(track, *origin)
        extents[name] = (float(np.ptp(north)), float(np.ptp(east)), float(np.ptp(track.height)))
        rows.append((name, *(f"{value:.1f}" for value in extents[name])))
    stretches = _stretches(mower.gross)
    end = np.hypot(
        *(a[-1] - b[-1] for a, b in zip(plane(mower.track, *origin), plane(result.smoothed, *origin), strict=True))
    )
    known = nis_summary(result.innovations)
    known |= nis_summary(mower.heading.innovations)
    sd = np.asarray(result.smoothed.sd_position)[len(result.smoothed) // 2]
    tables = (
        Table(
            "Gross errors of pseudo-ranges",
            ("satellite", "from s", "to s", "epochs", "mean error m"),
            tuple(stretches),
            f"{len(mower.gross)} pseudo-ranges in all. In plain least squares {int((mower.largest > GROSS_M).sum())} "
            f"epochs have a residual above {GROSS_M:g} m; these are the same: "
            f"{set(np.flatnonzero(mower.largest > GROSS_M) * 0.5) == {t for t, *_ in mower.gross}}. The receiver "
            f"filter rejects {int((~mower.receiver.used).sum())} pseudo-ranges and "
            f"{int((~mower.receiver.used_rate).sum())} range rates.",
        ),
        Table("Extent of the tracks", ("track", "north m", "east m", "height m"), tuple(rows)),
        consistency_table(
            known, "Magnetic headings are given a sigma of 4 deg as described; they scatter by 2 deg only."
        ),
        Table(
            "What was found",
            ("quantity", "value"),
            (
                ("gyro bias deg/s", f"{np.degrees(mower.heading.forward.gyro_bias[-1]):.3f}"),
                ("sigma of the heading deg", f"{np.degrees(mower.heading.forward.sd_heading[-1]):.2f}"),
                ("dead reckoning off at the end m", f"{end:.2f}"),
                ("sigma of the smoothed position, north, east, down m", ", ".join(f"{value:.1f}" for value in sd)),
                ("part of it that lasts", ", ".join(f"{value:.1f}" for value in mower.slow)),
            ),
        ),
    )
    return Study(
        "lawnmower",
        "A lawnmower with raw GNSS, wheels, gyro and compass",
        "coursework 1 of the lecture Multisensor Integrated Navigation (UCL COMP0130)",
        tables,
        _pictures(mower, origin),
        NOTES,
        {
            "gross_errors": [{"time_s": t, "satellite": name, "error_m": error} for t, name, error in mower.gross],
            "extent_m": {name: list(values) for name, values in extents.items()},
            "nis": {name: one.mean_nis_per_dof for name, one in known.items()},
        },
    )


def _stretches(gross: list[tuple[float, str, float]]) -> list[tuple[str, ...]]:
    """Gross errors of one satellite in epochs that follow each other, as rows."""
    rows: list[tuple[str, ...]] = []
    for name in dict.fromkeys(satellite for _, satellite, _ in gross):
        t, error = np.array([(time, value) for time, satellite, value in gross if satellite == name]).T
        parts = np.split(np.arange(t.size), np.flatnonzero(np.diff(t) > 0.75) + 1)
        for part in parts:
            first, last = t[part[0]], t[part[-1]]
            rows.append((name, f"{first:.1f}", f"{last:.1f}", str(part.size), f"{error[part].mean():.1f}"))
    return rows


def _pictures(mower: Mower, origin: tuple[float, float, float]) -> dict[str, Picture]:
    result = mower.result
    assert result.smoothed is not None
    tracks = {
        "single epochs": (mower.fixes, "points"), "dead reckoning": (mower.track, "line"),
        "integrated, smoothed": (result.smoothed, "line"),
    }  # fmt: skip
    t = mower.fixes.time
    residuals = Panel("time [s]", "largest residual [m]", (Curve("plain least squares", t, mower.largest, "points"),))
    time = mower.heading.forward.time
    compass = mower.heading.innovations
    heading = (
        Panel(
            "time [s]",
            "heading [deg]",
            (
                Curve("gyro-magnetometer", time, np.degrees(np.unwrap(mower.heading.forward.heading))),
                Curve("gyro alone", time, np.degrees(np.unwrap(mower.heading.gyro_only)), "guide"),
            ),
        ),
        Panel(
            "time [s]",
            "innovation of the compass [deg]",
            (
                Curve("sigma", compass.time, np.degrees(compass.sd[:, 0]), "band"),
                Curve("innovation", compass.time, np.degrees(compass.z[:, 0]), "points"),
            ),
        ),
    )
    panels = []
    position = result.innovations.of("gnss_position")
    velocity = result.innovations.of("gnss_velocity")
    for found, unit, what in ((position, "m", "position"), (velocity, "m/s", "velocity")):
        for k, axis in enumerate(("north", "east")):
            curves = (
                Curve("sigma", found.time, found.sd[:, k], "band"),
                Curve("innovation", found.time, found.z[:, k], "points"),
            )
            panels.append(Panel("time [s]", f"{what} {axis} [{unit}]", curves))
    return {
        "map": map_picture("The lawn", tracks, origin),
        "outliers": Picture("Single epochs: the largest residual", (residuals,), row_in=2.6),
        "heading": Picture("Heading from gyro and compass", heading, row_in=2.3),
        "innovations": Picture("Innovations of the integration", tuple(panels), columns=2, row_in=2.2),
    }


NOTES = (
    "Errors of the signal in space and of the atmosphere stay with a satellite all the time. No filter averages them "
    "away. So a pseudo-range has a lasting and a white part, both by elevation: together they weight the least squares "
    "and test for outliers; carried through it, the white part is the sigma of a fix and the lasting part that of "
    "three slow errors of position, states of the integration.",
    "The integration takes single epochs, not the receiver filter, whose outputs are correlated in time.",
    "The sigma of the smoothed position is therefore nearly that of the lasting errors. Within the lawn the track is "
    "far smoother than that.",
    "Both rear wheels give the speed of the middle of their axle; the antenna is 0.2 m ahead of it and swings. The "
    "front wheels are not used.",
    "The NIS of position is above its bounds by a few per cent: single fixes scatter 3 to 5 % more than a code noise "
    "of 2 m makes them. It was left as described.",
)
