"""IMU logs from native CSV and Parquet tables."""

from __future__ import annotations

import os
import warnings
from collections.abc import Sequence
from typing import Literal

import numpy as np

from navfuse.data.logs import ImuLog
from navfuse.errors import ConfigError, InputError, NavfuseWarning
from navfuse.io.columns import Field, Match, fields, match_columns, require
from navfuse.io.imu_plausibility import check_imu_units
from navfuse.io.nineteen_columns import IMU_PART, is_nineteen_columns, part_of
from navfuse.io.repair import check_isolated, count_rows, silent_rows, time_order
from navfuse.io.spikes import spikes
from navfuse.io.tables import Where, open_table
from navfuse.io.units import scaled

Array = np.ndarray

TIME = Field("time", "time", "s")
RATES = fields("angular rate", "radps", "gyro_x", "gyro_y", "gyro_z") + fields(
    "acceleration", "mps2", "accel_x", "accel_y", "accel_z"
)
INCREMENTS = fields("angle", "rad", "dtheta_x", "dtheta_y", "dtheta_z") + fields(
    "speed", "mps", "dvel_x", "dvel_y", "dvel_z"
)

_ABSURD = 1e6
_DIRECTIONS = {"F": (0, 1.0), "B": (0, -1.0), "R": (1, 1.0), "L": (1, -1.0), "D": (2, 1.0), "U": (2, -1.0)}


def read_imu(
    path: str | os.PathLike[str],
    *,
    axes: str = "FRD",
    rotation: Sequence[Sequence[float]] | Array | None = None,
    time_offset_s: float = 0.0,
) -> ImuLog:
    """Read an IMU log.

    The table has ``time_s`` and either rates (``gyro_{x,y,z}_radps``, ``accel_{x,y,z}_mps2``) or increments over the
    interval that ends at ``time_s`` (``dtheta_{x,y,z}_rad``, ``dvel_{x,y,z}_mps``); any unit of
    :mod:`navfuse.io.units` may stand in place of these. Of a table of :mod:`navfuse.io.nineteen_columns` its sensor is
    read.

    Rows with values that are NaN, infinite or beyond 1e6 (in SI units) are repaired if they are isolated (under 1 % of
    the log, at most five in succession): rates are left out; increments are interpolated, since leaving a row out
    would lose its motion. Rows out of order are sorted and repeated stamps removed if both are under 1 %; increments
    of equal stamp but different value are added up.

    Parameters
    ----------
    path : path-like
        A ``.csv`` or ``.parquet`` file.
    axes : str
        What the file's x, y and z axes point to in the vehicle: three letters of F/B (forward, backward), R/L (right,
        left), D/U (down, up), right-handed. "FLU" is x forward, y left, z up.
    rotation : (3, 3) array-like, optional
        Instead of `axes`: the matrix that takes vectors of the file to body forward-right-down.
    time_offset_s : float
        Added to the stamps [s].

    Returns
    -------
    ImuLog
        In body forward-right-down, SI units, time increasing strictly. `notes` holds the text of every warning.

    Raises
    ------
    InputError
        If the file cannot be used; the message names row or column and what to do. Values that cannot be in the unit
        their column claims (g for m/s^2, deg/s for rad/s, rates for increments) are refused too: see
        :mod:`navfuse.io.imu_plausibility`.
    ConfigError
        If `axes`, `rotation` or `time_offset_s` is not usable.

    Warns
    -----
    NavfuseWarning
        For every repair, every ignored column and everything that looks odd without being certainly wrong.
    """
    matrix = body_from_file(axes, rotation)
    if not np.isfinite(time_offset_s):
        raise ConfigError(f"time_offset_s = {time_offset_s} has to be a finite number of seconds")
    table = open_table(path)
    if is_nineteen_columns(table.names, table.source):
        match = part_of(table, IMU_PART)
    else:
        match = match_columns(table.names, (TIME, *RATES, *INCREMENTS), table.source)
    kind = _kind(match)
    wanted = RATES if kind == "rates" else INCREMENTS
    values = table.read([match.column[field.base] for field in (TIME, *wanted)])
    notes = [*table.notes, *match.note_unknown()]

    time = scaled(values.pop(match.column["time"]), match.factor["time"])
    gyro, accel = (_triad(values, match, group, matrix) for group in (wanted[:3], wanted[3:]))
    time, gyro, accel = _repair(time, gyro, accel, kind, match, table.where, notes)
    if time.size < 2:
        raise InputError(f"{table.source}: the log has {time.size} usable row; at least two are needed")
    silent = silent_rows(gyro, accel)
    if silent.any():
        first = int(np.argmax(silent))
        notes.append(
            f"{table.source}: {int(np.count_nonzero(silent))} of {silent.size} rows hold zeros only or repeat the "
            "row before to "
            f"the last digit, the first at {time[first]:.6g} s: the sensor was silent there; they are taken for missing"
        )
        time, gyro, accel = time[~silent], gyro[~silent], accel[~silent]
    notes += check_imu_units(
        time, gyro, accel, kind, [match.column[field.base] for field in (TIME, *wanted)], table.source
    )
    for note in notes:
        warnings.warn(note, NavfuseWarning, stacklevel=2)
    return ImuLog(time + time_offset_s, gyro, accel, kind, table.source, tuple(notes))


