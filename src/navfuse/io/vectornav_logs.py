"""From decoded VectorNav messages to the logs that the rest of navfuse takes."""

from __future__ import annotations

import os
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from navfuse.core.earth import ecef_to_geodetic_batch
from navfuse.core.rotation import euler_from_quat_batch
from navfuse.data.aiding_logs import MagnetometerLog
from navfuse.data.logs import GnssLog, ImuLog
from navfuse.data.trajectory import Trajectory, wrapped
from navfuse.errors import InputError, NavfuseWarning
from navfuse.io.gnss_rows import GnssNames, GnssRows, gnss_log
from navfuse.io.imu_plausibility import check_imu_units
from navfuse.io.imu_table import body_from_file
from navfuse.io.tables import check_file
from navfuse.io.vectornav_ascii import EXTENSIONS as ASCII_EXTENSIONS
from navfuse.io.vectornav_ascii import parse_sentences
from navfuse.io.vectornav_binary import EXTENSIONS as BINARY_EXTENSIONS
from navfuse.io.vectornav_binary import holds_packet, parse_packets
from navfuse.io.vectornav_messages import Messages, VectorNavLog
from navfuse.io.vectornav_times import Clock, clock_of, epoch_of, finite_rows, numbers, row_names, timed_rows

Array = np.ndarray

FIX_NAMES = {0: "none", 1: "none", 2: "single", 3: "single", 4: "sbas", 7: "rtk-float", 8: "rtk-fixed"}
"""Fix of the receiver -> fix type. A fix of the time alone (1) is none."""
GAUSS = 1e-4
_RATES = (
    ("imu.uncomp_gyro_radps", "imu.uncomp_accel_mps2"),
    ("imu.gyro_radps", "imu.accel_mps2"),
    ("common.gyro_radps", "common.accel_mps2"),
)
_ATTITUDES = ("attitude.ypr_deg", "common.ypr_deg", "attitude.quaternion_xyzw", "common.quaternion_xyzw")
_MAGNETS = ("imu.mag_gauss", "imu.uncomp_mag_gauss")


@dataclass(frozen=True, slots=True, eq=False)
class AttitudeLog:
    """Attitude that a sensor made itself.

    Attributes
    ----------
    time : (n,) array [s]
        Strictly increasing.
    attitude : (n, 3) array [rad]
        Roll, pitch, heading of the sensor axes forward-right-down; 0 <= heading < 2 pi. The heading is against
        magnetic north unless the sensor was told the declination or found true north itself.
    source, notes : see :class:`~navfuse.data.logs.ImuLog`.
    """

    time: Array
    attitude: Array
    source: str = "attitude"
    notes: tuple[str, ...] = ()

    def columns(self) -> dict[str, Array]:
        """``time_s, roll_deg, pitch_deg, heading_deg``."""
        roll, pitch, heading = np.degrees(self.attitude).T
        return {"time_s": self.time, "roll_deg": roll, "pitch_deg": pitch, "heading_deg": wrapped(heading, 360.0)}


def read_vectornav(path: str | os.PathLike[str]) -> VectorNavLog:
    """Read a file of either protocol, by its content: a file with a sound packet anywhere is binary.

    See :func:`~navfuse.io.vectornav_ascii.read_vectornav_ascii` and
    :func:`~navfuse.io.vectornav_binary.read_vectornav_binary`, which give the same and want the extension of theirs.

    Raises
    ------
    InputError
        If the file cannot be read, or holds neither sentences nor packets.
    """
    file = check_file(path, tuple(dict.fromkeys(ASCII_EXTENSIONS + BINARY_EXTENSIONS)))
    data = file.read_bytes()
    log = (parse_packets if holds_packet(data) else parse_sentences)(data, str(file))
    for note in log.notes:
        warnings.warn(note, NavfuseWarning, stacklevel=2)
    return log


def vectornav_imu(
    log: VectorNavLog,
    *,
    rate_hz: float | None = None,
    clock: Clock = "auto",
    increments: bool = False,
    axes: str = "FRD",
    rotation: Sequence[Sequence[float]] | Array | None = None,
) -> ImuLog:
    """Angular rates and specific forces, or increments of both.

    Of the messages with the most rows, measurements without the sensor's own bias corrections are taken where they are
    there: its filter moves its estimates while another one estimates them too.

    Parameters
    ----------
    log : VectorNavLog
    rate_hz : float, optional
        Rate of the messages, for files without a time. Counts lost messages whose header was legible.
    clock : {"auto", "gps", "file", "startup"}
        GPS time [s] since the start of the week of the first message that has it; the file's own time beside each
        message; or seconds since the sensor was switched on. "auto": the first of "file", "gps", "startup" that is
        there, so that all logs of a file share one scale.
    increments : bool
        Read the integrals over each interval (delta theta, delta velocity).
    axes, rotation
        How the sensor is mounted: see :func:`navfuse.io.imu_table.read_imu`.

    Raises
    ------
    InputError
        If the file has no such measurements or no time for them.
    ConfigError
        For an unusable `rate_hz`, `clock`, `axes` or `rotation`.
    """
    matrix = body_from_file(axes, rotation)
    if increments:
        messages, gyro, accel = _increments(log)
        names = ["delta theta"] * 3 + ["delta velocity"] * 3
    else:
        messages, gyro, accel, names = _rates(log)
    time, keep, notes = timed_rows(log, messages, "time", clock, rate_hz)
    time, keep = finite_rows(log, messages, np.hstack((gyro, accel)), time, keep, notes, increments)
    gyro, accel = gyro[keep] @ matrix.T, accel[keep] @ matrix.T
    kind: Literal["rates", "increments"] = "increments" if increments else "rates"
    if not increments and names[0].startswith(("imu.gyro", "common.gyro")):
        notes.append(f"{log.source}: {messages.kind} holds measurements with the sensor's own bias corrections only")
    notes += check_imu_units(time, gyro, accel, kind, ["time", *names], log.source)
    return _warned(ImuLog(time, gyro, accel, kind, log.source, tuple(notes)))


