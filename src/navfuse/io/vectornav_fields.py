"""What the messages of VectorNav sensors hold: names, types and units of every field.

Both protocols share one vocabulary, ``group.field_unit``: the groups are those of the binary protocol, the units those
of the sensor (degrees, gauss, nanoseconds); :mod:`navfuse.io.vectornav_logs` converts. Source: VectorNav interface
control documents of the VN-100, VN-200, VN-300 and VN-310, and the user manuals UM001, UM004 and UM005.

Attitude is of sensor axes x forward, y right, z down against north-east-down, yaw against magnetic north unless the
sensor knows the declination. Quaternions are stored vector first, scalar last.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Field(NamedTuple):
    """A field of a message.

    Attributes
    ----------
    name : str
        Without its group.
    type : str or list
        Little-endian type as numpy names it.
    count : int
        Values side by side.
    rows : list or None
        Of a field of variable length: type of a row. `type` is that of what stands before the rows; its member "count"
        tells how many follow.
    """

    name: str
    type: str | list[tuple[str, str]]
    count: int = 1
    rows: list[tuple[str, str]] | None = None


UTC = [
    ("year", "i1"), ("month", "u1"), ("day", "u1"), ("hour", "u1"), ("minute", "u1"), ("second", "u1"), ("ms", "<u2"),
]  # fmt: skip
"""UTC; the year counts from 2000."""
SATELLITE = [
    ("system", "u1"), ("number", "u1"), ("flags", "u1"), ("cno", "u1"), ("quality", "u1"), ("elevation_deg", "i1"),
    ("azimuth_deg", "<i2"),
]  # fmt: skip
RAW_MEASUREMENT = [
    ("system", "u1"), ("number", "u1"), ("band", "u1"), ("channel", "u1"), ("slot", "i1"), ("cno", "u1"),
    ("flags", "<u2"), ("pseudorange_m", "<f8"), ("carrier_cycles", "<f8"), ("doppler_hz", "<f4"),
]  # fmt: skip

_U1, _U2, _U4, _U8, _F4, _F8 = "u1", "<u2", "<u4", "<u8", "<f4", "<f8"

_COMMON = {
    0: Field("time_startup_ns", _U8),
    1: Field("time_gps_ns", _U8),
    2: Field("time_sync_in_ns", _U8),
    3: Field("ypr_deg", _F4, 3),
    4: Field("quaternion_xyzw", _F4, 4),
    5: Field("gyro_radps", _F4, 3),
    6: Field("position_deg_deg_m", _F8, 3),
    7: Field("velocity_n_mps", _F4, 3),
    8: Field("accel_mps2", _F4, 3),
    9: Field("uncomp_accel_mps2_gyro_radps", _F4, 6),
    10: Field("mag_gauss_temp_degc_pressure_kpa", _F4, 5),
    11: Field("delta_time_s_theta_deg_velocity_mps", _F4, 7),
    12: Field("ins_status", _U2),
    13: Field("sync_in_count", _U4),
    14: Field("time_gps_pps_ns", _U8),
}
_TIME = {
    0: Field("time_startup_ns", _U8),
    1: Field("time_gps_ns", _U8),
    2: Field("gps_tow_ns", _U8),
    3: Field("gps_week", _U2),
    4: Field("time_sync_in_ns", _U8),
    5: Field("time_gps_pps_ns", _U8),
    6: Field("utc", UTC),
    7: Field("sync_in_count", _U4),
    8: Field("sync_out_count", _U4),
    9: Field("status", _U1),
}
_IMU = {
    0: Field("status", _U2),
    1: Field("uncomp_mag_gauss", _F4, 3),
    2: Field("uncomp_accel_mps2", _F4, 3),
    3: Field("uncomp_gyro_radps", _F4, 3),
    4: Field("temp_degc", _F4),
    5: Field("pressure_kpa", _F4),
    6: Field("delta_time_s_theta_deg", _F4, 4),
    7: Field("delta_velocity_mps", _F4, 3),
    8: Field("mag_gauss", _F4, 3),
    9: Field("accel_mps2", _F4, 3),
    10: Field("gyro_radps", _F4, 3),
    11: Field("saturation", _U2),
}
_GNSS = {
    0: Field("utc", UTC),
    1: Field("tow_ns", _U8),
    2: Field("week", _U2),
    3: Field("n_satellites", _U1),
    4: Field("fix", _U1),
    5: Field("position_deg_deg_m", _F8, 3),
    6: Field("position_e_m", _F8, 3),
    7: Field("velocity_n_mps", _F4, 3),
    8: Field("velocity_e_mps", _F4, 3),
    9: Field("sd_position_n_m", _F4, 3),
    10: Field("sd_velocity_mps", _F4),
    11: Field("sd_time_s", _F4),
    12: Field("time_info", [("status", "u1"), ("leap_seconds", "i1")]),
    13: Field("dop", _F4, 7),
    14: Field("satellites", [("count", "u1"), ("reserved", "u1")], rows=SATELLITE),
    16: Field("raw", [("tow_s", "<f8"), ("week", "<u2"), ("count", "u1"), ("reserved", "u1")], rows=RAW_MEASUREMENT),
    17: Field("status", _U2),
    18: Field("height_msl_m", _F8),
}
_ATTITUDE = {
    0: Field("status", _U2),
    1: Field("ypr_deg", _F4, 3),
    2: Field("quaternion_xyzw", _F4, 4),
    3: Field("dcm", _F4, 9),
    4: Field("mag_n_gauss", _F4, 3),
    5: Field("accel_n_mps2", _F4, 3),
    6: Field("linear_accel_b_mps2", _F4, 3),
    7: Field("linear_accel_n_mps2", _F4, 3),
    8: Field("sd_ypr_deg", _F4, 3),
    12: Field("heave_m_mps_m", _F4, 3),
    13: Field("sd_attitude_deg", _F4),
}
_INS = {
    0: Field("status", _U2),
    1: Field("position_deg_deg_m", _F8, 3),
    2: Field("position_e_m", _F8, 3),
    3: Field("velocity_b_mps", _F4, 3),
    4: Field("velocity_n_mps", _F4, 3),
    5: Field("velocity_e_mps", _F4, 3),
    6: Field("mag_e_gauss", _F4, 3),
    7: Field("accel_e_mps2", _F4, 3),
    8: Field("linear_accel_e_mps2", _F4, 3),
    9: Field("sd_position_m", _F4),
    10: Field("sd_velocity_mps", _F4),
}

GROUPS = {0: ("common", _COMMON), 1: ("time", _TIME), 2: ("imu", _IMU), 3: ("gnss1", _GNSS), 4: ("attitude", _ATTITUDE),
          5: ("ins", _INS), 6: ("gnss2", _GNSS)}  # fmt: skip
"""Bit of the group byte -> its name, and bit of the group's mask -> field. Bit 7 of the byte and bit 15 of a mask say
that another byte, another mask follows: bits 8, 9, ... of the byte and 16, 17, ... of the mask."""

_YPR, _QTN = ("attitude.ypr_deg", 3), ("attitude.quaternion_xyzw", 4)
_MAG, _ACC, _GYR = ("imu.mag_gauss", 3), ("imu.accel_mps2", 3), ("imu.gyro_radps", 3)
_INS_TIME = (("time.gps_tow_s", 1), ("time.gps_week", 1), ("ins.status", 1))
_INS_SD = (("attitude.sd_attitude_deg", 1), ("ins.sd_position_m", 1), ("ins.sd_velocity_mps", 1))


def _gps(group: str, letter: str) -> tuple[tuple[str, int], ...]:
    where = "position_deg_deg_m" if letter == "n" else "position_e_m"
    names = (("tow_s", 1), ("week", 1), ("fix", 1), ("n_satellites", 1), (where, 3), (f"velocity_{letter}_mps", 3),
             (f"sd_position_{letter}_m", 3), ("sd_velocity_mps", 1), ("sd_time_s", 1))  # fmt: skip
    return tuple((f"{group}.{name}", count) for name, count in names)


SENTENCES: dict[str, tuple[tuple[str, int], ...]] = {
    "VNYPR": (_YPR,),
    "VNQTN": (_QTN,),
    "VNQTM": (_QTN, _MAG),
    "VNQTA": (_QTN, _ACC),
    "VNQTR": (_QTN, _GYR),
    "VNQMA": (_QTN, _MAG, _ACC),
    "VNQAR": (_QTN, _ACC, _GYR),
    "VNQMR": (_QTN, _MAG, _ACC, _GYR),
    "VNDCM": (("attitude.dcm", 9),),
    "VNMAG": (_MAG,),
    "VNACC": (_ACC,),
    "VNGYR": (_GYR,),
    "VNMAR": (_MAG, _ACC, _GYR),
    "VNYMR": (_YPR, _MAG, _ACC, _GYR),
    "VNYBA": (_YPR, ("attitude.linear_accel_b_mps2", 3), _GYR),
    "VNYIA": (_YPR, ("attitude.linear_accel_n_mps2", 3), _GYR),
    "VNIMU": (("imu.uncomp_mag_gauss", 3), ("imu.uncomp_accel_mps2", 3), ("imu.uncomp_gyro_radps", 3),
              ("imu.temp_degc", 1), ("imu.pressure_kpa", 1)),
    "VNGPS": _gps("gnss1", "n"),
    "VNGPE": _gps("gnss1", "e"),
    "VNG2S": _gps("gnss2", "n"),
    "VNG2E": _gps("gnss2", "e"),
    "VNINS": (*_INS_TIME, _YPR, ("ins.position_deg_deg_m", 3), ("ins.velocity_n_mps", 3), *_INS_SD),
    "VNINE": (*_INS_TIME, _YPR, ("ins.position_e_m", 3), ("ins.velocity_e_mps", 3), *_INS_SD),
    "VNISL": (_YPR, ("ins.position_deg_deg_m", 3), ("ins.velocity_n_mps", 3), _ACC, _GYR),
    "VNISE": (_YPR, ("ins.position_e_m", 3), ("ins.velocity_e_mps", 3), _ACC, _GYR),
    "VNDTV": (("imu.delta_time_s_theta_deg", 4), ("imu.delta_velocity_mps", 3)),
    "VNHVE": (("attitude.heave_m_mps_m", 3),),
}  # fmt: skip
"""Header of an asynchronous ASCII sentence -> its fields in order, with how many numbers each has."""

HEXADECIMAL = frozenset({"ins.status"})
"""Fields that sentences give in hexadecimal."""


def fixed_type(field: Field) -> np.dtype:
    """Type of a field of fixed length, or of what stands before the rows of one of variable length."""
    return np.dtype(field.type) if field.count == 1 else np.dtype((field.type, (field.count,)))