def body_from_file(axes: str = "FRD", rotation: Sequence[Sequence[float]] | Array | None = None) -> Array:
    """Matrix from the axes of a file to body forward-right-down.

    Parameters
    ----------
    axes, rotation
        As in :func:`read_imu`.

    Returns
    -------
    (3, 3) array
        Column j is the body direction that file axis j points to.

    Raises
    ------
    ConfigError
        If the axes are not three different directions in right-handed order, or the matrix is not a proper rotation to
        1e-6.
    """
    if rotation is not None:
        if axes.upper() != "FRD":
            raise ConfigError(f'axes = "{axes}" and rotation are both given; remove one of them')
        return _checked_rotation(rotation)
    letters = axes.upper()
    if len(letters) != 3 or any(letter not in _DIRECTIONS for letter in letters):
        raise ConfigError(
            f'axes = "{axes}" has to be three letters of F or B (forward, backward), R or L (right, left), D or U'
            ' (down, up): what x, y and z of the file point to, e.g. "FRD" or "FLU"'
        )
    matrix = np.zeros((3, 3))
    for column, letter in enumerate(letters):
        row, sign = _DIRECTIONS[letter]
        matrix[row, column] = sign
    if np.count_nonzero(matrix.any(axis=1)) < 3:
        raise ConfigError(f'axes = "{axes}" uses one direction twice; each of F/B, R/L and D/U has to be there once')
    if np.linalg.det(matrix) < 0.0:
        opposite = dict(zip("FBRLDU", "BFLRUD", strict=True))
        third = letters[:2] + opposite[letters[2]]
        raise ConfigError(
            f'axes = "{axes}" is left-handed; if x and y are right it is "{third}" (x cross y has to be z)'
        )
    return matrix


