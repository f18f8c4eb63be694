"""Sigma points side by side, arranged for vector instructions.

The points lie in *tiles* of LANES points: a row of a tile is one number of every point, and the distance from row to
row is a constant that the compiler knows. A tile has the navigation state (10 rows), the corrections of the inertial
sensor (24 rows) and what a kernel leaves behind (10 rows). Lanes without a point repeat the centre.

Vector instructions know no sine and no arctangent. Points lie close to each other, and of the small angles between them
series give every digit: nothing here is an approximation. Where the points are too far from each other for that, the
functions say so, and the caller takes the functions of :mod:`navfuse.data.nav_state` point by point.
"""

from __future__ import annotations

from math import cos, pi, sin, sqrt

from navfuse.core.constants import TWO_PI, WGS84_A, WGS84_E2
from navfuse.core.fused import fused
from navfuse.core.rotation import quat_multiply, quat_rotate
from navfuse.mechanization.ecef import advance_ecef, step_ecef
from navfuse.mechanization.ned import advance_ned, step_ned

LANES = 16
TABLE, LEFT, WIDTH, SIZE = 10 * LANES, 34 * LANES, 43 * LANES, 44 * LANES

SMALL_ANGLE = 0.19
"""Rotations [rad] between points up to which the series hold: 0.1 for the tangent of the half angle."""
SMALL_ARC = 0.004
"""Differences of latitude and longitude [rad] up to which points are drawn by series; twice that when compared."""
ROTATION = 0.19
"""Rotation of the body in one increment [rad] up to which its quaternion is a series."""


@fused
def tile_numbers(points: int) -> int:
    """How many numbers the tiles of so many points take."""
    return (points + LANES - 1) // LANES * SIZE


@fused(inline="always")
def _sin_cos(a):
    """Sine and cosine of an angle below 0.1 to the last digit."""
    x = a * a
    return (
        a * (1.0 - x * (1.0 / 6.0) * (1.0 - x * (1.0 / 20.0) * (1.0 - x * (1.0 / 42.0) * (1.0 - x * (1.0 / 72.0))))),
        1.0 - x * 0.5 * (1.0 - x * (1.0 / 12.0) * (1.0 - x * (1.0 / 30.0) * (1.0 - x * (1.0 / 56.0)))),
    )


@fused(inline="always")
def _arctangent_ratio(x):
    """Arctangent of the root of x, divided by that root, for x below 0.01."""
    return 1.0 - x * (
        1.0 / 3.0
        - x * (1.0 / 5.0 - x * (1.0 / 7.0 - x * (1.0 / 9.0 - x * (1.0 / 11.0 - x * (1.0 / 13.0 - x * (1.0 / 15.0))))))
    )


@fused(inline="always")
def _quat(x, y, z):
    """Quaternion of a rotation vector below 0.2 to the last digit."""
    k = 0.25 * (x * x + y * y + z * z)
    half = 0.5 - k * (1.0 / 12.0 - k * (1.0 / 240.0 - k * (1.0 / 10080.0 - k * (1.0 / 725760.0))))
    w = 1.0 - k * (0.5 - k * (1.0 / 24.0 - k * (1.0 / 720.0 - k * (1.0 / 40320.0))))
    return w, half * x, half * y, half * z


@fused(inline="always")
def _turned_less(q, x, y, z):
    """What a rotation q adds to a vector: q (x, y, z) q* - (x, y, z), without cancellation."""
    a = q[2] * z - q[3] * y
    b = q[3] * x - q[1] * z
    c = q[1] * y - q[2] * x
    return (
        2.0 * (q[0] * a + q[2] * c - q[3] * b),
        2.0 * (q[0] * b + q[3] * a - q[1] * c),
        2.0 * (q[0] * c + q[1] * b - q[2] * a),
    )


