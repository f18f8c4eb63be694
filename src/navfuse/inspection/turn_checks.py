"""Do gyros and course turn alike, and as much?"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from navfuse.core.constants import STANDARD_GRAVITY
from navfuse.data.logs import GnssLog, ImuLog
from navfuse.errors import InputError
from navfuse.imu.gaps import gap_limit
from navfuse.imu.increments import ImuIncrements, to_increments
from navfuse.imu.turning import ALIKE, TurnFit, check_fit, fit_turns
from navfuse.inspection.findings import Finding, Verdict

Array = np.ndarray

SCALE_OFF, SCALE_SIGMAS = 0.1, 4.0
"""Scale of the gyros that is told, if it is this significant."""


def check_turns(imu: ImuLog, gnss: GnssLog) -> tuple[Finding, float | None]:
    """Turns of gyros and course, by the rules of the run; and how late the inertial stamps are, if that is sure."""
    increments = to_increments(imu, gap_limit(imu.time))
    fit = fit_turns(increments, gnss)
    if fit is None:
        return Finding("turns", Verdict.UNKNOWN, "too few turns at speed to compare gyros and course"), None
    figures = {"ratio": fit.ratio, "lag_s": fit.lag_s, "correlation": fit.correlation}
    mirrored = _other_reading(increments, gnss, fit)
    if mirrored:
        return Finding("turns", Verdict.WRONG, *mirrored, figures=figures), None
    if abs(fit.correlation) < ALIKE:
        text = (
            f"gyros and course do not turn alike (correlation {fit.correlation:.2f}): it points elsewhere than it goes"
        )
        return Finding("turns", Verdict.UNKNOWN, text, figures=figures), None
    try:
        notes = check_fit(fit)
    except InputError as error:
        remedy = "correct signs or units of the gyro columns"
        if fit.ratio < 0.0:
            remedy += ", or the sign of the longitude or the latitude (west and south are negative)"
        return Finding("turns", Verdict.WRONG, str(error), remedy, figures=figures), None
    slope = [note for note in notes if "times as much" in note]
    if slope:
        return Finding("turns", Verdict.LOOK, slope[0], figures=figures), fit.lag_s
    text = f"the gyros turn {fit.ratio:.3f} times as much as the course (correlation {fit.correlation:.3f})"
    expected = _leaning(increments)
    scale = fit.ratio / expected
    sd = scale * float(np.sqrt(max(1.0 / fit.correlation**2 - 1.0, 0.0) / max(fit.count - 2, 1)))
    figures |= {"scale": scale, "scale_sd": sd}
    # By noise of the course alone the ratio is right, by noise of the gyros alone it is right times the correlation^2.
    low, high = scale * fit.correlation**2 - SCALE_SIGMAS * sd, scale + SCALE_SIGMAS * sd
    if (scale < 1.0 - SCALE_OFF and high < 1.0) or (scale > 1.0 + SCALE_OFF and low > 1.0):
        text += f"; {expected:.3f} is what leaning turns explain: their scale is off, {scale:.3f} give or take {sd:.2g}"
        remedy = f"divide the gyro columns by {scale:.3g}, or look up their scale"
        return Finding("turns", Verdict.LOOK, text, remedy, figures=figures), fit.lag_s
    return Finding("turns", Verdict.OK, text, figures=figures), fit.lag_s


def _other_reading(increments: ImuIncrements, gnss: GnssLog, fit: TurnFit) -> tuple[str, str] | None:
    """Message and remedy if the course agrees with the gyros only if the positions are read otherwise."""
    if fit.correlation > 0.97 and gnss.velocity_n is None and abs(fit.ratio - 1.0) < 0.3:
        return None
    if gnss.velocity_n is not None or (fit.correlation > ALIKE and abs(fit.ratio - 1.0) < 0.3):
        return None
    half = np.pi / 2.0
    trials = {}
    if (np.abs(gnss.lon) <= half).all():
        trials["latitude and longitude are exchanged"] = (
            replace(gnss, lat=gnss.lon, lon=gnss.lat), "exchange the names of the two columns")  # fmt: skip
    degrees = 180.0 / np.pi
    if (np.abs(gnss.lat) * degrees <= half).all():
        trials["the latitude is in radians"] = (replace(gnss, lat=gnss.lat * degrees), "rename it to 'lat_rad'")
    if (np.abs(gnss.lon) * degrees <= 2.0 * np.pi).all():
        trials["the longitude is in radians"] = (replace(gnss, lon=gnss.lon * degrees), "rename it to 'lon_rad'")
    best: tuple[float, str, str] = (max(abs(fit.correlation) + 0.02, ALIKE), "", "")
    for words, (log, remedy) in trials.items():
        other = fit_turns(increments, log)
        if other is not None and other.correlation > best[0] and abs(other.ratio - 1.0) < 0.3:
            best = (other.correlation, words, remedy)
    if not best[1]:
        return None
    return (
        f"the positions turn as the gyros do only if {best[1]}: correlation {best[0]:.3f} "
        f"instead of {fit.correlation:.3f}",
        best[2],
    )


def _leaning(increments: ImuIncrements) -> float:
    """Share of the turns about the vertical that is seen about the direction of specific force, 0..1.

    The turns are compared about that direction, which leans by the angle of a coordinated bank, or by the same angle
    in a vehicle that is pushed sideways: the cosine of both is g over the specific force. Weighted as the fit does, by
    the square of the turns about the vertical.
    """
    time = increments.time
    edges = np.unique(np.searchsorted(time, np.arange(time[0], time[-1], 1.0)))
    if edges.size < 3:
        return 1.0
    span = np.diff(time[edges])[:, None]
    totals = [
        np.diff(np.vstack((np.zeros((1, 3)), np.cumsum(rows, axis=0)))[edges], axis=0) / span
        for rows in (increments.inc_theta_b, increments.inc_v_b)
    ]
    rate, force = totals[0] - np.median(totals[0], axis=0), totals[1]
    size = np.linalg.norm(force, axis=1)
    use = size > 0.5 * STANDARD_GRAVITY
    if not use.any():
        return 1.0
    seen = np.sum(rate[use] * force[use], axis=1) / size[use]
    cosine = np.minimum(STANDARD_GRAVITY / size[use], 1.0)
    power = np.sum((seen / cosine) ** 2)
    return float(np.sum(seen**2 / cosine) / power) if power > 0.0 else 1.0
