"""From decoded VectorNav messages to the logs that the rest of navfuse takes."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from navfuse.core.earth import ecef_to_geodetic_batch
from navfuse.core.rotation import euler_from_quat_batch
from navfuse.data.aiding_logs import MagnetometerLog
from navfuse.data.gps_epoch import GpsEpoch
from navfuse.data.logs import GnssLog, ImuLog
from navfuse.data.trajectory import Trajectory, wrapped
from navfuse.errors import ConfigError, InputError, NavfuseWarning
from navfuse.io.gnss_rows import GnssNames, GnssRows, gnss_log
from navfuse.io.gps_time import WEEK
from navfuse.io.imu_plausibility import check_imu_units
from navfuse.io.imu_table import body_from_file
from navfuse.io.repair import check_isolated, time_order
from navfuse.io.tables import check_file
from navfuse.io.vectornav_ascii import EXTENSIONS as ASCII_EXTENSIONS
from navfuse.io.vectornav_ascii import read_vectornav_ascii
from navfuse.io.vectornav_binary import EXTENSIONS as BINARY_EXTENSIONS
from navfuse.io.vectornav_binary import is_vectornav_binary, read_vectornav_binary
from navfuse.io.vectornav_messages import Messages, VectorNavLog

Array = np.ndarray
Clock = Literal["auto", "gps", "file", "startup"]

FIX_NAMES = {0: "none", 1: "none", 2: "single", 3: "single", 4: "sbas", 7: "rtk-float", 8: "rtk-fixed"}
"""Fix of the receiver -> fix type. A fix of the time alone (1) is none."""
GAUSS = 1e-4
_NS = 1e-9
_RATES = (
    ("imu.uncomp_gyro_radps", "imu.uncomp_accel_mps2"),
    ("imu.gyro_radps", "imu.accel_mps2"),
    ("common.gyro_radps", "common.accel_mps2"),
)
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
    """Read a file of either protocol: :func:`read_vectornav_ascii` or :func:`read_vectornav_binary`, by its content.

    Raises
    ------
    InputError
        If the file cannot be read, or holds neither sentences nor packets.
    """
    file = check_file(path, tuple(dict.fromkeys(ASCII_EXTENSIONS + BINARY_EXTENSIONS)))
    return read_vectornav_binary(file) if is_vectornav_binary(file) else read_vectornav_ascii(file)


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
    time, keep, notes = _rows(log, messages, "time", clock, rate_hz)
    time, keep = _finite(log, messages, np.hstack((gyro, accel)), time, keep, notes, increments)
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
    time, keep, notes = _rows(log, messages, "time", clock, rate_hz)
    field = np.asarray(messages.values[name[0]], dtype=float)[:, :3] * GAUSS
    time, keep = _finite(log, messages, field, time, keep, notes)
    return _warned(MagnetometerLog(time, field[keep] @ matrix.T, log.source, tuple(notes)))


def vectornav_attitude(log: VectorNavLog, *, rate_hz: float | None = None, clock: Clock = "auto") -> AttitudeLog:
    """Attitude of the sensor axes, from yaw, pitch and roll or else the quaternion; see :func:`vectornav_imu`."""
    wanted = [("attitude.ypr_deg",), ("common.ypr_deg",), ("attitude.quaternion_xyzw",), ("common.quaternion_xyzw",)]
    messages, _ = _with(log, wanted, "attitude")
    time, keep, notes = _rows(log, messages, "time", clock, rate_hz)
    euler = _euler(messages)
    time, keep = _finite(log, messages, euler, time, keep, notes)
    return _warned(AttitudeLog(time, euler[keep], log.source, tuple(notes)))


def vectornav_gnss(log: VectorNavLog, *, receiver: Literal[1, 2] = 1, clock: Clock = "auto") -> GnssLog:
    """Fixes of a receiver of the sensor; each once, however often it was sent. See :func:`vectornav_imu`.

    Heights are those above the ellipsoid. With the clock "gps" a fix has the time of its measurement, else that of
    its message, which is later.
    """
    group = f"gnss{receiver}"
    wanted = [(f"{group}.position_deg_deg_m",), (f"{group}.position_e_m",)]
    messages, name = _with(log, wanted, f"position of receiver {receiver}")
    time, keep, notes = _rows(log, messages, group, clock, None)
    values = messages.values
    lat, lon, height = _geodetic(np.asarray(values[name[0]], dtype=float)[keep], name[0])

    def column(field: str, width: int) -> Array | None:
        found = values.get(f"{group}.{field}")
        return None if found is None else np.asarray(found, dtype=float)[keep].reshape(-1, width)

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
    tell = _where(messages, keep)
    found = gnss_log(rows, GnssNames(lat="latitude", lon="longitude", height="altitude"), log.source, tell, notes)
    epoch = _epoch(log) if _clock(log, messages, group, clock) == "gps" else None
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
    time, keep, notes = _rows(log, messages, "time", clock, rate_hz)
    place = np.asarray(messages.values[name[0]], dtype=float)[keep]
    known = np.any(place[:, :2] != 0.0, axis=1)
    if np.count_nonzero(known) < 2:
        raise InputError(f"{log.source}: the sensor's filter has no position in it (all zero): it was not initialised")
    if not known.all():
        notes.append(f"{log.source}: {np.count_nonzero(~known)} rows without a position of the filter are left out")
    keep, time = keep[known], time[known]
    lat, lon, height = _geodetic(place[known], name[0])
    speeds = [messages.values[n] for n in ("ins.velocity_n_mps", "common.velocity_n_mps") if n in messages.values]
    attitude = _euler(messages)[keep] if any(n.endswith(("ypr_deg", "_xyzw")) for n in messages.values) else None
    for note in notes:
        warnings.warn(note, NavfuseWarning, stacklevel=2)
    velocity = np.asarray(speeds[0], dtype=float)[keep] if speeds else None
    return Trajectory(time, lat, lon, height, velocity, attitude, source=log.source)


def _rates(log: VectorNavLog) -> tuple[Messages, Array, Array, list[str]]:
    joint = "common.uncomp_accel_mps2_gyro_radps"
    messages, names = _with(log, [*_RATES, (joint,)], "angular rate and acceleration")
    if names[0] == joint:
        both = np.asarray(messages.values[joint], dtype=float)
        return messages, both[:, 3:], both[:, :3], [joint] * 6
    gyro, accel = (np.asarray(messages.values[name], dtype=float) for name in names)
    return messages, gyro, accel, [names[0]] * 3 + [names[1]] * 3


def _increments(log: VectorNavLog) -> tuple[Messages, Array, Array]:
    joint = "common.delta_time_s_theta_deg_velocity_mps"
    wanted = [("imu.delta_time_s_theta_deg", "imu.delta_velocity_mps"), (joint,)]
    messages, names = _with(log, wanted, "increments (delta theta, delta velocity)")
    first = np.asarray(messages.values[names[0]], dtype=float)
    velocity = first[:, 4:] if names[0] == joint else np.asarray(messages.values[names[1]], dtype=float)
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


def _rows(
    log: VectorNavLog, messages: Messages, group: str, clock: Clock, rate_hz: float | None
) -> tuple[Array, Array, list[str]]:
    """Increasing times [s] of messages, which rows they are, and what was left out.

    `group` is that of the fields with GPS time.
    """
    notes: list[str] = []
    chosen = _clock(log, messages, group, clock, rate_hz)
    if chosen == "rate":
        if rate_hz is None:
            raise InputError(
                f"{log.source}: {messages.kind} has no time, neither in the message nor in front of it; give its rate"
                " with rate_hz"
            )
        if not (np.isfinite(rate_hz) and rate_hz > 0.0):
            raise ConfigError(f"rate_hz = {rate_hz} has to be a positive number of messages per second")
        notes.append(
            f"{log.source}: the times of {messages.kind} are counted with the stated {rate_hz:g} Hz from 0; messages"
            " that left no trace shift all that follow"
        )
        return messages.index / rate_hz, np.arange(len(messages)), notes
    time = {
        "file": lambda: messages.stamp,
        "startup": lambda: _startup(messages),
        "gps": lambda: _gps(log, messages, group),
    }
    stamps = time[chosen]()
    keep = np.flatnonzero(np.isfinite(stamps))
    if keep.size < len(messages):
        notes.append(f"{log.source}: {len(messages) - keep.size} of {len(messages)} {messages.kind} had no time yet")
    if group != "time" and keep.size:
        # A receiver's fix is sent again with every packet until the next one.
        new = _first_sent(messages, group, stamps, keep)
        keep = keep[new]
    order = time_order(stamps[keep], "time", log.source, _where(messages, keep)) if keep.size else None
    if order is not None:
        keep = keep[order.order[order.first]]
        notes.append(f"{order.note}: sorted by time, the first row of each stamp kept")
    if keep.size < 2:
        raise InputError(
            f"{log.source}: {keep.size} of {len(messages)} {messages.kind} have a time; at least two are needed"
        )
    return stamps[keep], keep, notes


def _finite(
    log: VectorNavLog,
    messages: Messages,
    values: Array,
    time: Array,
    keep: Array,
    notes: list[str],
    whole: bool = False,
) -> tuple[Array, Array]:
    """Times and rows without those that are NaN or infinite; none may be if the log has to be `whole`."""
    bad = np.logical_not(np.all(np.isfinite(values[keep]), axis=1))
    if not bad.any():
        return time, keep
    tell = _where(messages, keep)
    if whole:
        raise InputError(
            f"{log.source}: {tell(int(np.argmax(bad)))} holds NaN or infinite increments, whose motion is lost; read"
            " the rates instead"
        )
    check_isolated(bad, log.source, tell, "NaN or infinite values")
    notes.append(f"{log.source}: {np.count_nonzero(bad)} rows with NaN or infinite values were left out")
    return time[~bad], keep[~bad]


def _clock(log: VectorNavLog, messages: Messages, group: str, clock: Clock, rate_hz: float | None = None) -> str:
    there = {
        "file": bool(np.isfinite(messages.stamp).any()),
        "gps": _gps_ns(messages, group) is not None,
        "startup": any(name.endswith("time_startup_ns") for name in messages.values),
    }
    if clock == "auto":
        return "rate" if rate_hz is not None else next((name for name, has in there.items() if has), "rate")
    if clock not in there:
        raise ConfigError(f"clock = {clock!r} has to be 'auto', {', '.join(map(repr, there))}")
    if not there[clock]:
        raise InputError(f"{log.source}: {messages.kind} has no time of the clock {clock!r}; leave it to 'auto'")
    return clock


def _startup(messages: Messages) -> Array:
    name = next(name for name in messages.values if name.endswith("time_startup_ns"))
    return np.asarray(messages.values[name]) * _NS


def _gps_ns(messages: Messages, group: str) -> tuple[Array, Array] | None:
    """GPS week and nanoseconds of the week, week 0 where it is not known; None if the messages have none."""
    values = messages.values
    for place, tow, week in ((group, "tow_ns", "week"), ("time", "gps_tow_ns", "gps_week")):
        names = f"{place}.{tow}", f"{place}.{week}"
        if all(name in values for name in names):
            found = np.asarray(values[names[1]]).astype(np.int64), np.asarray(values[names[0]]).astype(np.int64)
            if found[0].any():
                return found
    for name in ("time.time_gps_ns", "common.time_gps_ns"):
        if name in values:
            weeks, rest = np.divmod(np.asarray(values[name]).astype(np.int64), int(WEEK / _NS + 0.5))
            if weeks.any():
                return weeks, rest
    return None


def _gps(log: VectorNavLog, messages: Messages, group: str) -> Array:
    found = _gps_ns(messages, group)
    assert found is not None
    weeks, rest = found
    return np.where(weeks > 0, (weeks - _epoch(log).week) * WEEK + rest * _NS, np.nan)


def _epoch(log: VectorNavLog) -> GpsEpoch:
    """Start of the first GPS week that any message tells: one for all logs of a file."""
    weeks = [
        found[0][found[0] > 0].min()
        for messages in log.messages.values()
        for group in ("time", "gnss1", "gnss2")
        if (found := _gps_ns(messages, group)) is not None
    ]
    return GpsEpoch.of(int(min(weeks)), 0.0)


def _first_sent(messages: Messages, group: str, stamps: Array, keep: Array) -> Array:
    """Rows of `keep` whose fix was not in the row before."""
    tow = messages.values.get(f"{group}.tow_ns")
    same = stamps if tow is None else np.asarray(tow)
    return np.concatenate(([True], np.diff(same[keep].astype(float)) != 0.0))


def _euler(messages: Messages) -> Array:
    values = messages.values
    for name in ("attitude.ypr_deg", "common.ypr_deg"):
        if name in values:
            euler = np.radians(np.asarray(values[name], dtype=float)[:, ::-1])
            break
    else:
        name = next(n for n in ("attitude.quaternion_xyzw", "common.quaternion_xyzw") if n in values)
        # The sensor's quaternion takes north-east-down to the sensor axes, in its own convention for products: as a
        # Hamilton quaternion it is that from the sensor axes to north-east-down.
        q = np.asarray(values[name], dtype=float)[:, [3, 0, 1, 2]]
        euler = euler_from_quat_batch(q / np.linalg.norm(q, axis=1, keepdims=True))
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


def _where(messages: Messages, keep: Array) -> Callable[[int], str]:
    return lambda row: f"{messages.kind} number {int(messages.index[keep[row]]) + 1}"


def _fields(log: GnssLog) -> dict[str, Any]:
    return {name: getattr(log, name) for name in log.__dataclass_fields__}


def _warned(log: Any) -> Any:
    for note in log.notes:
        warnings.warn(note, NavfuseWarning, stacklevel=3)
    return log
