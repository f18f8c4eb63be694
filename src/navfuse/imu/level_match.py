"""The shift of time at which levelled inertial data and GNSS see the same acceleration.

In a stretch of half a minute, with everything horizontal as complex numbers,

    seen(t) = polynomial(t) + z A(t - offset) + z l . L(t - offset)

where `A` is the specific force integrated once (or twice, where only positions were seen), `L` what a lever arm `l`
adds to it, and the complex `z` turns the frame of the gyroscopes to north. Its modulus is 1; least squares leave it
free, for scale factors. The polynomial, of second (third) degree,
takes the state at the start, the error of levelling, biases, and their growth. Nothing is assumed about the mounting,
the vehicle, or where it points; of the logs, only that gyroscopes and accelerometers are of one right-handed triad.

The offset is searched for at steps of 0.1 s by the likelihood of every stretch with its own noise, then found together
with the lever arm by least squares. Its standard deviation comes from the sums of scores over time (Newey and West
1987), so that neither the sigmas of the fixes nor their independence is relied on.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from navfuse.imu.level_kernels import correlate, read_rows
from navfuse.imu.seen_motion import Array, ChainedMotion, Stretches, error_integrals

LAG_STEP_S = 0.1
SLOPE_S = 0.05
LEVER_SD, GYRO_SD, ACCEL_SD = 1.5, np.radians(1.0), 0.3
"""Lever arm [m], biases [rad/s], [m/s^2] that are expected; with them known, the offset would be known better."""
PRIOR_SD = np.repeat([np.inf, LEVER_SD, GYRO_SD, ACCEL_SD], [1, 3, 3, 3])
CORRELATED_S = 5.0
"""Errors of fixes further apart than this are taken as independent."""
SHRINK = 10.0
ITERATIONS = 10
FURTHEST_S = 0.5
"""From the best shift of the scan to where least squares may go."""
FLOOR = 1e-10
FLOOR_SD_S = 0.002
"""What is left to scale factors, changing biases and interpolation, for fixes of centimetres."""


@dataclass(frozen=True, slots=True)
class Match:
    """Stretches of one log, what they ask of the other, and how they are levelled."""

    motion: ChainedMotion
    rows: Stretches
    basis: Array
    nuisance: Array

    @property
    def freedom(self) -> Array:
        """Real degrees of freedom (w,) of every stretch, offset and lever arm not counted."""
        rows = np.count_nonzero(self.rows.weight, axis=1)
        return 2.0 * np.maximum(rows - self.nuisance.shape[2] - 1, 0)


@dataclass(frozen=True, slots=True)
class Scan:
    """How well the logs agree at every shift.

    Attributes
    ----------
    lags : (k,) array [s]
    deviance : (k,) array
        -2 log likelihood against "they have nothing in common".
    correlation : (k,) array
        0..1, root of the share of what GNSS saw that the inertial data explain, over all stretches.
    alike : (k,) array
        The same if in every stretch they may be of any scale, which two logs that have nothing in common can profit by.
    """

    lags: Array
    deviance: Array
    correlation: Array
    alike: Array


@dataclass(frozen=True, slots=True)
class Fit:
    """Least squares about the best shift.

    Attributes
    ----------
    offset, sd : float [s]
    lever, sd_lever : (3,) arrays [m]
        In the axes of the log, sensor to antenna, with a prior of LEVER_SD.
    modulus : float
        |z| over all; 1 if units are right.
    inflation : float
        Of variances, by the correlation of the residuals in time.
    """

    offset: float
    sd: float
    lever: Array
    sd_lever: Array
    modulus: float
    inflation: float


def prepare(motion: ChainedMotion, rows: Stretches) -> Match:
    """Level every stretch by its mean specific force, and make its polynomials."""
    begin, end = rows.time[:, 0], rows.time[:, -1]
    up = _read(motion.time, motion.velocity_l, end) - _read(motion.time, motion.velocity_l, begin)
    up /= np.linalg.norm(up, axis=1)[:, None]
    least = np.eye(3)[np.argmin(np.abs(up), axis=1)]
    first = np.cross(up, least)
    first /= np.linalg.norm(first, axis=1)[:, None]
    basis = np.stack([first, np.cross(first, up)], axis=1)
    span = np.maximum(end - begin, 1e-9)[:, None]
    x = (2.0 * rows.time - (begin + end)[:, None]) / span
    degree = 3 if rows.positions else 2
    powers = x[:, :, None] ** np.arange(degree + 1) * rows.weight[:, :, None]
    nuisance = np.linalg.qr(powers)[0] if len(x) else powers
    return Match(motion, rows, basis, nuisance)


def scan(match: Match, lags: Array) -> tuple[Scan, Scan]:
    """Compare at every shift, as the axes are and mirrored. `lags` are offsets to be added to the inertial stamps."""
    seen = _detrended(match, match.rows.seen)
    total = _power(seen)
    freedom = match.freedom
    floor = FLOOR * total + 1e-12
    rows = match.rows
    shape = (lags.size, rows.time.shape[0])
    power, products = np.empty(shape), np.empty((2, *shape), complex)
    correlate(
        match.motion.time, _integral(match), match.basis, rows.time, rows.weight, match.nuisance, seen, lags, power,
        products[0], products[1],
    )  # fmt: skip
    sizes = np.abs(products)
    rest = np.maximum(total - 2.0 * sizes + power, 0.0)
    deviance = np.log((rest + floor) / (total + floor)) @ freedom
    everything = max(float(total.sum()), 1e-12)
    correlation = np.sqrt(np.clip(1.0 - rest.sum(axis=2) / everything, 0.0, 1.0))
    alike = np.sqrt(np.clip((sizes**2 / np.maximum(power, 1e-12)).sum(axis=2) / everything, 0.0, 1.0))
    plain, mirrored = (Scan(lags, deviance[way], correlation[way], alike[way]) for way in (0, 1))
    return plain, mirrored


def refine(match: Match, offset: float) -> Fit:
    """Offset, lever arm and biases by least squares from a first offset."""
    seen = _detrended(match, match.rows.seen)
    freedom = match.freedom
    prior = PRIOR_SD**-2.0
    errors = error_integrals(match.motion, match.rows.positions)
    begun, extra = offset, np.zeros(PRIOR_SD.size - 1)
    for _ in range(ITERATIONS):
        added = _additions(match, errors, offset)
        A = _detrended(match, _signal(match, offset)) + np.einsum("j,jwm->wm", extra, added)
        late, early = (_at_antenna(match, offset + h, extra[:3]) for h in (SLOPE_S, -SLOPE_S))
        slope = _detrended(match, (late - early) / (2.0 * SLOPE_S))
        power = np.maximum(_power(A), 1e-12)
        z = np.sum(A.conj() * seen, axis=1) / power
        left = seen - z[:, None] * A
        usual = max(float(_power(left).sum() / max(freedom.sum(), 1.0)), 1e-18)
        noise = np.sqrt((_power(left) + SHRINK * usual) / (freedom + SHRINK))[:, None]
        X = np.stack([z[:, None] * column for column in (slope, *added)], axis=2)
        X -= A[:, :, None] * (np.einsum("wm,wmj->wj", A.conj(), X) / power[:, None])[:, None, :]
        X, e = X / noise[:, :, None], left / noise
        gram = np.einsum("wmi,wmj->ij", X.conj(), X).real
        pull = np.einsum("wmi,wm->i", X.conj(), e).real - prior * np.concatenate([[0.0], extra])
        step = np.linalg.solve(gram + np.diag(prior + 1e-12), pull)
        offset = float(np.clip(offset + step[0], begun - FURTHEST_S, begun + FURTHEST_S))
        extra = extra + step[1:]
        if abs(step[0]) < 1e-4 and np.max(np.abs(step[1:4])) < 1e-2:
            break
    inverse = np.linalg.inv(gram + np.diag(prior + 1e-12))
    long_run = _long_run(np.real(X.conj() * e[:, :, None]), match.rows)
    variance = np.maximum(*(np.diag(inverse @ (S + np.diag(prior)) @ inverse) for S in (gram, long_run)))
    return Fit(
        offset=offset,
        sd=float(np.hypot(np.sqrt(variance[0]), FLOOR_SD_S)),
        lever=extra[:3],
        sd_lever=np.sqrt(variance[1:4]),
        modulus=float(np.sum(power * np.abs(z)) / np.sum(power)),
        inflation=_inflation(e, match.rows),
    )


def stretch_phases(match: Match, offset: float) -> tuple[Array, Array]:
    """What turns the frame of every stretch to north, and how well it is known.

    Returns
    -------
    phase : (w,) complex array
        Of modulus 1.
    coherence : (w,) array
        0..1, the squared correlation of accelerations in it.
    """
    seen = _detrended(match, match.rows.seen)
    A = _detrended(match, _signal(match, offset))
    product = np.sum(A.conj() * seen, axis=1)
    known = np.abs(product) ** 2 / np.maximum(_power(A) * _power(seen), 1e-30)
    return np.exp(1j * np.angle(product)), known


def _integral(match: Match) -> Array:
    return match.motion.place_l if match.rows.positions else match.motion.velocity_l


def _signal(match: Match, lag: float) -> Array:
    return _horizontal(match, _integral(match), lag)


def _at_antenna(match: Match, lag: float, lever: Array) -> Array:
    arms = match.motion.axes_l if match.rows.positions else match.motion.swing_l
    return _horizontal(match, _integral(match) + np.einsum("j,jnk->nk", lever, arms), lag)


def _additions(match: Match, errors: tuple[Array, Array, Array], lag: float) -> Array:
    """What a metre of lever arm, and a unit of bias of gyroscopes and accelerometers, add to the signal (9, w, m)."""
    motion, positions = match.motion, match.rows.positions
    turned, by_gyro, by_accel = errors
    middle = 0.5 * (match.rows.time[:, 0] + match.rows.time[:, -1]) - lag
    at = match.rows.time - lag
    integral = _read(motion.time, _integral(match), at)
    levers = [_horizontal(match, axis, lag) for axis in (motion.axes_l if positions else motion.swing_l)]
    gyros = []
    for turn, added in zip(turned, by_gyro, strict=True):
        known = np.cross(_read(motion.time, turn, middle)[:, None, :], integral)
        gyros.append(_level(match, _read(motion.time, added, at) - known))
    accels = [_horizontal(match, added, lag) for added in by_accel]
    return np.stack([_detrended(match, column) for column in (*levers, *gyros, *accels)])


def _horizontal(match: Match, values: Array, lag: float) -> Array:
    """Read a vector of the frame L at the stamps of the fixes less a lag; forward + i right of each stretch."""
    return _level(match, _read(match.motion.time, values, match.rows.time - lag))


def _level(match: Match, read: Array) -> Array:
    level = np.einsum("wmk,wik->wmi", read, match.basis)
    return level[..., 0] + 1j * level[..., 1]


def _read(time: Array, values: Array, at: Array) -> Array:
    out = np.empty((at.size, 3))
    read_rows(time, np.ascontiguousarray(values), at.ravel(), out)
    return out.reshape(*at.shape, 3)


def _detrended(match: Match, values: Array) -> Array:
    weighted = values * match.rows.weight
    along = np.einsum("wmp,wm->wp", match.nuisance, weighted)
    return weighted - np.einsum("wmp,wp->wm", match.nuisance, along)


def _power(values: Array) -> Array:
    return np.sum(np.real(values) ** 2 + np.imag(values) ** 2, axis=1)


def _reach(rows: Stretches) -> int:
    """Rows within CORRELATED_S."""
    steps = np.diff(rows.time, axis=1)
    usual = float(np.median(steps[steps > 0.0])) if np.any(steps > 0.0) else CORRELATED_S
    return max(1, min(round(CORRELATED_S / usual), rows.time.shape[1] // 3))


def _long_run(scores: Array, rows: Stretches) -> Array:
    """Variance of the sum of scores (w, m, p) that are correlated in time, with Bartlett's weights."""
    reach = _reach(rows)
    found = np.einsum("wmi,wmj->ij", scores, scores)
    for j in range(1, reach + 1):
        cross = np.einsum("wmi,wmj->ij", scores[:, j:], scores[:, :-j])
        found += (1.0 - j / (reach + 1)) * (cross + cross.T)
    return found


def _inflation(e: Array, rows: Stretches) -> float:
    """Sum of the correlations of the residuals in time, up to where they vanish; at least 1."""
    power = _power(e).sum()
    total = 1.0
    for j in range(1, _reach(rows) + 1):
        r = float(np.sum(e[:, j:].conj() * e[:, :-j]).real / max(power, 1e-30))
        if r < 0.05:
            break
        total += 2.0 * r
    return total
