"""Truth, inertial sensor and fixes of an aircraft side by side in one table of 19 columns without units in their names.

``time, true_lat, true_lon, true_alt, true_roll, true_pitch, true_heading, gyro_x, gyro_y, gyro_z, accel_x, accel_y,
accel_z, z_lat, z_lon, z_alt, z_VN, z_VE, z_VD``: seconds, degrees, metres, rad/s, m/s^2 and m/s; the altitudes are
heights above the ellipsoid, the sensor's axes those of the file. The readers of IMU logs, GNSS logs and trajectories
each take their part of it.

Since no name says a unit, the parts are held against each other: fixes against truth, positions against the velocities
of the fixes, gyros against the true attitude, accelerometers against gravity. What only a wrong unit explains is
refused. Nothing is repaired: the table was made by a program, and a flaw in it is a flaw of that program. Only the fix
of a row may be missing, whole.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from navfuse.errors import InputError
from navfuse.io.columns import Field, Match, match_columns, require
from navfuse.io.gnss_plausibility import check_position_units
from navfuse.io.tables import CsvTable, ParquetTable

Array = np.ndarray
Columns = dict[str, Array]

TRUTH_PART = {
    "time": "time",
    "lat": "true_lat",
    "lon": "true_lon",
    "height": "true_alt",
    "roll": "true_roll",
    "pitch": "true_pitch",
    "heading": "true_heading",
}
IMU_PART = {"time": "time"} | {f"{sensor}_{axis}": f"{sensor}_{axis}" for sensor in ("gyro", "accel") for axis in "xyz"}
GNSS_PART = {
    "time": "time",
    "lat": "z_lat",
    "lon": "z_lon",
    "height": "z_alt",
    "vn": "z_VN",
    "ve": "z_VE",
    "vd": "z_VD",
}
"""Native name without unit -> column, for each part."""
COLUMNS = tuple(dict.fromkeys([*TRUTH_PART.values(), *IMU_PART.values(), *GNSS_PART.values()]))

_TELLING = frozenset(name.lower() for name in COLUMNS if name.startswith(("true_", "z_")))
_ENOUGH = 8
"""Telling names from which on a table is meant to be one of these."""
_ANGLES = ("lat", "lon", "roll", "pitch", "heading")
_DEG = np.pi / 180.0
_G = 9.80665
_ABSURD = 1e7
_RANGES = {"lat": (-90.0, 90.0), "lon": (-180.0, 360.0), "roll": (-180.0, 180.0), "pitch": (-90.0, 90.0)}
_RANGES |= {"heading": (-360.0, 360.0)}
_APART = 2000.0
_TURNING = 0.2 * _DEG
_ENOUGH_TURNS = 5
_WRONG_UNIT = 15.0


def is_nineteen_columns(names: Sequence[str], source: str) -> bool:
    """Whether a table is one of these, in any order and with other columns beside.

    Parameters
    ----------
    names : sequence of str
        Column names.
    source : str
        File, for the message.

    Raises
    ------
    InputError
        If the table can only be meant as one of these, but some of the names are missing or written otherwise.
    """
    telling = {name.lower() for name in names} & _TELLING
    if len(telling) < _ENOUGH:
        return False
    known = tuple(Field(name) for name in COLUMNS)
    require(match_columns(names, known, source), known, f"a table of truth, IMU and fixes in {len(COLUMNS)} columns")
    return True


def part_of(table: CsvTable | ParquetTable, part: Mapping[str, str]) -> Match:
    """Where the native fields of a part are, after the whole table has been checked.

    Parameters
    ----------
    table : CsvTable or ParquetTable
        For which :func:`is_nineteen_columns` is True.
    part : mapping
        :data:`TRUTH_PART`, :data:`IMU_PART` or :data:`GNSS_PART`.

    Raises
    ------
    InputError
        If a value is missing, a stamp does not increase, or a unit cannot be right; see :func:`check_nineteen_columns`.
    """
    check_nineteen_columns(table)
    factor = {base: _DEG if base in _ANGLES else 1.0 for base in part}
    return Match(dict(part), factor, tuple(name for name in table.names if name not in COLUMNS), table.source)


def check_nineteen_columns(table: CsvTable | ParquetTable) -> None:
    """Refuse a table whose values cannot be in the units of this layout.

    Raises
    ------
    InputError
        Naming the row of a value that is missing, out of range, or of a stamp that does not increase; or the columns
        whose unit is wrong, and what to multiply them with.
    """
    columns = {name: np.asarray(values, dtype=float) for name, values in table.read(COLUMNS).items()}
    fixed = _check_values(columns, table)
    if columns["time"].size < 2:
        raise InputError(f"{table.source}: the table has one row; at least two are needed")
    velocity = np.column_stack([columns[GNSS_PART[base]] for base in ("vn", "ve", "vd")])
    for part, rows in ((TRUTH_PART, slice(None)), (GNSS_PART, fixed)):
        names = tuple(part[base] for base in ("lat", "lon", "height"))
        lat, lon, height = (columns[name][rows] for name in names)
        if lat.size > 1:
            check_position_units(
                columns["time"][rows],
                lat * _DEG,
                lon * _DEG,
                height,
                velocity[rows] if fixed.any() else None,
                names,
                table.source,
                remedy=f"multiply {names[0]} and {names[1]} by 180/pi",
            )
    _check_distance(columns, fixed, table.source)
    _check_accel(columns, table.source)
    _check_turns(columns, table.source)


def _check_values(columns: Columns, table: CsvTable | ParquetTable) -> Array:
    """Every value there and in range, time increasing; returns which rows hold a fix."""
    fix = np.column_stack([np.isfinite(columns[name]) for name in GNSS_PART.values() if name != "time"])
    fixed: Array = np.all(fix, axis=1)
    ranges = {
        part[base]: limits for part in (TRUTH_PART, GNSS_PART) for base, limits in _RANGES.items() if base in part
    }
    for name in COLUMNS:
        needed = fix.any(axis=1) if name.startswith("z_") else np.ones(fixed.size, dtype=bool)
        flawed = needed & ~(np.abs(columns[name]) < _ABSURD)
        if flawed.any():
            whole = " A fix has six values or none." if name.startswith("z_") else ""
            raise InputError(
                f"{table.source}: {table.where(int(np.argmax(flawed)))}, column '{name}': the value is empty, NaN,"
                f" infinite or absurd, {np.count_nonzero(flawed)} rows have such; nothing is repaired in a table of"
                f" {len(COLUMNS)} columns, correct or remove the row.{whole}"
            )
        low, high = ranges.get(name, (-np.inf, np.inf))
        flawed = needed & ((columns[name] < low) | (columns[name] > high))
        if flawed.any():
            row = int(np.argmax(flawed))
            raise InputError(
                f"{table.source}: {table.where(row)}, column '{name}': {columns[name][row]:.9g} is outside"
                f" {low:g}..{high:g} deg"
            )
    time = columns["time"]
    back = np.flatnonzero(~(np.diff(time) > 0.0))
    if back.size:
        row = int(back[0]) + 1
        what = "repeats" if time[row] == time[row - 1] else "falls behind"
        raise InputError(
            f"{table.source}: {table.where(row)}, column 'time': {time[row]:.9g} s {what} the stamp before it,"
            f" {time[row - 1]:.9g} s; {back.size} rows do so. Sort the rows and remove what is there twice"
        )
    return fixed


def _check_distance(columns: Columns, fixed: Array, source: str) -> None:
    """Fixes and truth are the same flight: within two kilometres of each other, half of the time or more."""
    from navfuse.core.earth import geodetic_to_ecef_batch

    if not fixed.any():
        return
    lat, lon, height = (
        (columns[TRUTH_PART[base]][fixed], columns[GNSS_PART[base]][fixed]) for base in ("lat", "lon", "height")
    )
    above = float(np.median(np.abs(height[1] - height[0])))
    r_true, r_fix = (geodetic_to_ecef_batch(lat[k] * _DEG, lon[k] * _DEG, np.zeros(lat[k].size)) for k in range(2))
    across = float(np.median(np.linalg.norm(r_fix - r_true, axis=1)))
    for apart, names, advice in (
        (across, "'z_lat', 'z_lon' and 'true_lat', 'true_lon'", "are all of them degrees, and none exchanged?"),
        (above, "'z_alt' and 'true_alt'", "are both metres above the ellipsoid?"),
    ):
        if apart > _APART:
            raise InputError(
                f"{source}: columns {names} are {apart / 1000.0:.4g} km apart (median), which no receiver is; {advice}"
            )


def _check_accel(columns: Columns, source: str) -> None:
    force = float(np.median(np.linalg.norm([columns[f"accel_{axis}"] for axis in "xyz"], axis=0)))
    if 0.5 * _G <= force <= 2.0 * _G:
        return
    fault = f"{source}: columns 'accel_x', 'accel_y', 'accel_z': the median specific force is {force:.3g} m/s^2"
    if 0.5 <= force <= 2.0:
        raise InputError(f"{fault} where gravity alone makes 9.8; these look like values in g: multiply by 9.80665")
    raise InputError(
        f"{fault} where gravity alone makes 9.8; they have to be specific force in m/s^2, gravity not taken out"
    )


def _check_turns(columns: Columns, source: str) -> None:
    """Turn rates by the gyros against those of the true attitude, whatever the axes of the sensor are."""
    time, names = columns["time"], [TRUTH_PART[base] for base in ("roll", "pitch", "heading")]
    angles = np.column_stack([columns[name] for name in names])
    ratio = _turn_ratio(time, angles * _DEG, columns)
    if 1.0 / _WRONG_UNIT < ratio < _WRONG_UNIT:
        return
    largest = float(np.abs(angles).max())
    gyros = f"{source}: columns 'gyro_x', 'gyro_y', 'gyro_z'"
    if largest <= 2.0 * np.pi and 1.0 / _WRONG_UNIT < _turn_ratio(time, angles, columns) < _WRONG_UNIT:
        raise InputError(
            f"{gyros} turn with the true attitude only if {', '.join(names)}, which do not exceed {largest:.3g}, are"
            " radians: multiply them by 180/pi (or, should they be degrees after all, the gyros by pi/180)"
        )
    if np.isnan(ratio):
        return
    fault = f"{gyros}: in the turns of the true attitude they are {ratio:.3g} times as fast as it turns"
    if ratio > 1.0:
        raise InputError(f"{fault}; these look like deg/s: multiply them by pi/180")
    raise InputError(f"{fault}; they have to be rates in rad/s, the true angles degrees")


def _turn_ratio(time: Array, attitude: Array, columns: Columns) -> float:
    """Median of the gyros' rate over that of an attitude [rad], where it turns; NaN if it hardly does.

    The rate against inertial space differs from that against north by no more than the Earth's and the craft's own
    motion make, 0.007 deg/s at 300 m/s.
    """
    from navfuse.core.rotation import quat_from_euler_batch

    step = np.diff(time)
    q = quat_from_euler_batch(np.ascontiguousarray(attitude))
    cosine = np.abs(np.sum(q[1:] * q[:-1], axis=1))
    rate = 2.0 * np.arccos(np.minimum(cosine, 1.0)) / step
    seen = np.linalg.norm([columns[f"gyro_{axis}"] for axis in "xyz"], axis=0)
    turning = (rate > _TURNING) & (step < 3.0 * np.median(step)) & (rate * step < 1.0)
    if np.count_nonzero(turning) < _ENOUGH_TURNS:
        return np.nan
    return float(np.median((0.5 * (seen[1:] + seen[:-1]) / rate)[turning]))