@fused(inline="always")
def _meridian(sa, ca, s0, c0, w0, dh, h):
    """Along the meridian, a difference of latitude with the half sine and cosine sa, ca and of height dh = h - h0:
    differences of distance from the axis and of z [m], sine and cosine of the new latitude and of the one between, and
    the new distance from the axis.
    """
    sm = s0 * ca + c0 * sa
    cm = c0 * ca - s0 * sa
    ds = 2.0 * cm * sa
    dc = -2.0 * sm * sa
    s = s0 + ds
    c = c0 + dc
    w = sqrt(1.0 - WGS84_E2 * s * s)
    normal = WGS84_A / w
    longer = WGS84_A * WGS84_E2 * ds * (s + s0) / (w * w0 * (w + w0))
    dp = (normal + h) * dc + (longer + dh) * c0
    dz = (normal * (1.0 - WGS84_E2) + h) * ds + (longer * (1.0 - WGS84_E2) + dh) * s0
    return dp, dz, s, c, sm, cm, (normal + h) * c


@fused
def load_points(X, tiles):
    """Put the navigation states of points X (m, 10+) into tiles. No checks are made."""
    for p in range(tiles.size // SIZE * LANES):
        at = p // LANES * SIZE + p % LANES
        row = p if p < X.shape[0] else 0
        for i in range(10):
            tiles[at + i * LANES] = X[row, i]


@fused
def store_points(tiles, X):
    """Take the navigation states of points X (m, 10+) out of tiles. No checks are made."""
    for p in range(X.shape[0]):
        at = p // LANES * SIZE + p % LANES
        for i in range(10):
            X[p, i] = tiles[at + i * LANES]


@fused
def draw_tiles(nav, gone, S, distance, u, ecef, tiles):
    """:func:`navfuse.mechanization.arc_errors.draw_points` of the navigation states, into tiles.

    Returns
    -------
    bool
        False if the points are too far from each other: then there is nothing in the tiles.

    Notes
    -----
    No checks are made.
    """
    n = S.shape[0]
    arc, angle = 0.0, 0.0
    for j in range(9):
        for i in range(3):
            arc = max(arc, abs(S[i, j]))
            angle = max(angle, abs(S[6 + i, j]))
    arc, angle = 2.0 * distance * arc, 1.8 * distance * angle
    lever = 2.0 * max(abs(gone[0]), abs(gone[1]), abs(gone[2]))
    s0 = c0 = w0 = 0.0
    if not ecef:
        s0, c0 = sin(nav[0]), cos(nav[0])
        w0 = sqrt(1.0 - WGS84_E2 * s0 * s0)
    if not angle < SMALL_ANGLE or not (ecef or arc + lever * angle < SMALL_ARC * c0 * (6.3e6 + nav[2])):
        return False
    for p in range(tiles.size // SIZE * LANES):
        at = p // LANES * SIZE + p % LANES + LEFT
        j = (p - 1) % n
        c = 0.0 if p == 0 or p > 2 * n else (distance if p <= n else -distance)
        for i in range(9):
            tiles[at + i * LANES] = c * S[i, j] if j < 9 else 0.0
    lat, lon, h, vn, ve, vd = nav[0], nav[1], nav[2], nav[3], nav[4], nav[5]
    q0 = nav[6], nav[7], nav[8], nav[9]
    ux, uy, uz = u
    g0, g1, g2, g3, g4, g5 = gone[0], gone[1], gone[2], gone[3], gone[4], gone[5]
    per_metre = 0.0 if ecef else 0.5 / (WGS84_A * (1.0 - WGS84_E2) / (w0 * w0 * w0) + nav[2])
    p0 = 0.0 if ecef else (WGS84_A / w0 + nav[2]) * c0
    for begin in range(0, tiles.size, SIZE):
        tile = tiles[begin : begin + SIZE]
        for k in range(LANES):
            ax, ay, az = tile[LEFT + 6 * LANES + k], tile[LEFT + 7 * LANES + k], tile[LEFT + 8 * LANES + k]
            y = ax * ux + ay * uy + az * uz
            dq = quat_multiply(_quat(y * ux, y * uy, y * uz), _quat(ax - y * ux, ay - y * uy, az - y * uz))
            rx, ry, rz = _turned_less(dq, g0, g1, g2)
            vx, vy, vz = _turned_less(dq, g3, g4, g5)
            rx += tile[LEFT + k]
            ry += tile[LEFT + LANES + k]
            rz += tile[LEFT + 2 * LANES + k]
            vx += vn + tile[LEFT + 3 * LANES + k]
            vy += ve + tile[LEFT + 4 * LANES + k]
            vz += vd + tile[LEFT + 5 * LANES + k]
            q = quat_multiply(dq, q0)
            if ecef:
                tile[k] = lat + rx
                tile[LANES + k] = lon + ry
                tile[2 * LANES + k] = h + rz
            else:
                out = p0 - s0 * rx - c0 * rz
                far = sqrt(out * out + ry * ry)
                tan = ry / (far + out)
                dp = ry * tan - s0 * rx - c0 * rz
                dz = c0 * rx - s0 * rz
                a = (c0 * dz - s0 * dp) * per_metre
                dh = c0 * dp + s0 * dz
                for _ in range(3):
                    sa, ca = _sin_cos(a)
                    mp, mz, s, c, sm, cm, _ = _meridian(sa, ca, s0, c0, w0, dh, h + dh)
                    a += (c * (dz - mz) - s * (dp - mp)) * per_metre
                    dh += c * (dp - mp) + s * (dz - mz)
                sa, ca = _sin_cos(a)
                sm, cm = s0 * ca + c0 * sa, c0 * ca - s0 * sa
                cb = 1.0 / sqrt(1.0 + tan * tan)
                sb = tan * cb
                tile[k] = lat + 2.0 * a
                tile[LANES + k] = lon + 2.0 * tan * _arctangent_ratio(tan * tan)
                tile[2 * LANES + k] = h + dh
                back = (cb * ca, -sb * cm, cb * sa, sb * sm)
                vx, vy, vz = quat_rotate(back, (vx, vy, vz))
                q = quat_multiply(back, q)
            scale = 1.0 / sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
            tile[3 * LANES + k] = vx
            tile[4 * LANES + k] = vy
            tile[5 * LANES + k] = vz
            tile[6 * LANES + k] = q[0] * scale
            tile[7 * LANES + k] = q[1] * scale
            tile[8 * LANES + k] = q[2] * scale
            tile[9 * LANES + k] = q[3] * scale
    return True


@fused
def deviations_of_tiles(reference, gone, u, ecef, tiles):
    """Deviations of all points from a reference, in the coordinates of :mod:`navfuse.mechanization.sigma_points`, into
    rows of the tiles from LEFT on; False if they are too far from it: then those mean nothing. No checks are made.
    """
    s0 = c0 = w0 = 0.0
    if not ecef:
        s0, c0 = sin(reference[0]), cos(reference[0])
        w0 = sqrt(1.0 - WGS84_E2 * s0 * s0)
    r0, r1, r2, r3, r4, r5 = reference[0], reference[1], reference[2], reference[3], reference[4], reference[5]
    ux, uy, uz = u
    g0, g1, g2, g3, g4, g5 = gone[0], gone[1], gone[2], gone[3], gone[4], gone[5]
    back = reference[6], -reference[7], -reference[8], -reference[9]
    for p in range(tiles.size // SIZE * LANES):
        at = p // LANES * SIZE + p % LANES
        if not ecef:
            b = tiles[at + LANES] - reference[1]
            b = b - TWO_PI if b > pi else (b + TWO_PI if b < -pi else b)
            if not (abs(tiles[at] - reference[0]) < 2.0 * SMALL_ARC and abs(b) < 2.0 * SMALL_ARC):
                return False
    for begin in range(0, tiles.size, SIZE):
        tile = tiles[begin : begin + SIZE]
        for k in range(LANES):
            q = (tile[6 * LANES + k], tile[7 * LANES + k], tile[8 * LANES + k], tile[9 * LANES + k])
            vx, vy, vz = tile[3 * LANES + k], tile[4 * LANES + k], tile[5 * LANES + k]
            if ecef:
                rx = tile[k] - r0
                ry = tile[LANES + k] - r1
                rz = tile[2 * LANES + k] - r2
            else:
                b = tile[LANES + k] - r1
                b = b - TWO_PI if b > pi else (b + TWO_PI if b < -pi else b)
                sa, ca = _sin_cos(0.5 * (tile[k] - r0))
                sb, cb = _sin_cos(0.5 * b)
                h = tile[2 * LANES + k]
                dp, dz, _, _, sm, cm, p = _meridian(sa, ca, s0, c0, w0, h - r2, h)
                dp -= 2.0 * p * sb * sb
                rx = c0 * dz - s0 * dp
                ry = 2.0 * p * sb * cb
                rz = -c0 * dp - s0 * dz
                turn = (cb * ca, sb * cm, -cb * sa, -sb * sm)
                vx, vy, vz = quat_rotate(turn, (vx, vy, vz))
                q = quat_multiply(turn, q)
            q = quat_multiply(q, back)
            scale = 1.0 / sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
            q = (q[0] * scale, q[1] * scale, q[2] * scale, q[3] * scale)
            gx, gy, gz = _turned_less(q, g0, g1, g2)
            fx, fy, fz = _turned_less(q, g3, g4, g5)
            tile[LEFT + k] = rx - gx
            tile[LEFT + LANES + k] = ry - gy
            tile[LEFT + 2 * LANES + k] = rz - gz
            tile[LEFT + 3 * LANES + k] = vx - r3 - fx
            tile[LEFT + 4 * LANES + k] = vy - r4 - fy
            tile[LEFT + 5 * LANES + k] = vz - r5 - fz
            along = q[1] * ux + q[2] * uy + q[3] * uz
            tan = along / q[0]
            y = 2.0 * tan * _arctangent_ratio(tan * tan)
            cy = 1.0 / sqrt(1.0 + tan * tan)
            sy = tan * cy
            t = quat_multiply((cy, -sy * ux, -sy * uy, -sy * uz), q)
            tilt = (t[1] * t[1] + t[2] * t[2] + t[3] * t[3]) / (t[0] * t[0])
            m = 2.0 / t[0] * _arctangent_ratio(tilt)
            tile[LEFT + 6 * LANES + k] = m * t[1] + y * ux
            tile[LEFT + 7 * LANES + k] = m * t[2] + y * uy
            tile[LEFT + 8 * LANES + k] = m * t[3] + y * uz
            tile[WIDTH + k] = max(tan * tan, tilt)
    close = True
    for p in range(tiles.size // SIZE * LANES):
        close = close and tiles[p // LANES * SIZE + p % LANES + WIDTH] < 0.01
    return close


@fused
def widest_rotation(tiles):
    """Largest factor and largest bias [rad/s] of the corrections of the gyro. No checks are made."""
    factor, bias = 0.0, 0.0
    for p in range(tiles.size // SIZE * LANES):
        at = p // LANES * SIZE + p % LANES + TABLE
        for i in range(9):
            factor = max(factor, abs(tiles[at + i * LANES]))
        for i in range(9, 12):
            bias = max(bias, abs(tiles[at + i * LANES]))
    return factor, bias


@fused
def step_tiles(tiles, ecef, dt, inc, push, small):
    """Advance all points by one increment of angle and velocity, each with its own corrections.

    What the increments are after correction, and the velocity increment in the frame of the navigation state, is left
    in the last rows. `small` tells that no corrected rotation is above ROTATION. No checks are made.
    """
    if not small:
        _step_singly(tiles, ecef, dt, inc, push)
        return
    lat, s_lat, c_lat = 0.0, 0.0, 0.0
    if not ecef:
        lat, s_lat, c_lat = tiles[0], sin(tiles[0]), cos(tiles[0])
    for begin in range(0, tiles.size, SIZE):
        tile = tiles[begin : begin + SIZE]
        if ecef:
            for k in range(LANES):
                theta, dv = _corrected(tile, k, dt, inc, push)
                qb = _quat(theta[0], theta[1], theta[2])
                r, v, q, f = advance_ecef(
                    tile[k], tile[LANES + k], tile[2 * LANES + k],
                    tile[3 * LANES + k], tile[4 * LANES + k], tile[5 * LANES + k],
                    tile[6 * LANES + k], tile[7 * LANES + k], tile[8 * LANES + k], tile[9 * LANES + k],
                    qb, dt, theta[0], theta[1], theta[2], dv[0], dv[1], dv[2],
                )  # fmt: skip
                _put(tile, k, r, v, q, theta, dv, f)
        else:
            for k in range(LANES):
                theta, dv = _corrected(tile, k, dt, inc, push)
                qb = _quat(theta[0], theta[1], theta[2])
                s, c = _sin_cos(tile[k] - lat)
                r, v, q, f, _, _ = advance_ned(
                    tile[k], tile[LANES + k], tile[2 * LANES + k], s_lat * c + c_lat * s, c_lat * c - s_lat * s,
                    tile[3 * LANES + k], tile[4 * LANES + k], tile[5 * LANES + k],
                    tile[6 * LANES + k], tile[7 * LANES + k], tile[8 * LANES + k], tile[9 * LANES + k],
                    qb, dt, theta[0], theta[1], theta[2], dv[0], dv[1], dv[2],
                )  # fmt: skip
                _put(tile, k, r, v, q, theta, dv, f)


@fused(inline="always")
def _corrected(tile, k, dt, inc, push):
    """Increments of lane k, corrected for its own sensor errors."""
    tx = inc[0] - tile[TABLE + 9 * LANES + k] * dt
    ty = inc[1] - tile[TABLE + 10 * LANES + k] * dt
    tz = inc[2] - tile[TABLE + 11 * LANES + k] * dt
    ux = push[0] - tile[TABLE + 21 * LANES + k] * dt
    uy = push[1] - tile[TABLE + 22 * LANES + k] * dt
    uz = push[2] - tile[TABLE + 23 * LANES + k] * dt
    return (
        tile[TABLE + k] * tx + tile[TABLE + LANES + k] * ty + tile[TABLE + 2 * LANES + k] * tz,
        tile[TABLE + 3 * LANES + k] * tx + tile[TABLE + 4 * LANES + k] * ty + tile[TABLE + 5 * LANES + k] * tz,
        tile[TABLE + 6 * LANES + k] * tx + tile[TABLE + 7 * LANES + k] * ty + tile[TABLE + 8 * LANES + k] * tz,
    ), (
        tile[TABLE + 12 * LANES + k] * ux + tile[TABLE + 13 * LANES + k] * uy + tile[TABLE + 14 * LANES + k] * uz,
        tile[TABLE + 15 * LANES + k] * ux + tile[TABLE + 16 * LANES + k] * uy + tile[TABLE + 17 * LANES + k] * uz,
        tile[TABLE + 18 * LANES + k] * ux + tile[TABLE + 19 * LANES + k] * uy + tile[TABLE + 20 * LANES + k] * uz,
    )


@fused(inline="always")
def _put(tile, k, r, v, q, theta, dv, f):
    """Write lane k."""
    tile[k] = r[0]
    tile[LANES + k] = r[1]
    tile[2 * LANES + k] = r[2]
    tile[3 * LANES + k] = v[0]
    tile[4 * LANES + k] = v[1]
    tile[5 * LANES + k] = v[2]
    tile[6 * LANES + k] = q[0]
    tile[7 * LANES + k] = q[1]
    tile[8 * LANES + k] = q[2]
    tile[9 * LANES + k] = q[3]
    tile[LEFT + k] = theta[0]
    tile[LEFT + LANES + k] = theta[1]
    tile[LEFT + 2 * LANES + k] = theta[2]
    tile[LEFT + 3 * LANES + k] = dv[0]
    tile[LEFT + 4 * LANES + k] = dv[1]
    tile[LEFT + 5 * LANES + k] = dv[2]
    tile[LEFT + 6 * LANES + k] = f[0]
    tile[LEFT + 7 * LANES + k] = f[1]
    tile[LEFT + 8 * LANES + k] = f[2]


@fused
def _step_singly(tiles, ecef, dt, inc, push):
    """:func:`step_tiles` for rotations of any size. No checks are made."""
    nav = tiles[:10].copy()
    for p in range(tiles.size // SIZE * LANES):
        tile = tiles[p // LANES * SIZE : p // LANES * SIZE + SIZE]
        k = p % LANES
        theta, dv = _corrected(tile, k, dt, inc, push)
        for i in range(10):
            nav[i] = tile[i * LANES + k]
        if ecef:
            f = step_ecef(nav, dt, theta[0], theta[1], theta[2], dv[0], dv[1], dv[2])
        else:
            f, _, _ = step_ned(nav, dt, theta[0], theta[1], theta[2], dv[0], dv[1], dv[2])
        _put(
            tile, k, (nav[0], nav[1], nav[2]), (nav[3], nav[4], nav[5]), (nav[6], nav[7], nav[8], nav[9]), theta, dv, f
        )
