"""Satellite orbits by almanac elements: position and velocity in Earth-fixed axes at any time.

One set of elements serves all: an almanac's, the nominal slots of GPS, and plain circles.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING

import numpy as np
from numba import njit

from navfuse.core.constants import EARTH_GM, EARTH_RATE, TWO_PI, WGS84_A
from navfuse.core.printed_keys import shown
from navfuse.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

Array = np.ndarray

GPS_SEMI_MAJOR = 26_559_700.0
"""Nominal semi-major axis of GPS [m] (SPS Performance Standard, 2001, table 3-1)."""
GPS_INCLINATION = math.radians(55.0)
_GPS_NODE_RATE = -4.4874e-7 * math.pi / 180.0
"""[rad/s]; the standard (table A-2-1) prints -4.4874E-07 deg/s, the precession by the flattening of the Earth."""
_GREENWICH = math.radians((18.0 + 36.0 / 60.0 + 14.4 / 3600.0) * 15.0)
"""Greenwich hour angle at the epoch of the slots, 0 h on 1 July 1993."""
_GPS_NODES_DEG = {"A": 272.847, "B": 332.847, "C": 32.847, "D": 92.847, "E": 152.847, "F": 212.847}
_GPS_SLOTS_DEG = {
    "A": (268.126, 161.786, 11.676, 41.806),
    "B": (80.956, 173.336, 309.976, 204.376),
    "C": (111.876, 11.796, 339.666, 241.556),
    "D": (135.226, 265.446, 35.156, 167.356),
    "E": (197.046, 302.596, 66.066, 333.686),
    "F": (238.886, 345.226, 105.206, 135.346),
}
"""Arguments of latitude of the slots. D3 is 35.156 in table 3-1 and by the mean anomaly of table A-2-1, which lists the
same constellation at another time; later prints have 35.136."""
_GPS_FEWEST, _GPS_MOST = 24, 32


@njit(cache=True, error_model="numpy")
def eccentric_anomaly(mean_anomaly, eccentricity):
    """Solve Kepler's equation ``E - e sin(E) = M``.

    Parameters
    ----------
    mean_anomaly : float [rad]
        Any turn.
    eccentricity : float
        0 <= e < 1.

    Returns
    -------
    float [rad]
        In the turn -pi..pi.

    Notes
    -----
    No checks are made. Newton's method from above the root, where the function is convex: it cannot overshoot, and ends
    when rounding stops it.
    """
    reduced = mean_anomaly - TWO_PI * math.floor(mean_anomaly / TWO_PI + 0.5)
    target = abs(reduced)
    E = min(target + eccentricity, math.pi)
    for _ in range(60):
        lower = E - (E - eccentricity * math.sin(E) - target) / (1.0 - eccentricity * math.cos(E))
        if not lower < E:
            break
        E = lower
    return E if reduced >= 0.0 else -E


@njit(cache=True, error_model="numpy")
def orbit_state(time, elements):
    """Position and velocity of one satellite.

    Parameters
    ----------
    time : float [s]
        On the scale of the elements' `toa`.
    elements : (8,) array
        A row of :attr:`Constellation.elements`.

    Returns
    -------
    x, y, z, vx, vy, vz : float [m], [m/s]
        Position in the Earth-fixed axes of that very time, and velocity relative to those rotating axes.

    Notes
    -----
    No checks are made. Source: IS-GPS-200, table 20-IV, with the terms that an almanac lacks at zero (20.3.3.5.2.1).
    """
    a, e, cos_i, sin_i = elements[0], elements[1], math.cos(elements[2]), math.sin(elements[2])
    since = time - elements[7]
    node_rate = elements[4] - EARTH_RATE
    node = elements[3] + node_rate * since - EARTH_RATE * elements[7]
    n = math.sqrt(EARTH_GM / (a * a * a))
    E = eccentric_anomaly(elements[6] + n * since, e)
    cos_E, sin_E = math.cos(E), math.sin(E)
    b = a * math.sqrt(1.0 - e * e)
    E_rate = n / (1.0 - e * cos_E)
    along, across = a * (cos_E - e), b * sin_E
    along_rate, across_rate = -a * sin_E * E_rate, b * cos_E * E_rate
    cos_w, sin_w = math.cos(elements[5]), math.sin(elements[5])
    p, q = along * cos_w - across * sin_w, along * sin_w + across * cos_w
    p_rate, q_rate = along_rate * cos_w - across_rate * sin_w, along_rate * sin_w + across_rate * cos_w
    cos_node, sin_node = math.cos(node), math.sin(node)
    x, y = p * cos_node - q * cos_i * sin_node, p * sin_node + q * cos_i * cos_node
    vx = p_rate * cos_node - q_rate * cos_i * sin_node - node_rate * y
    vy = p_rate * sin_node + q_rate * cos_i * cos_node + node_rate * x
    return x, y, q * sin_i, vx, vy, q_rate * sin_i


@njit(cache=True, error_model="numpy")
def _states(time, elements, r_e, v_e):
    for k in range(time.size):
        for j in range(elements.shape[0]):
            x, y, z, vx, vy, vz = orbit_state(time[k], elements[j])
            r_e[k, j, 0], r_e[k, j, 1], r_e[k, j, 2] = x, y, z
            v_e[k, j, 0], v_e[k, j, 1], v_e[k, j, 2] = vx, vy, vz


@dataclass(frozen=True, slots=True, eq=False)
class Constellation:
    """Satellites on Keplerian orbits whose planes precess.

    Attributes
    ----------
    satellites : tuple of m str
        Names, each once: "G07".
    semi_major : (m,) array [m]
    eccentricity : (m,) array
        0 <= e < 1.
    inclination : (m,) array [rad]
    node : (m,) array [rad]
        Longitude of the ascending node against Greenwich at time zero (of a GPS almanac: the beginning of its week).
    node_rate : (m,) array [rad/s]
        Precession of the node against the stars; the rotation of the Earth is not in it.
    perigee : (m,) array [rad]
        Argument of perigee.
    mean_anomaly : (m,) array [rad]
        At `toa`.
    toa : (m,) array [s]
        Time of applicability. Times go on past the end of the week.

    Each array may be given as one number for all.

    Raises
    ------
    ConfigError
        For no satellite, a name given twice, wrong shapes, or elements that are not finite or not of an orbit around
        the Earth.

    Notes
    -----
    No perturbations but the precession, so that an almanac a few days old is off by kilometres: right for geometry,
    not for processing real measurements.
    """

    satellites: tuple[str, ...]
    semi_major: Array
    eccentricity: Array
    inclination: Array
    node: Array
    node_rate: Array
    perigee: Array
    mean_anomaly: Array
    toa: Array

    def __post_init__(self) -> None:
        names = tuple(str(name) for name in self.satellites)
        if not names:
            raise ConfigError("a constellation needs at least one satellite")
        twice = [name for index, name in enumerate(names) if name in names[:index]]
        if twice:
            raise ConfigError(f"the satellite {twice[0]!r} is there twice in the constellation")
        object.__setattr__(self, "satellites", names)
        for entry in fields(self)[1:]:
            values = np.asarray(getattr(self, entry.name), dtype=float)
            if values.shape not in ((), (len(names),)):
                raise ConfigError(f"{entry.name} must be one number or {len(names)}, not of shape {values.shape}")
            values = np.array(np.broadcast_to(values, (len(names),)))
            if not np.isfinite(values).all():
                raise ConfigError(f"{entry.name} of the constellation must be finite")
            values.flags.writeable = False
            object.__setattr__(self, entry.name, values)
        if np.any(self.eccentricity < 0.0) or np.any(self.eccentricity >= 1.0):
            raise ConfigError("the eccentricity of an orbit must lie in 0 <= e < 1")
        low = self.semi_major * (1.0 - self.eccentricity) <= WGS84_A
        if low.any():
            raise ConfigError(f"the orbit of satellite {names[int(np.argmax(low))]!r} runs through the Earth")

    def __len__(self) -> int:
        return len(self.satellites)

    @property
    def elements(self) -> Array:
        """The elements as (m, 8) array, in the order of the attributes."""
        return np.column_stack([getattr(self, entry.name) for entry in fields(self)[1:]])

    def index(self, satellite: str) -> int:
        """Where a satellite stands.

        Raises
        ------
        ConfigError
            If there is none of that name.
        """
        if satellite not in self.satellites:
            raise ConfigError(
                f"there is no satellite {satellite!r}; the constellation has {', '.join(self.satellites)}"
            )
        return self.satellites.index(satellite)

    def take(self, satellites: Sequence[str]) -> Constellation:
        """Some of the satellites, in the order given.

        Raises
        ------
        ConfigError
            If there is none of a name.
        """
        rows = [self.index(name) for name in satellites]
        return replace(
            self,
            satellites=tuple(satellites),
            **{entry.name: getattr(self, entry.name)[rows] for entry in fields(self)[1:]},
        )

    def at(self, time: ArrayLike) -> tuple[Array, Array]:
        """Positions and velocities of all satellites.

        Parameters
        ----------
        time : (n,) array [s]

        Returns
        -------
        r_e, v_e : (n, m, 3) arrays [m], [m/s]
            Each in the Earth-fixed axes of its own time; the velocity is that against these rotating axes.
        """
        time = np.ascontiguousarray(np.atleast_1d(np.asarray(time, dtype=float)))
        r_e, v_e = np.empty((time.size, len(self), 3)), np.empty((time.size, len(self), 3))
        _states(time, self.elements, r_e, v_e)
        return r_e, v_e


def circular_orbits(
    satellites: Sequence[str], radius: ArrayLike, inclination: ArrayLike, latitude: ArrayLike, node: ArrayLike
) -> Constellation:
    """Satellites on circles whose planes stand still among the stars.

    Parameters
    ----------
    satellites : sequence of m str
    radius : number or (m,) array [m]
    inclination : number or (m,) array [rad]
    latitude : number or (m,) array [rad]
        Argument of latitude at time zero: angle along the orbit from the ascending node.
    node : number or (m,) array [rad]
        Longitude of the ascending node against Greenwich at time zero.

    Raises
    ------
    ConfigError
        As :class:`Constellation`.
    """
    zero = np.zeros(())
    arrays = (np.asarray(values, dtype=float) for values in (radius, inclination, node, latitude))
    radius, inclination, node, latitude = arrays
    return Constellation(tuple(satellites), radius, zero, inclination, node, zero, zero, latitude, zero)


def workshop_constellation() -> Constellation:
    """The 30 satellites of P. D. Groves's GNSS exercises (UCL COMP0130), named "1" to "30" as in their files.

    Notes
    -----
    Circles of 26 561 750 m at 55 deg; satellite j has the argument of latitude ``2 pi (j - 1) / 30`` and the node ``(pi
    / 3) (j mod 6)`` at time zero. The files go with the positions at the stamp itself, not at the time of transmission;
    the Sagnac rotation is applied to them.
    """
    number = np.arange(1, 31)
    names = [str(j) for j in number]
    latitude, node = TWO_PI * (number - 1) / 30.0, math.pi / 3.0 * (number % 6)
    return circular_orbits(names, 26_561_750.0, math.radians(55.0), latitude, node)


def gps_constellation(count: int = _GPS_FEWEST) -> Constellation:
    """Satellites in the nominal slots of GPS: six planes of four, and up to eight more.

    Parameters
    ----------
    count : int
        24 to 32. The standard names no slots beyond the 24 for all of them: here, each further satellite stands in the
        middle of the widest gap of its plane, in the order of the planes.

    Returns
    -------
    Constellation
        "G01" to "G24" are the slots A1 to F4. Time zero is 0 h GPS time on 1 July 1993.

    Raises
    ------
    ConfigError
        For another count.

    Notes
    -----
    Source: SPS Performance Standard (2001), tables 3-1 and A-2-1: circular, 55 deg, 26 559.7 km, -4.4874e-7 deg/s.
    """
    if not (isinstance(count, (int, np.integer)) and _GPS_FEWEST <= count <= _GPS_MOST):
        raise ConfigError(f"the GPS constellation can have {_GPS_FEWEST} to {_GPS_MOST} satellites, not {shown(count)}")
    places = [(plane, slot) for plane, slots in _GPS_SLOTS_DEG.items() for slot in slots]
    planes = list(_GPS_SLOTS_DEG)
    for extra in range(count - _GPS_FEWEST):
        plane = planes[extra % len(planes)]
        taken = np.sort([latitude for name, latitude in places if name == plane])
        gaps = np.diff(taken, append=taken[0] + 360.0)
        widest = int(np.argmax(gaps))
        places.append((plane, float(taken[widest] + 0.5 * gaps[widest])))
    names = tuple(f"G{number:02d}" for number in range(1, count + 1))
    node = np.radians([_GPS_NODES_DEG[plane] for plane, _ in places]) - _GREENWICH
    latitude = np.radians([latitude for _, latitude in places])
    zero = np.zeros(())
    return Constellation(
        names,
        np.asarray(GPS_SEMI_MAJOR),
        zero,
        np.asarray(GPS_INCLINATION),
        node,
        np.asarray(_GPS_NODE_RATE),
        zero,
        latitude,
        zero,
    )
