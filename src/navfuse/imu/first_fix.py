"""Position and velocity of the inertial sensor at the start, from the fixes near it."""

from __future__ import annotations

import numpy as np

from navfuse.core.earth import dcm_en, ecef_to_geodetic, geodetic_to_ecef, geodetic_to_ecef_batch
from navfuse.core.rotation import dcm_from_euler
from navfuse.data.logs import GnssLog
from navfuse.data.start import Known
from navfuse.errors import AlignmentError
from navfuse.imu.increments import ImuIncrements

Array = np.ndarray

TWICE_USED = 3.0
"""Factor on the standard deviations of quantities found from fixes that the filter uses again."""
COURSE_SPEED = 4.0
COURSE_SD = np.radians(10.0)


def first_position(
    time: float,
    gnss: GnssLog | None,
    known: Known,
    euler: tuple[float, float, float],
    lever_b: Array,
    rest: ImuIncrements,
    standing_s: float,
) -> tuple[Array, Array, Array, Array]:
    """Position and velocity of the IMU at the start, from the nearest fix where they are not given.

    Parameters
    ----------
    time : float [s]
    gnss : GnssLog or None
    known : Known
    euler : (roll, pitch, heading) [rad]
        To take the lever arm off.
    lever_b : (3,) array [m]
    rest : ImuIncrements
        From the start on.
    standing_s : float [s]
        Above zero the velocity is zero.

    Returns
    -------
    position, sd_position, velocity_n, sd_velocity : (3,) arrays
        Latitude, longitude [rad], height [m]; [m]; [m/s]; [m/s].

    Raises
    ------
    AlignmentError
        If a part is neither given nor to be found.
    """
    sd_position = known.sd_position
    sd_velocity = known.sd_velocity
    position, velocity = known.position, known.velocity_n
    if position is None or velocity is None or gnss is not None:
        if gnss is None:
            raise AlignmentError(
                "without GNSS the start must be given in full: lat_deg, lon_deg, height_m, velocity_mps, roll_deg, "
                "pitch_deg, heading_deg"
            )
        k = int(np.argmin(np.abs(gnss.time - time)))
        away = abs(float(gnss.time[k] - time))
        r = geodetic_to_ecef_batch(gnss.lat, gnss.lon, gnss.height)
        C_en = np.array(dcm_en(gnss.lat[k], gnss.lon[k])).reshape(3, 3)
        fix_velocity, fix_sd = _fix_velocity(gnss, r, C_en, k, time, standing_s)
        if velocity is None:
            velocity = fix_velocity
            turning = np.linalg.norm(rest.inc_theta_b[:20].sum(axis=0)) / max(
                rest.time[min(20, len(rest))] - rest.time[0], 1e-6
            )
            sd_velocity = fix_sd + float(np.linalg.norm(lever_b)) * turning if sd_velocity is None else sd_velocity
        if position is None:
            C_nb = np.array(dcm_from_euler(*euler)).reshape(3, 3)
            antenna, extra = _agreed_position(gnss, r, C_en, k, time, fix_velocity)
            r0 = antenna - C_en @ C_nb @ lever_b
            position = np.array(ecef_to_geodetic(r0[0], r0[1], r0[2]))
            if sd_position is None:
                sd_position = (
                    TWICE_USED * gnss.sd_position[k]
                    + away * (fix_sd + away)
                    + 0.2 * float(np.linalg.norm(lever_b))
                    + extra
                )
        elif gnss is not None:
            _check_given_position(position, sd_position, r[k], C_en)
    if sd_position is None:
        sd_position = np.array([1.0, 1.0, 2.0])
    if sd_velocity is None:
        sd_velocity = np.full(3, 0.1)
    return np.asarray(position, dtype=float), sd_position, np.asarray(velocity, dtype=float), sd_velocity


def _fix_velocity(gnss: GnssLog, r: Array, C_en: Array, k: int, time: float, standing_s: float) -> tuple[Array, Array]:
    """Velocity [m/s] of the antenna at fix `k` in n, and its standard deviation."""
    if standing_s > 0:
        sd = 0.1
        if gnss.velocity_n is None:
            still = np.flatnonzero((gnss.time >= time - 1e-6) & (gnss.time <= time + standing_s))
            sd = max(sd, min(3.0, _slope(gnss, still)[1]))
        return np.zeros(3), np.full(3, sd)
    if gnss.velocity_n is not None and gnss.sd_velocity is not None and np.isfinite(gnss.velocity_n[k]).all():
        return gnss.velocity_n[k].copy(), TWICE_USED * gnss.sd_velocity[k] + 2.0 * abs(gnss.time[k] - time)
    near = np.flatnonzero(np.abs(gnss.time - gnss.time[k]) <= 2.0)
    if near.size < 2:
        near = np.arange(max(k - 1, 0), min(k + 2, gnss.time.size))
    if near.size < 2:
        raise AlignmentError("the velocity at the start cannot be found from a single fix; give [start] velocity_mps")
    t = gnss.time[near] - time
    offsets = (r[near] - r[k]) @ C_en
    first, second = np.triu_indices(t.size, 1)
    slope = np.median((offsets[second] - offsets[first]) / (t[second] - t[first])[:, None], axis=0)
    residual = offsets - t[:, None] * slope
    residual -= np.median(residual, axis=0)
    fix_sd = np.max(gnss.sd_position[near], axis=0)
    factor = np.maximum(1.0, np.sqrt(np.mean(residual**2, axis=0)) / fix_sd)
    spread = t - t.mean()
    sd = factor * fix_sd / np.sqrt(spread @ spread)
    return slope, TWICE_USED * sd + 0.5 * float(np.ptp(t)) + 0.1