def _checked_rotation(rotation: Sequence[Sequence[float]] | Array) -> Array:
    try:
        matrix = np.array(rotation, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ConfigError(f"rotation has to be a 3 x 3 matrix of numbers: {error}") from error
    if matrix.shape != (3, 3) or not np.isfinite(matrix).all():
        raise ConfigError(f"rotation has to be a 3 x 3 matrix of finite numbers, its shape is {matrix.shape}")
    residual = float(np.abs(matrix @ matrix.T - np.eye(3)).max())
    if residual > 1e-6:
        raise ConfigError(
            f"rotation is not orthonormal: rotation times its transpose is off by {residual:.2g}; give it with 7 digits"
        )
    if np.linalg.det(matrix) < 0.0:
        raise ConfigError("rotation has determinant -1, it is a mirroring; one of its columns has the wrong sign")
    return matrix


def _kind(match: Match) -> Literal["rates", "increments"]:
    """Whether the table holds rates or increments."""
    rates, increments = (match.has(field.base for field in group) for group in (RATES, INCREMENTS))
    if rates and increments:
        raise InputError(f"{match.source}: the table holds rates and increments; keep one of the two")
    if not (rates or increments):
        begun = [sum(field.base in match.column for field in group) for group in (RATES, INCREMENTS)]
        likely = "increments" if begun[1] > begun[0] or (begun == [0, 0] and _speaks_of_increments(match)) else "rates"
        if begun[0] and begun[1]:
            raise InputError(
                f"{match.source}: an IMU table needs the six columns of rates"
                f" ({', '.join(field.name for field in RATES)}) or the six of increments"
                f" ({', '.join(field.name for field in INCREMENTS)}), this one mixes them:"
                f" {', '.join(match.column.values())}"
            )
        require(match, (TIME, *(INCREMENTS if likely == "increments" else RATES)), f"an IMU table of {likely}")
    require(match, (TIME,), "an IMU table")
    return "rates" if rates else "increments"


def _speaks_of_increments(match: Match) -> bool:
    return any(name.lower().startswith(("dtheta", "dvel", "dv_", "delta")) for name in match.unknown)


def _triad(values: dict[str, Array], match: Match, group: Sequence[Field], matrix: Array) -> Array:
    """Three columns in SI units and body axes, taken out of `values`: a long log need not be in memory twice."""
    triad = np.empty((values[match.column[group[0].base]].size, 3))
    turned = np.count_nonzero(matrix) > 3
    with np.errstate(over="ignore", invalid="ignore"):
        for axis, field in enumerate(group):
            row = axis if turned else int(np.flatnonzero(matrix[:, axis])[0])
            factor = match.factor[field.base] * (1.0 if turned else matrix[row, axis])
            np.multiply(values.pop(match.column[field.base]), factor, out=triad[:, row], dtype=np.float64)
        return triad @ matrix.T if turned else triad


def _repair(
    time: Array,
    gyro: Array,
    accel: Array,
    kind: Literal["rates", "increments"],
    match: Match,
    where: Where,
    notes: list[str],
) -> tuple[Array, Array, Array]:
    """Mend rows of values that no sensor gives, and the order of time; appends to `notes`."""
    rows = np.arange(time.size)
    done = "left out" if kind == "rates" else "interpolated"
    gaps = _bad_rows(time, gyro, accel, match.source, where)
    if gaps is not None:
        found = count_rows(int(np.count_nonzero(gaps)))
        first = where(int(np.argmax(gaps)))
        notes.append(f"{match.source}: {found} with NaN, infinite or absurd values were {done}, the first is {first}")
    blank = np.zeros(1, dtype=bool) if gaps is None else gaps
    wild = spikes(time, _without(gyro, blank), _without(accel, blank), kind)
    if wild.size:
        notes.append(
            f"{match.source}: single rows far out of those around them, as transmission errors leave them, were {done}:"
            f" {wild.size} of them, the first is {where(int(wild[0]))}"
        )
        gaps = np.zeros(time.size, dtype=bool) if gaps is None else gaps
        gaps[wild] = True
    if gaps is not None:
        rows = np.flatnonzero(~gaps) if kind == "rates" else _rows_between_stamps(time)
    stamps = time if gaps is None else _interpolate_stamps(time)[rows]
    order = time_order(stamps, match.column["time"], match.source, lambda row: where(int(rows[row])))
    if gaps is None and order is None:
        return time, gyro, accel
    data = np.hstack((gyro, accel))
    if gaps is not None:
        data[gaps] = np.where(np.abs(data[gaps]) < _ABSURD, data[gaps], np.nan)
        data[wild] = np.nan
        time, data = stamps, data[rows]
    if order is not None:
        time, data = time[order.order], data[order.order]
        if kind == "rates":
            remedy = "sorted by time, the first row of each stamp kept"
            data = data[order.first]
        else:
            remedy = "sorted by time, equal rows of one stamp kept once and different ones added up"
            data = _add_up(data, order.first)
        time = time[order.first]
        notes.append(f"{order.note}: {remedy}")
    if gaps is not None and kind == "increments":
        _interpolate_increments(time, data)
    return time, np.ascontiguousarray(data[:, :3]), np.ascontiguousarray(data[:, 3:])


def _bad_rows(time: Array, gyro: Array, accel: Array, source: str, where: Where) -> Array | None:
    """Rows with values that no sensor gives, None if there are none; refuses too many."""
    if np.isfinite(time).all() and all(x.min() > -_ABSURD and x.max() < _ABSURD for x in (gyro, accel)):
        return None
    fine = np.isfinite(time)
    for triad in (gyro, accel):
        fine &= np.all(np.abs(triad) < _ABSURD, axis=1)
    check_isolated(~fine, source, where, f"NaN, infinite or absurd values (beyond {_ABSURD:g})")
    return ~fine


def _without(values: Array, rows: Array) -> Array:
    """The values with NaN in some rows."""
    return np.where(rows[:, None], np.nan, values) if rows.any() else values


def _rows_between_stamps(time: Array) -> Array:
    known = np.flatnonzero(np.isfinite(time))
    return np.arange(known[0], known[-1] + 1)


def _interpolate_stamps(time: Array) -> Array:
    index, known = np.arange(time.size), np.isfinite(time)
    return np.interp(index, index[known], time[known])


def _interpolate_increments(time: Array, data: Array) -> None:
    """Fill increments that are not finite, in place, from the rates of the rows around them."""
    good = np.isfinite(data).all(axis=1)
    step = np.diff(time, prepend=2.0 * time[0] - time[1])
    for k in range(6):
        data[~good, k] = step[~good] * np.interp(time[~good], time[good], data[good, k] / step[good])


def _add_up(data: Array, first: Array) -> Array:
    """Sum the rows of each stamp, a row that equals the one before it counted once."""
    repeated = ~first & np.concatenate(([False], (data[1:] == data[:-1]).all(axis=1)))
    return np.add.reduceat(np.where(repeated[:, None], 0.0, data), np.flatnonzero(first), axis=0)
