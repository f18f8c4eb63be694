"""Is a GNSS log in the units its column names claim?

Positions and velocities of one log tell the same motion. Where both are given, the ratio of the two shows a wrong unit
or sign at once. Where only positions are given, radians in a column of degrees put the log within 1.6 degrees of the
equator and 3.2 of the prime meridian, which is open sea (the nearest land is over 300 km away), and make it 57 times
slower than it was.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from navfuse.errors import InputError

Array = np.ndarray

_EARTH_RADIUS = 6371e3
_DEG = np.pi / 180.0
_FAST = 6.0
_TOO_FAST = 350.0
_ALIKE = 0.9
_SPAN = 10.0
_APART = 2.0
_WILDLY_APART = 20.0
_SPEED_UNITS = {"km/h": 1.0 / 3.6, "knots": 1852.0 / 3600.0, "ft/s": 0.3048, "cm/s": 0.01, "mm/s": 0.001}
_LENGTH_UNITS = {"feet": 0.3048, "centimetres": 0.01, "millimetres": 0.001}
_SIGMAS = 4.0
_FEWEST = 5
"""Windows that vertical motion is judged by."""
_FITS = 0.25
"""Distance of velocity and motion over the motion, up to which they agree."""


def check_position_units(
    time: Array,
    lat: Array,
    lon: Array,
    height: Array,
    velocity_n: Array | None,
    names: tuple[str, ...],
    source: str,
    remedy: str | None = None,
) -> list[str]:
    """Look for radians in columns of degrees, and for heights in millimetres.

    Parameters
    ----------
    time : (n,) array [s]
        Strictly increasing, n >= 2.
    lat, lon, height : (n,) arrays [rad, rad, m]
        Positions, by their column names.
    velocity_n : (n, 3) array [m/s] or None
        May hold NaN.
    names : tuple of 3 str
        Columns of latitude, longitude, height.
    source : str
        File, for messages.
    remedy : str, optional
        What to do about radians; default to rename the columns. If given, the columns hold degrees without saying so.

    Returns
    -------
    list of str
        Notes on what looks odd.

    Raises
    ------
    InputError
        If the positions can only be radians: the velocities say so, or the log creeps about in the Gulf of Guinea.
    """
    notes = []
    if float(np.median(np.abs(height))) > 1e5:
        notes.append(
            f"{source}: column '{names[2]}': the median height is {np.median(height) / 1e3:.0f} km; is it in"
            " millimetres?"
        )
    if remedy is None and not (names[0].endswith("deg") and names[1].endswith("deg")):
        return notes
    in_box = (np.abs(lat) <= np.pi / 2.0 * _DEG).all() and (np.abs(lon) <= np.pi * _DEG).all()
    if not in_box or (np.hypot(lat, lon) < 0.02 * _DEG).all():
        return notes
    lat_range, lon_range = (f"{np.degrees(x).min():.4g}..{np.degrees(x).max():.4g}" for x in (lat, lon))
    fault = f"{source}: columns '{names[0]}', '{names[1]}': the values lie in {lat_range} and {lon_range}"
    remedy = remedy or "rename them to lat_rad, lon_rad"
    if velocity_n is not None:
        if _moves_alike(time, lat, lon, height, velocity_n):
            return notes
        if _moves_alike(time, lat / _DEG, lon / _DEG, height, velocity_n):
            raise InputError(f"{fault}; only as radians do they move as the velocities say: {remedy}")
    speed = _fastest(time, lat, lon)
    if speed > _FAST or speed / _DEG > _TOO_FAST:
        return notes
    if (np.abs(lat) < 0.2 * _DEG).all() and (np.abs(lon) < 0.2 * _DEG).all():
        return [*notes, f"{fault}, within 22 km of 0 N 0 E; if they are radians, {remedy}"]
    raise InputError(
        f"{fault}, open sea in the Gulf of Guinea where nothing moved faster than {speed:.2g} m/s: these look like"
        f" radians; {remedy}. If the log really is from there, add its velocity columns"
    )


def check_velocity_units(
    time: Array, lat: Array, lon: Array, height: Array, velocity_n: Array, names: tuple[str, ...], source: str
) -> list[str]:
    """Compare velocities with the motion of the positions.

    Parameters
    ----------
    time, lat, lon, height, velocity_n
        As in :func:`check_position_units`.
    names : tuple of 3 str
        Columns of the velocities.
    source : str
        File, for messages.

    Returns
    -------
    list of str
        A note if horizontal or vertical velocity is a clear multiple, or has the opposite sign, of what the positions
        do, or is another motion altogether.

    Raises
    ------
    InputError
        If columns are exchanged or a sign is wrong beyond doubt, or if it is another motion by tens of metres per
        second.
    """
    _refuse_exchange(time, lat, lon, height, velocity_n, names, source)
    notes = []
    ratio, correlation, rms = _motion_ratio(time, lat, lon, height, velocity_n)
    odd = {}
    if rms > 0.3 and abs(correlation) > _ALIKE and not 0.7 < ratio < 1.4:
        cause = f"are they {unit}" if (unit := _speed_unit(ratio)) else "is a unit wrong or are columns exchanged"
        odd[0] = f"the positions move {ratio:.2f} times as fast as these velocities say; {cause}?"
    vertical = vertical_motion(time, height, velocity_n[:, 2])
    if vertical is not None and vertical.told and vertical.odd:
        odd[1] = vertical.fault
    groups = (f"'{names[0]}', '{names[1]}'", f"'{names[2]}'")
    for k, ((apart, moved), columns) in enumerate(
        zip(_motion_apart(time, lat, lon, height, velocity_n), groups, strict=True)
    ):
        if k in odd:
            notes.append(f"{source}: column {columns}: {odd[k]}")
            continue
        fault = (
            f"{source}: column {columns}: over ten seconds these velocities are {apart:.3g} m/s away from how the"
            f" positions move ({moved:.3g} m/s), half of the time or more; are columns exchanged, or is one of them not"
            " what its name says?"
        )
        if apart > _WILDLY_APART:
            raise InputError(f"{fault} Correct them, or leave them out")
        if apart > _APART + 0.3 * moved:
            notes.append(fault)
    return notes


def _speed_unit(ratio: float) -> str:
    """The unit of speed of which m/s is this part, "" if it is none."""
    return next((unit for unit, size in _SPEED_UNITS.items() if abs(ratio / size - 1.0) < 0.08), "")


@dataclass(frozen=True, slots=True)
class VerticalMotion:
    """Changes of height against integrated vertical velocity, over windows of ten seconds.

    Attributes
    ----------
    ratio, sd : float
        Change of height over what the velocities say, and its standard deviation by what remains.
    correlation : float
        -1..1, means removed: a constant drift of either tells nothing.
    moved : float [m]
        Standard deviation of the changes of height.
    """

    ratio: float
    sd: float
    correlation: float
    moved: float

    @property
    def told(self) -> bool:
        """Whether the climbs stand out of the noise of heights and velocities, so that the ratio means something."""
        return abs(self.correlation) > _ALIKE

    @property
    def odd(self) -> bool:
        """Whether the ratio is one that another unit or sign makes, rather than noise."""
        return not 0.7 < self.ratio < 1.4 and abs(self.ratio - 1.0) > _SIGMAS * self.sd

    @property
    def reversed(self) -> bool:
        """Whether only the sign is wrong."""
        return self.told and self.odd and -1.4 < self.ratio < -0.7

    @property
    def fault(self) -> str:
        """What an odd ratio means, in words that follow the name of the column."""
        size = abs(self.ratio)
        if unit := next((unit for unit, part in _LENGTH_UNITS.items() if abs(size * part - 1.0) < 0.08), ""):
            cause = f"are the heights in {unit}"
        elif unit := _speed_unit(size):
            cause = f"are they {unit}"
        else:
            cause = "is a unit wrong or are columns exchanged"
        if self.ratio < 0.0:
            sign = "is up positive instead of down, or the sign wrong"
            cause = sign if 0.7 < size < 1.4 else f"{sign}, and {cause}"
        return (
            f"the heights move {self.ratio:.2f} times (give or take {self.sd:.2g}) as fast as these velocities say;"
            f" {cause}?"
        )


def vertical_motion(time: Array, height: Array, velocity_d: Array) -> VerticalMotion | None:
    """Compare heights (n,) [m] with vertical velocities (n,) [m/s], down positive; either may hold NaN.

    Over ten seconds the noise of single heights has hardly any weight beside a climb, so that tenths of a metre per
    second tell. None if there are fewer than five such windows without gaps, or one of the two never changes.
    """
    given = np.isfinite(height) & np.isfinite(velocity_d)
    if np.count_nonzero(given) < 10:
        return None
    time, height, velocity_d = time[given], height[given], velocity_d[given]
    step = np.diff(time)
    rows = max(3, int(round(_SPAN / np.median(step))))
    fallen = np.concatenate(([0.0], np.cumsum(0.5 * step * (velocity_d[1:] + velocity_d[:-1]))))
    edges = np.arange(0, time.size, rows)
    whole = np.array([step[a:b].max() < 3.0 * np.median(step) for a, b in pairwise(edges)])
    if np.count_nonzero(whole) < _FEWEST:
        return None
    expected, seen = np.diff(fallen[edges])[whole], -np.diff(height[edges])[whole]
    expected, seen = expected - expected.mean(), seen - seen.mean()
    power, size = float(expected @ expected), float(seen @ seen)
    if power == 0.0 or size == 0.0:
        return None
    ratio = float(expected @ seen) / power
    remains = seen - ratio * expected
    sd = float(np.sqrt(remains @ remains / (seen.size - 2) / power))
    correlation = float(expected @ seen / np.sqrt(power * size))
    return VerticalMotion(ratio, sd, correlation, float(np.sqrt(size / seen.size)))


def _refuse_exchange(
    time: Array, lat: Array, lon: Array, height: Array, velocity_n: Array, names: tuple[str, ...], source: str
) -> None:
    """Name the one exchange or sign that makes positions and velocities tell the same motion, if they do not as is."""
    north, east, down = velocity_n.T
    velocities = f"'{names[0]}', '{names[1]}'"
    guesses = {
        "": (lat, lon, velocity_n),
        "latitude and longitude are exchanged": (lon, lat, velocity_n),
        f"the columns {velocities} are exchanged": (lat, lon, np.column_stack((east, north, down))),
        f"latitude or '{names[0]}' has the wrong sign": (lat, lon, np.column_stack((-north, east, down))),
        f"longitude or '{names[1]}' has the wrong sign": (lat, lon, np.column_stack((north, -east, down))),
        f"the columns {velocities} have the wrong sign": (lat, lon, np.column_stack((-north, -east, down))),
    }
    misfit = {}
    for guess, (phi, lam, velocity) in guesses.items():
        apart, moved = _motion_apart(time, phi, lam, height, velocity)[0]
        if moved < _APART:
            return
        misfit[guess] = apart / moved
        if not guess and misfit[guess] <= _FITS:
            return
    best, second = sorted(misfit, key=misfit.__getitem__)[:2]
    fits = misfit[best] < _FITS and misfit[second] > 2.0 * misfit[best]
    if best and fits and misfit[""] > max(_FITS, 4.0 * misfit[best]):
        raise InputError(
            f"{source}: the positions do not move as the velocities say, but they would if {best}; correct the file"
        )


def _moves_alike(time: Array, lat: Array, lon: Array, height: Array, velocity_n: Array) -> bool:
    ratio, correlation, _ = _motion_ratio(time, lat, lon, height, velocity_n)
    return correlation > _ALIKE and abs(ratio - 1.0) < 0.5


def _motion_ratio(time: Array, lat: Array, lon: Array, height: Array, velocity_n: Array) -> tuple[float, float, float]:
    """Ratio of horizontal displacement to integrated velocity, their correlation, rms velocity [m/s].

    Outliers of either side lower the correlation, and with it the standing of the ratio.
    """
    step = np.diff(time)
    mean = 0.5 * (velocity_n[1:] + velocity_n[:-1])
    radius = _EARTH_RADIUS + height[:-1]
    east = (np.diff(lon) + np.pi) % (2.0 * np.pi) - np.pi
    moved = np.column_stack((np.diff(lat) * radius, east * radius * np.cos(lat[:-1])))
    usable = np.isfinite(mean).all(axis=1) & (step < 3.0 * np.median(step))
    expected, seen = (mean[:, :2] * step[:, None])[usable].ravel(), moved[usable].ravel()
    power = float(expected @ expected)
    if expected.size < 20 or power == 0.0 or not seen.any():
        return 1.0, 0.0, 0.0
    product = float(expected @ seen)
    correlation = product / np.sqrt(power * float(seen @ seen))
    return product / power, correlation, float(np.sqrt(np.mean(mean[usable][:, :2] ** 2)))


def _motion_apart(time: Array, lat: Array, lon: Array, height: Array, velocity_n: Array) -> list[tuple[float, float]]:
    """Median distance of displacement over time from mean velocity, and median displacement over time [m/s].

    Over windows of ten seconds without gaps, which the noise of positions hardly reaches; horizontal, then vertical.
    """
    step = np.diff(time)
    rows = max(3, int(round(_SPAN / np.median(step))))
    first = np.arange(0, time.size - rows)
    last = first + rows
    total = np.concatenate(
        [np.zeros((1, 3)), np.cumsum(0.5 * step[:, None] * (velocity_n[1:] + velocity_n[:-1]), axis=0)]
    )
    span = time[last] - time[first]
    radius = _EARTH_RADIUS + height[first]
    east = (lon[last] - lon[first] + np.pi) % (2.0 * np.pi) - np.pi
    moved = np.column_stack(
        ((lat[last] - lat[first]) * radius, east * radius * np.cos(lat[first]), height[first] - height[last])
    )
    apart = moved - (total[last] - total[first])
    usable = np.isfinite(apart).all(axis=1) & (span < 2.0 * rows * np.median(step))
    if np.count_nonzero(usable) < 3:
        return [(0.0, 0.0), (0.0, 0.0)]
    found = []
    for axes in ([0, 1], [2]):
        speeds = (np.linalg.norm(part[usable][:, axes], axis=1) / span[usable] for part in (apart, moved))
        found.append(tuple(float(np.median(speed)) for speed in speeds))
    return found


def _fastest(time: Array, lat: Array, lon: Array) -> float:
    """Largest speed [m/s] over stretches of about ten seconds."""
    ends = np.unique(np.searchsorted(time, np.arange(time[0], time[-1], 10.0)))
    ends = np.append(ends[:-1], time.size - 1) if ends.size > 1 else np.array([0, time.size - 1])
    moved = np.hypot(np.diff(lat[ends]), np.diff(lon[ends]) * np.cos(lat[ends[:-1]])) * _EARTH_RADIUS
    return float(np.max(moved / np.diff(time[ends])))