def _slope(gnss: GnssLog, rows: Array) -> tuple[float, float]:
    """Horizontal speed [m/s] of a straight line through fixes, and its standard deviation; (0, inf) for fewer than
    three.
    """
    if rows.size < 3:
        return 0.0, np.inf
    t = gnss.time[rows] - np.mean(gnss.time[rows])
    spread = float(t @ t)
    speed = float(np.linalg.norm(t @ north_east(gnss, rows)) / spread)
    return speed, float(np.max(gnss.sd_position[rows, :2]) / np.sqrt(spread))


def moves_steadily(gnss: GnssLog, rows: Array) -> bool:
    """Whether the first ten of some fixes lie along a line that they walk, however slowly."""
    speed, sd = _slope(gnss, rows[:10])
    return speed > 0.3 + 4.0 * sd


def _agreed_position(gnss: GnssLog, r: Array, C_en: Array, k: int, time: float, velocity: Array) -> tuple[Array, float]:
    """ECEF position of the antenna at `time` by fix `k`, or by its neighbours if they agree that it is an outlier.

    The second value [m] is to be added to its standard deviations.
    """
    near = np.arange(k, min(k + 5, gnss.time.size))
    dt = gnss.time[near] - time
    places = (r[near] - r[k]) @ C_en - dt[:, None] * velocity
    room = 5.0 * np.max(gnss.sd_position[near]) + 2.5 * float(np.max(dt**2)) + 5.0
    middle = np.median(places, axis=0)
    if near.size >= 3 and np.linalg.norm(places[0] - middle) > room:
        distance = np.linalg.norm(places - middle, axis=1)
        return r[k] + C_en @ middle, 1.5 * float(np.median(distance[distance < room]))
    return r[k] + C_en @ places[0], 0.0


def _check_given_position(position: Array, sd: Array | None, r_fix: Array, C_en: Array) -> None:
    away = np.linalg.norm(np.array(geodetic_to_ecef(*position)) - r_fix)
    if away > 1000.0 + 10.0 * (0.0 if sd is None else float(np.max(sd))):
        raise AlignmentError(
            f"[start] lat_deg, lon_deg, height_m lie {away / 1000.0:.1f} km from the GNSS fixes at that time; "
            "correct them "
            "or leave them out"
        )


def course(rest: ImuIncrements, gnss: GnssLog) -> tuple[float, float] | None:
    """Course over ground near the start, taken for the heading, if it moves fast."""
    k = np.flatnonzero((gnss.time >= rest.time[0]) & (gnss.time <= rest.time[0] + 10.0))
    if k.size < 2:
        return None
    way = north_east(gnss, k)[-1]
    span = gnss.time[k[-1]] - gnss.time[k[0]]
    distance = float(np.hypot(*way))
    sd = float(np.max(gnss.sd_position[k, :2]))
    if distance < max(COURSE_SPEED * span, 10.0 * sd):
        return None
    last = int(np.searchsorted(rest.time, gnss.time[k[-1]]))
    turned = float(np.linalg.norm(rest.inc_theta_b[:last].sum(axis=0)))
    return float(np.arctan2(way[1], way[0]) % (2 * np.pi)), float(
        np.sqrt(COURSE_SD**2 + (2.0 * sd / distance) ** 2 + turned**2)
    )


def north_east(gnss: GnssLog, rows: Array) -> Array:
    """North and east [m] of some fixes (k,) against the first of them, (k, 2)."""
    if rows.size == 0:
        return np.empty((0, 2))
    r = geodetic_to_ecef_batch(gnss.lat[rows], gnss.lon[rows], gnss.height[rows])
    C_en = np.array(dcm_en(gnss.lat[rows[0]], gnss.lon[rows[0]])).reshape(3, 3)
    return ((r - r[0]) @ C_en)[:, :2]
