"""Logs of other people as native tables: imu.parquet, gnss.parquet and truth.parquet in a folder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from navfuse.core.earth import dcm_en, ecef_to_geodetic_batch, geodetic_to_ecef, geodetic_to_ecef_batch
from navfuse.core.rotation import dcm_from_quat_batch, quat_from_dcm, quat_from_euler_batch
from navfuse.io.tables import write_table
from navfuse.simulation import Motion

Array = np.ndarray


def write_imu(folder: Path, time: Array, gyro: Array, accel: Array) -> None:
    """Rates [rad/s] and specific force [m/s^2] as a native table."""
    columns = {"time_s": time}
    columns |= {f"gyro_{axis}_radps": gyro[:, k] for k, axis in enumerate("xyz")}
    columns |= {f"accel_{axis}_mps2": accel[:, k] for k, axis in enumerate("xyz")}
    write_table(folder / "imu.parquet", columns)


def write_gnss(
    folder: Path, time: Array, place: Array, sd: Any, velocity_n: Array | None = None, sd_v: Any = 0
) -> None:
    """Fixes (n, 3) in degrees, degrees, metres as a native table; standard deviations per axis or per fix and axis."""
    sd = np.broadcast_to(np.asarray(sd, dtype=float), place.shape)
    columns = {"time_s": time, "lat_deg": place[:, 0], "lon_deg": place[:, 1], "height_m": place[:, 2]}
    columns |= {f"sd_{axis}_m": sd[:, k] for k, axis in enumerate(("north", "east", "down"))}
    if velocity_n is not None:
        sd_v = np.broadcast_to(np.asarray(sd_v, dtype=float), velocity_n.shape)
        columns |= {f"v{axis}_mps": velocity_n[:, k] for k, axis in enumerate("ned")}
        columns |= {f"sd_v{axis}_mps": sd_v[:, k] for k, axis in enumerate("ned")}
    write_table(folder / "gnss.parquet", columns)


def write_truth(folder: Path, time: Array, place: Array, velocity_n: Array, euler_deg: Array | None = None) -> None:
    """A truth in degrees, metres and m/s as a native table."""
    columns = {"time_s": time, "lat_deg": place[:, 0], "lon_deg": place[:, 1], "height_m": place[:, 2]}
    columns |= {f"v{axis}_mps": velocity_n[:, k] for k, axis in enumerate("ned")}
    if euler_deg is not None:
        columns |= {f"{name}_deg": euler_deg[:, k] for k, name in enumerate(("roll", "pitch", "heading"))}
    write_table(folder / "truth.parquet", columns)


def from_local(east_north_up: Array, origin_deg: tuple[float, float, float]) -> Array:
    """Degrees, degrees, metres (n, 3) of metres east, north, up of an origin."""
    lat, lon = np.radians(origin_deg[:2])
    s, c, sl, cl = np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon)
    axes = np.array([[-sl, cl, 0.0], [-s * cl, -s * sl, c], [c * cl, c * sl, s]])
    r = np.array(geodetic_to_ecef(lat, lon, origin_deg[2])) + east_north_up @ axes
    lat, lon, height = ecef_to_geodetic_batch(r)
    return np.column_stack([np.degrees(lat), np.degrees(lon), height])


def navego(source: Path, folder: Path, sensor: str) -> None:
    """Simulated car of NaveGo with sensor ``imu1`` (ADIS16405) or ``imu2`` (ADIS16488)."""
    from scipy.io import loadmat

    def load(name):
        return loadmat(source / f"{name}.mat", squeeze_me=True, struct_as_record=False)[name]

    imu, gnss, ref = load(sensor), load("gnss"), load("ref")
    write_imu(folder, imu.t, imu.wb, imu.fb)
    place = np.column_stack([np.degrees(gnss.lat), np.degrees(gnss.lon), gnss.h])
    write_gnss(folder, gnss.t, place, (5.0, 5.0, 10.0), gnss.vel, gnss.stdv)
    place = np.column_stack([np.degrees(ref.lat), np.degrees(ref.lon), ref.h])
    write_truth(folder, ref.t, place, ref.vel, np.degrees(np.column_stack([ref.roll, ref.pitch, ref.yaw])))


def kitti(source: Path, folder: Path, seed: int = 1) -> None:
    """A KITTI drive; its fixes are the reference at 1 Hz with half a metre of noise, since raw ones are not published.

    Axes are forward, left, up. Some stamps step back by 50 ms and forward by 70: rows with a stamp before an earlier
    one are left out.
    """
    z = {name: np.asarray(values, dtype=float) for name, values in np.load(source).items()}
    time = z["t"]
    kept = np.concatenate([[True], time[1:] > np.maximum.accumulate(time)[:-1]])
    time, gyro, accel, enu, v_enu, euler = (
        z[name][kept] for name in ("t", "gyro", "accel", "pos_enu", "vel_enu", "roll_pitch_yaw")
    )
    write_imu(folder, time, gyro, accel)
    place = from_local(enu, (49.0, 8.4, 115.0))
    v_n = v_enu[:, [1, 0, 2]] * [1.0, 1.0, -1.0]
    roll, pitch, yaw = np.degrees(euler).T
    write_truth(folder, time, place, v_n, np.column_stack([roll, -pitch, (90.0 - yaw) % 360.0]))
    rng = np.random.default_rng(seed)
    at = np.unique(np.searchsorted(time, np.arange(time[0], time[-1], 1.0)))
    noisy = from_local(enu[at] + 0.5 * rng.standard_normal((at.size, 3)), (49.0, 8.4, 115.0))
    write_gnss(folder, time[at], noisy, 0.5)


def thor(source: Path, folder: Path) -> None:
    """Fixed-wing flight 75 of the University of Minnesota; its reference is the filter on board.

    The first 26 s are not valid. A fix counts where the receiver's time of week changes.
    """
    from scipy.io import loadmat

    (file,) = source.glob("*.mat")
    data = loadmat(file, squeeze_me=True, struct_as_record=False)["flight_data"]
    valid = data.time > 26.0
    column = {
        name: np.asarray(getattr(data, name), dtype=float)[valid] for name in data._fieldnames if _long(data, name)
    }
    time = column["time"]
    write_imu(
        folder, time, *(np.column_stack([column[n] for n in names]) for names in (("p", "q", "r"), ("ax", "ay", "az")))
    )
    new = np.flatnonzero(np.diff(column["GPS_TOW"], prepend=0.0) != 0.0)
    place = np.column_stack([column["lat"], column["lon"], column["alt"]])[new]
    v_n = np.column_stack([column["vn"], column["ve"], column["vd"]])
    write_gnss(folder, time[new], place, (3.0, 3.0, 6.0), v_n[new], (0.3, 0.3, 0.6))
    reference = np.column_stack([np.degrees(column["navlat"]), np.degrees(column["navlon"]), column["navalt"]])
    v_reference = np.column_stack([column["navvn"], column["navve"], column["navvd"]])
    euler = np.degrees(np.column_stack([column["phi"], column["theta"], column["psi"]]))
    write_truth(folder, time, reference, v_reference, euler)


def _long(data: Any, name: str) -> bool:
    return np.shape(getattr(data, name)) == np.shape(data.time)


def comma(source: Path, folder: Path) -> None:
    """A minute of comma2k19: phone sensors forward, right, down; u-blox fixes; truth without attitude.

    The fixes carry speed and course, so that the velocity down is unknown; they are given without velocity.
    """
    log = source / "processed_log"

    def load(*parts):
        return np.load(log.joinpath(*parts, "t")), np.load(log.joinpath(*parts, "value"))

    (time, gyro), (_, accel) = load("IMU", "gyro"), load("IMU", "accelerometer")
    stamp, fix = load("GNSS", "live_gnss_ublox")
    zero = 46408.0
    write_imu(folder, time - zero, gyro, accel)
    write_gnss(folder, stamp - zero, fix[:, [0, 1, 4]], (2.0, 2.0, 4.0))
    pose = source / "global_pose"
    r, v = np.load(pose / "frame_positions"), np.load(pose / "frame_velocities")
    lat, lon, height = ecef_to_geodetic_batch(r)
    s, c, sl, cl = np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon)
    v_n = np.column_stack(
        [
            -s * cl * v[:, 0] - s * sl * v[:, 1] + c * v[:, 2],
            -sl * v[:, 0] + cl * v[:, 1],
            -c * cl * v[:, 0] - c * sl * v[:, 1] - s * v[:, 2],
        ]
    )
    write_truth(
        folder, np.load(pose / "frame_times") - zero, np.column_stack([np.degrees(lat), np.degrees(lon), height]), v_n
    )


def groves(source: Path, number: int) -> Motion:
    """The motion of one of Groves's profiles: time, latitude, longitude [deg], height, velocity, attitude [deg]."""
    rows = np.loadtxt(source / f"Profile_{number}.csv", delimiter=",")[::10]
    lat, lon = np.radians(rows[:, 1]), np.radians(rows[:, 2])
    q_nb = quat_from_euler_batch(np.radians(rows[:, 7:10]))
    q_eb = np.empty_like(q_nb)
    for k in range(lat.size):
        C_eb = np.array(dcm_en(lat[k], lon[k])).reshape(3, 3) @ dcm_from_quat_batch(q_nb[k : k + 1])[0]
        q_eb[k] = quat_from_dcm(tuple(C_eb.ravel()))
    return Motion.from_knots(rows[:, 0], geodetic_to_ecef_batch(lat, lon, rows[:, 3]), q_eb)