def vectornav_magnetometer(
    log: VectorNavLog,
    *,
    rate_hz: float | None = None,
    clock: Clock = "auto",
    axes: str = "FRD",
    rotation: Sequence[Sequence[float]] | Array | None = None,
) -> MagnetometerLog:
    """Magnetic field, with the sensor's iron corrections where it gives both; see :func:`vectornav_imu`."""
    messages, name = _with(log, [(name,) for name in (*_MAGNETS, "common.mag_gauss_temp_degc_pressure_kpa")], "field")
    matrix = body_from_file(axes, rotation)
    time, keep, notes = timed_rows(log, messages, "time", clock, rate_hz)
    field = numbers(messages.values[name[0]])[:, :3] * GAUSS
    time, keep = finite_rows(log, messages, field, time, keep, notes)
    return _warned(MagnetometerLog(time, field[keep] @ matrix.T, log.source, tuple(notes)))


def vectornav_attitude(log: VectorNavLog, *, rate_hz: float | None = None, clock: Clock = "auto") -> AttitudeLog:
    """Attitude of the sensor axes, from yaw, pitch and roll or else the quaternion; see :func:`vectornav_imu`."""
    messages, _ = _with(log, [(name,) for name in _ATTITUDES], "attitude")
    time, keep, notes = timed_rows(log, messages, "time", clock, rate_hz)
    euler = _euler(messages)
    time, keep = finite_rows(log, messages, euler, time, keep, notes)
    return _warned(AttitudeLog(time, euler[keep], log.source, tuple(notes)))


def vectornav_gnss(log: VectorNavLog, *, receiver: Literal[1, 2] = 1, clock: Clock = "auto") -> GnssLog:
    """Fixes of a receiver of the sensor; each once, however often it was sent. See :func:`vectornav_imu`.

    Heights are those above the ellipsoid. With the clock "gps" a fix has the time of its measurement, else that of
    its message, which is later.
    """
    group = f"gnss{receiver}"
    wanted = [(f"{group}.position_deg_deg_m",), (f"{group}.position_e_m",)]
    messages, name = _with(log, wanted, f"position of receiver {receiver}")
    time, keep, notes = timed_rows(log, messages, group, clock, None)
    values = messages.values
    lat, lon, height = _geodetic(numbers(values[name[0]])[keep], name[0])

    def column(field: str, width: int) -> Array | None:
        found = values.get(f"{group}.{field}")
        return None if found is None else numbers(found)[keep].reshape(-1, width)

    sd_speed = column("sd_velocity_mps", 1)
    codes = values.get(f"{group}.fix")
    satellites = column("n_satellites", 1)
    rows = GnssRows(
        time=time,
        lat=lat,
        lon=lon,
        height=height,
        sd_position=_positive(column("sd_position_n_m", 3)),
        velocity_n=column("velocity_n_mps", 3),
        sd_velocity=None if sd_speed is None else _positive(np.repeat(sd_speed, 3, axis=1)),
        fix=None if codes is None else np.array([FIX_NAMES.get(int(c), "") for c in np.asarray(codes)[keep]]),
        n_satellites=None if satellites is None else satellites[:, 0],
    )
    tell = row_names(messages, keep)
    found = gnss_log(rows, GnssNames(lat="latitude", lon="longitude", height="altitude"), log.source, tell, notes)
    epoch = epoch_of(log) if clock_of(log, messages, group, clock) == "gps" else None
    return _warned(GnssLog(**{**_fields(found), "epoch": epoch}))


