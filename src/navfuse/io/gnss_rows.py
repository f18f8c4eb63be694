"""From the rows of any GNSS file to a checked log.

Every GNSS reader fills a :class:`GnssRows` and hands it to :func:`gnss_log`, so that all formats get the same checks,
repairs and defaults.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from math import degrees

import numpy as np

from navfuse.data.logs import GnssLog
from navfuse.errors import InputError
from navfuse.io.gnss_plausibility import check_position_units, check_velocity_units
from navfuse.io.repair import time_order
from navfuse.io.tables import Where

Array = np.ndarray

MAX_EMPTY_SHARE = 0.5
_ABSURD = 1e9
DEFAULT_SD_POSITION: dict[str, tuple[float, float, float]] = {
    "rtk-fixed": (0.02, 0.02, 0.04),
    "ppp": (0.1, 0.1, 0.2),
    "rtk-float": (0.5, 0.5, 1.0),
    "dgps": (1.5, 1.5, 3.0),
    "sbas": (1.5, 1.5, 3.0),
    "single": (5.0, 5.0, 10.0),
    "": (5.0, 5.0, 10.0),
}
"""Standard deviations [m] north, east, down where a file gives none, by fix type; "" for any other.

On the cautious side of what receivers reach under open sky, since errors under trees and between houses are larger
and last for minutes.
"""
DEFAULT_SD_VELOCITY = (0.2, 0.2, 0.4)
"""Standard deviations [m/s] north, east, down of Doppler velocity where a file gives none."""
NO_FIX = frozenset(("none", "no-fix", "no fix", "nofix", "invalid", "0", "0.0", "dead-reckoning"))
"""Fix types, in lower case, whose rows hold no position, or none by satellites."""


@dataclass(frozen=True, slots=True)
class GnssRows:
    """Rows of a GNSS file in SI units, unchecked.

    Attributes
    ----------
    time : (n,) array [s]
    lat, lon, height : (n,) arrays [rad, rad, m]
        NaN or infinite where a row has no position.
    sd_position : (n, 3) array [m] or None
        North, east, down; NaN where unknown.
    velocity_n, sd_velocity : (n, 3) arrays [m/s] or None
        NaN where unknown.
    fix : (n,) array of str or None
    n_satellites : (n,) array or None
        NaN where unknown.
    """

    time: Array
    lat: Array
    lon: Array
    height: Array
    sd_position: Array | None = None
    velocity_n: Array | None = None
    sd_velocity: Array | None = None
    fix: Array | None = None
    n_satellites: Array | None = None

    def take(self, index: Array) -> GnssRows:
        """The rows at these indices, or where this mask is True."""
        parts = {field.name: getattr(self, field.name) for field in fields(self)}
        return replace(self, **{name: part[index] for name, part in parts.items() if part is not None})


@dataclass(frozen=True, slots=True)
class GnssNames:
    """How the file calls things, for messages.

    Attributes
    ----------
    time, lat, lon, height : str
        Columns.
    sd_position, velocity, sd_velocity : tuple of 3 str
        Columns north, east, down; native names where the file has none.
    """

    time: str = "time_s"
    lat: str = "lat_deg"
    lon: str = "lon_deg"
    height: str = "height_m"
    sd_position: tuple[str, ...] = ("sd_north_m", "sd_east_m", "sd_down_m")
    velocity: tuple[str, ...] = ("vn_mps", "ve_mps", "vd_mps")
    sd_velocity: tuple[str, ...] = ("sd_vn_mps", "sd_ve_mps", "sd_vd_mps")


@dataclass(frozen=True, slots=True)
class StatedSigmas:
    """What the user says of a receiver whose file does not: used where a standard deviation is missing.

    Attributes
    ----------
    position : (3,) array [m] or None
        North, east, down.
    velocity : (3,) array [m/s] or None
    """

    position: Array | None = None
    velocity: Array | None = None


UNSTATED = StatedSigmas()
"""The defaults of this module apply."""


def gnss_log(
    rows: GnssRows,
    names: GnssNames,
    source: str,
    where: Where,
    notes: list[str],
    stated: StatedSigmas = UNSTATED,
    *,
    sparse: bool = False,
) -> GnssLog:
    """Check rows, repair what may be repaired, and make a log of them.

    * Rows without a position (NaN, infinite, exactly 0 N 0 E amid others, fix type "none") are left out with a note;
      refused if they are more than half of the file.
    * Rows out of order are sorted, of rows with equal stamps the first is kept; refused from 1 % on.
    * A standard deviation that is missing is the one `stated`, or gets a default with a note; one that is zero or
      negative is refused.
    * A velocity that lacks a component is NaN throughout.

    Parameters
    ----------
    rows : GnssRows
        As read.
    names : GnssNames
        For messages.
    source : str
        File.
    where : callable
        Row index -> its name for a person.
    notes : list of str
        Notes so far; those made here are appended.
    stated : StatedSigmas
    sparse : bool
        The file has a row for more than the fixes, so that most rows may lack a position.

    Returns
    -------
    GnssLog
        `notes` is the whole list.

    Raises
    ------
    InputError
        If the rows cannot be used.
    """
    index = np.flatnonzero(~_empty_rows(rows, source, where, notes, sparse))
    rows = rows.take(index)
    _check_range(rows, names, source, lambda row: where(int(index[row])))
    order = time_order(rows.time, names.time, source, lambda row: where(int(index[row])))
    if order is not None:
        kept = order.order[order.first]
        rows, index = rows.take(kept), index[kept]
        notes.append(f"{order.note}: sorted by time, the first row of each stamp kept")
    if rows.time.size < 2:
        raise InputError(f"{source}: the log has {rows.time.size} usable fix; at least two are needed")

    def origin(row: int) -> str:
        return where(int(index[row]))

    rows = replace(
        rows,
        sd_position=_position_sigmas(rows, names, source, origin, notes, stated),
        **_velocity(rows, names, source, origin, notes, stated),
    )
    notes += check_position_units(
        rows.time, rows.lat, rows.lon, rows.height, rows.velocity_n, (names.lat, names.lon, names.height), source
    )
    if rows.velocity_n is not None:
        notes += check_velocity_units(
            rows.time, rows.lat, rows.lon, rows.height, rows.velocity_n, names.velocity, source
        )
    return GnssLog(
        time=rows.time,
        lat=rows.lat,
        lon=np.where(rows.lon > np.pi, rows.lon - 2.0 * np.pi, rows.lon),
        height=rows.height,
        sd_position=rows.sd_position if rows.sd_position is not None else np.empty((0, 3)),
        velocity_n=rows.velocity_n,
        sd_velocity=rows.sd_velocity,
        fix=rows.fix,
        n_satellites=None if rows.n_satellites is None else np.nan_to_num(rows.n_satellites).astype(np.int64),
        source=source,
        notes=tuple(notes),
    )


def _empty_rows(rows: GnssRows, source: str, where: Where, notes: list[str], sparse: bool) -> Array:
    empty = ~(np.isfinite(rows.time) & np.isfinite(rows.lat) & np.isfinite(rows.lon) & (np.abs(rows.height) < _ABSURD))
    at_origin = (rows.lat == 0.0) & (rows.lon == 0.0)
    if not at_origin[~empty].all():
        empty |= at_origin
    if rows.fix is not None:
        empty |= np.isin(np.char.lower(rows.fix.astype(str)), list(NO_FIX))
    if rows.sd_position is not None:
        empty |= np.any(np.abs(rows.sd_position) >= _ABSURD, axis=1)
    count = int(np.count_nonzero(empty))
    if count:
        found = f"{source}: {count} of {empty.size} rows hold no position (NaN, infinite, 0 N 0 E, or no fix)"
        first = where(int(np.argmax(empty)))
        if count > MAX_EMPTY_SHARE * empty.size and not sparse:
            raise InputError(
                f"{found}, the first is {first}; more than half is not accepted, check how the file was made"
            )
        notes.append(f"{found}, the first is {first}: left out")
    return empty


def _check_range(rows: GnssRows, names: GnssNames, source: str, where: Where) -> None:
    flawed = np.abs(rows.lat) > np.pi / 2.0
    if flawed.any():
        row = int(np.argmax(flawed))
        swapped = " Are latitude and longitude exchanged?" if (np.abs(rows.lon) <= np.pi / 2.0).all() else ""
        swapped = " Are these degrees?" if names.lat.endswith("rad") else swapped
        raise InputError(
            f"{source}: {where(row)}, column '{names.lat}': latitude {degrees(rows.lat[row]):.9g} deg is outside"
            f" -90..90.{swapped}"
        )
    flawed = (rows.lon < -np.pi) | (rows.lon > 2.0 * np.pi)
    if flawed.any():
        row = int(np.argmax(flawed))
        raise InputError(
            f"{source}: {where(row)}, column '{names.lon}': longitude {degrees(rows.lon[row]):.9g} deg is outside"
            " -180..360"
        )


def _position_sigmas(
    rows: GnssRows, names: GnssNames, source: str, where: Where, notes: list[str], stated: StatedSigmas
) -> Array:
    kinds = np.char.lower(rows.fix.astype(str)) if rows.fix is not None else np.full(rows.time.size, "")
    default = np.empty((rows.time.size, 3))
    for kind in np.unique(kinds):
        default[kinds == kind] = DEFAULT_SD_POSITION.get(str(kind), DEFAULT_SD_POSITION[""])
    needed = np.full(rows.time.size, True)
    told = "gnss.sd_position_m", stated.position
    return _sigmas(rows.sd_position, default, needed, names.sd_position, "m", source, where, notes, told)


def _velocity(
    rows: GnssRows, names: GnssNames, source: str, where: Where, notes: list[str], stated: StatedSigmas
) -> dict[str, Array | None]:
    if rows.velocity_n is None:
        if stated.velocity is not None:
            notes.append(f"{source}: there are no velocities, so that gnss.sd_velocity_mps has no effect")
        return {"velocity_n": None, "sd_velocity": None}
    given = np.all(np.abs(rows.velocity_n) < _ABSURD, axis=1)
    if not given.any():
        notes.append(f"{source}: no row of {', '.join(names.velocity)} holds a velocity, they are not used")
        return {"velocity_n": None, "sd_velocity": None}
    default = np.broadcast_to(DEFAULT_SD_VELOCITY, rows.velocity_n.shape)
    told = "gnss.sd_velocity_mps", stated.velocity
    sigmas = _sigmas(rows.sd_velocity, default, given, names.sd_velocity, "m/s", source, where, notes, told)
    return {"velocity_n": np.where(given[:, None], rows.velocity_n, np.nan), "sd_velocity": sigmas}


def _sigmas(
    sd: Array | None,
    default: Array,
    needed: Array,
    names: tuple[str, ...],
    unit: str,
    source: str,
    where: Where,
    notes: list[str],
    told: tuple[str, Array | None],
) -> Array:
    """Standard deviations with those told by a key, or else defaults, where they are missing; refuses what is not
    positive in a `needed` row.
    """
    given = np.full_like(default, np.nan) if sd is None else sd
    flawed = (given <= 0.0) & needed[:, None]
    if flawed.any():
        row, axis = (int(i) for i in np.argwhere(flawed)[0])
        raise InputError(
            f"{source}: {where(row)}, column '{names[axis]}': a standard deviation of {given[row, axis]:g} {unit} would"
            f" mean a perfect measurement; {np.count_nonzero(flawed.any(axis=1))} rows have such values. Give the true"
            " ones, or remove the columns to get defaults"
        )
    missing = ~((given > 0.0) & (given < _ABSURD))
    lacking = missing & needed[:, None]
    key, values = told
    if values is not None:
        if not lacking.any():
            notes.append(
                f"{source}: gives its own standard deviations in every row, so that {key} has no effect; to change"
                " them there are gnss.sd_scale, gnss.velocity_sd_scale and gnss.sd_floor_m"
            )
        return np.where(missing, values, given)
    for axis in range(3):
        count = int(np.count_nonzero(lacking[:, axis]))
        if count:
            extent = "is missing" if lacking[needed, axis].all() else f"is empty in {count} rows"
            values = np.unique(default[lacking[:, axis], axis])
            notes.append(
                f"{source}: '{names[axis]}' {extent}: assumed {' or '.join(f'{value:g}' for value in values)} {unit}"
            )
    return np.where(missing, default, given)