def vectornav_trajectory(log: VectorNavLog, *, rate_hz: float | None = None, clock: Clock = "auto") -> Trajectory:
    """The sensor's own solution: position, velocity and attitude; see :func:`vectornav_imu`.

    Raises
    ------
    InputError
        If the file has no position of the sensor's filter, or that filter never was at a place.
    """
    wanted = [("ins.position_deg_deg_m",), ("ins.position_e_m",), ("common.position_deg_deg_m",)]
    messages, name = _with(log, wanted, "position of the sensor's filter")
    time, keep, notes = timed_rows(log, messages, "time", clock, rate_hz)
    place = numbers(messages.values[name[0]])
    speeds = [messages.values[n] for n in ("ins.velocity_n_mps", "common.velocity_n_mps") if n in messages.values]
    velocity = numbers(speeds[0]) if speeds else None
    attitude = _euler(messages) if any(n in messages.values for n in _ATTITUDES) else None
    known = np.any(place[keep, :2] != 0.0, axis=1)
    for part in (place, velocity, attitude):
        known &= True if part is None else np.isfinite(part[keep]).all(axis=1)
    if np.count_nonzero(known) < 2:
        raise InputError(f"{log.source}: the sensor's filter has no position in it (all zero): it was not initialised")
    if not known.all():
        notes.append(f"{log.source}: {np.count_nonzero(~known)} rows without a position of the filter are left out")
    keep, time = keep[known], time[known]
    for note in notes:
        warnings.warn(note, NavfuseWarning, stacklevel=2)
    lat, lon, height = _geodetic(place[keep], name[0])
    velocity, attitude = (None if part is None else part[keep] for part in (velocity, attitude))
    return Trajectory(time, lat, lon, height, velocity, attitude, source=log.source)


def _rates(log: VectorNavLog) -> tuple[Messages, Array, Array, list[str]]:
    joint = "common.uncomp_accel_mps2_gyro_radps"
    messages, names = _with(log, [*_RATES, (joint,)], "angular rate and acceleration")
    if names[0] == joint:
        both = numbers(messages.values[joint])
        return messages, both[:, 3:], both[:, :3], [joint] * 6
    gyro, accel = (numbers(messages.values[name]) for name in names)
    return messages, gyro, accel, [names[0]] * 3 + [names[1]] * 3


def _increments(log: VectorNavLog) -> tuple[Messages, Array, Array]:
    joint = "common.delta_time_s_theta_deg_velocity_mps"
    wanted = [("imu.delta_time_s_theta_deg", "imu.delta_velocity_mps"), (joint,)]
    messages, names = _with(log, wanted, "increments (delta theta, delta velocity)")
    first = numbers(messages.values[names[0]])
    velocity = first[:, 4:] if names[0] == joint else numbers(messages.values[names[1]])
    return messages, np.radians(first[:, 1:4]), velocity


def _with(log: VectorNavLog, wanted: Sequence[tuple[str, ...]], what: str) -> tuple[Messages, tuple[str, ...]]:
    """The most numerous messages that have one of the sets of fields, and the first of these sets they have."""
    fitting = [
        (len(messages), -k, messages, names)
        for messages in log.messages.values()
        for k, names in enumerate(wanted)
        if all(name in messages.values for name in names)
    ]
    if not fitting:
        kinds = ", ".join(f"{kind} ({n})" for kind, n in log.counts().items())
        raise InputError(f"{log.source}: no message holds {what}; there are {kinds}")
    _, _, messages, names = max(fitting, key=lambda row: row[:2])
    return messages, names


def _euler(messages: Messages) -> Array:
    values = messages.values
    for name in ("attitude.ypr_deg", "common.ypr_deg"):
        if name in values:
            euler = np.radians(numbers(values[name])[:, ::-1])
            break
    else:
        name = next(n for n in ("attitude.quaternion_xyzw", "common.quaternion_xyzw") if n in values)
        # The sensor's quaternion takes north-east-down to the sensor axes, in its own convention for products: as a
        # Hamilton quaternion it is that from the sensor axes to north-east-down.
        q = numbers(values[name])[:, [3, 0, 1, 2]]
        length = np.linalg.norm(q, axis=1, keepdims=True)
        # A filter that was not initialised sends zeros.
        euler = euler_from_quat_batch(q / np.where((length > 0.5) & (length < 2.0), length, np.nan))
    euler[:, 2] = wrapped(euler[:, 2], 2.0 * np.pi)
    return euler


def _geodetic(place: Array, name: str) -> tuple[Array, Array, Array]:
    if name.endswith("position_e_m"):
        away = np.linalg.norm(place, axis=1) > 1e6
        lat, lon, height = ecef_to_geodetic_batch(np.where(away[:, None], place, [7e6, 0.0, 0.0]))
        return np.where(away, lat, np.nan), lon, height
    return np.radians(place[:, 0]), np.radians(place[:, 1]), place[:, 2]


def _positive(sd: Array | None) -> Array | None:
    return None if sd is None else np.where(sd > 0.0, sd, np.nan)


def _fields(log: GnssLog) -> dict[str, Any]:
    return {name: getattr(log, name) for name in log.__dataclass_fields__}


def _warned(log: Any) -> Any:
    for note in log.notes:
        warnings.warn(note, NavfuseWarning, stacklevel=3)
    return log
