"""Improving a start with the filter and the smoother themselves, when a log is at hand as a whole.

A filter is linear about its own estimate. Begun 20 deg off in heading it learns the wrong things first, and the
smoother, linear about the filter, cannot undo that. So a rough start is replaced by its smoothed value, and the
filter begins anew from there. Where nothing tells the heading beforehand, filters with headings all around are tried,
and the likeliest is kept.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from navfuse.aiding.base import AidingSensor
from navfuse.core.rotation import euler_from_quat, quat_from_euler
from navfuse.data.layout import NAVIGATION_STATES
from navfuse.data.start import Start, euler_axes
from navfuse.errors import FilterError
from navfuse.filters.ekf import ErrorStateFilter
from navfuse.filters.settings import FilterSettings
from navfuse.imu.alignment import Alignment
from navfuse.imu.error_model import ImuErrorModel
from navfuse.imu.first_fix import TWICE_USED
from navfuse.imu.increments import ImuIncrements
from navfuse.smoothers.rts import smooth

Array = np.ndarray

ROUGH_HEADING_SD, ROUGH_LEVEL_SD, MIN_ATTITUDE_SD = np.radians([4.0, 1.5, 0.5])
SEARCH_HEADING_SD = np.radians(15.0)
FAR = np.radians(3.0)
"""An attitude that the smoother moves further than this is smoothed once more, from where it was moved to."""
REFINE_S = 120.0
HEADINGS = 12
HEADING_SPACING_SD = np.radians(20.0)
SEARCH_S = 600.0
MOST_NIS = 33.0
"""Per component: what an outlier may count."""
APART, CLEARLY = np.radians(75.0), 8.0
"""By how much the log-likelihood of the best heading must exceed that of any other further away than APART."""


def improve_start(
    alignment: Alignment,
    increments: ImuIncrements,
    model: ImuErrorModel,
    sensors: Sequence[AidingSensor],
    settings: FilterSettings,
) -> Alignment:
    """Replace a start whose heading or level is rough by a better one.

    Parameters
    ----------
    alignment : Alignment
    increments : ImuIncrements
        From the start on.
    model : ImuErrorModel
    sensors : sequence of AidingSensor
    settings : FilterSettings

    Returns
    -------
    Alignment
        The one given, if it is good, was given by the user, or if nothing better can be found. The standard
        deviations of an improved attitude are three times those of the smoother, since the filter is going to use the
        same measurements again; an angle or bias that this would not make better known stays as it was.
    """
    trial = replace(settings, output_period=-1.0, checkpoints=True, open_loop=False)
    sd = np.sqrt(np.diagonal(alignment.start.P)[6:9])
    measured = alignment.heading_source in ("motion", "course")
    if alignment.heading_source == "unknown" or (measured and sd[2] > SEARCH_HEADING_SD):
        found = _likeliest_heading(alignment.start, increments, model, sensors, trial)
        if found is not None:
            notes = tuple(note for note in alignment.notes if not note.startswith("heading could not be found"))
            start = _smoothed_start(found, increments, model, sensors, trial)
            return replace(alignment, start=start, heading_source="search", notes=notes)
    rough = sd[2] > ROUGH_HEADING_SD or max(sd[:2]) > ROUGH_LEVEL_SD
    if not measured or not rough:
        return alignment
    return replace(alignment, start=_smoothed_start(alignment.start, increments, model, sensors, trial))


def _smoothed_start(
    start: Start,
    increments: ImuIncrements,
    model: ImuErrorModel,
    sensors: Sequence[AidingSensor],
    settings: FilterSettings,
) -> Start:
    """The start, smoothed once, or smoothed again from there, whichever the measurements are likeliest for.

    Far off, the smoother can be wrong by many of its own standard deviations.
    """
    starts = [start, _smoothed_once(start, increments, model, sensors, settings)]
    if _turn_between(start.nav[6:10], starts[1].nav[6:10]) > FAR:
        again = replace(starts[1], P=start.P, states=start.states)
        starts.append(_smoothed_once(again, increments, model, sensors, settings))
    head = _first(increments, REFINE_S)
    scores = [_log_likelihood(one, head, model, sensors, settings) for one in starts]
    return starts[int(np.argmax(scores))]


def _turn_between(p: Array, q: Array) -> float:
    """Angle [rad] between two attitudes."""
    return 2.0 * float(np.arccos(min(1.0, abs(float(p @ q)))))


def _smoothed_once(
    start: Start,
    increments: ImuIncrements,
    model: ImuErrorModel,
    sensors: Sequence[AidingSensor],
    settings: FilterSettings,
) -> Start:
    head = _first(increments, REFINE_S)
    trial = ErrorStateFilter(start, model, sensors, settings)
    before, given = trial.P.copy(), trial.s.copy()
    try:
        trial.feed(head)
    except FilterError:
        return start
    run = smooth(trial, head)
    euler, P = _better_attitude(start, run.start[6:9], run.start[15:18])
    nav = np.concatenate([run.start[:6], quat_from_euler(*euler)])
    states = dict(start.states)
    if "gyro_bias" in trial.layout:
        whole = trial.layout.slice("gyro_bias")
        where = slice(whole.start - NAVIGATION_STATES, whole.stop - NAVIGATION_STATES)
        sd, given_sd = TWICE_USED * run.state_sd[0, where], np.sqrt(np.diagonal(before)[whole])
        better = sd < given_sd
        value = np.where(better, run.state_value[0, where], given[where])
        states["gyro_bias"] = (value, np.where(better, sd, given_sd))
    return replace(start, nav=nav, P=P, states=states)


def _better_attitude(start: Start, smoothed: Array, smoothed_sd: Array) -> tuple[Array, Array]:
    """Roll, pitch, heading and P of a start, each angle from the smoother where that tells it far better.

    Where the log says little, using it twice would only move the angle twice as far.
    """
    euler = np.array(euler_from_quat(start.nav[6:10]))
    to_euler = np.linalg.inv(euler_axes(*euler))
    given_sd = np.sqrt(np.diagonal(to_euler @ start.P[6:9, 6:9] @ to_euler.T))
    sd = np.maximum(TWICE_USED * smoothed_sd, MIN_ATTITUDE_SD)
    better = sd < given_sd
    euler = np.where(better, smoothed, euler)
    J = euler_axes(*euler)
    P = start.P.copy()
    P[6:9, 6:9] = J @ np.diag(np.where(better, sd, given_sd) ** 2) @ J.T
    return euler, P


def _likeliest_heading(
    start: Start,
    increments: ImuIncrements,
    model: ImuErrorModel,
    sensors: Sequence[AidingSensor],
    settings: FilterSettings,
) -> Start | None:
    """The start with the likeliest of headings all around, None if the log prefers none clearly."""
    head = _first(increments, SEARCH_S)
    roll, pitch, _ = euler_from_quat(start.nav[6:10])
    headings = 2.0 * np.pi * np.arange(HEADINGS) / HEADINGS
    starts, scores = [], []
    for heading in headings:
        P = start.P.copy()
        J = euler_axes(roll, pitch, heading)
        level = np.sqrt(max(start.P[6, 6], start.P[7, 7]))
        P[6:9, 6:9] = J @ np.diag(np.array([level, level, HEADING_SPACING_SD]) ** 2) @ J.T
        nav = np.concatenate([start.nav[:6], quat_from_euler(roll, pitch, heading)])
        starts.append(replace(start, nav=nav, P=P))
        scores.append(_log_likelihood(starts[-1], head, model, sensors, settings))
    best = int(np.argmax(scores))
    apart = np.abs((headings - headings[best] + np.pi) % (2.0 * np.pi) - np.pi) > APART
    if not np.isfinite(scores[best]) or scores[best] - np.max(np.array(scores)[apart]) < CLEARLY:
        return None
    return starts[best]


def _log_likelihood(
    start: Start,
    increments: ImuIncrements,
    model: ImuErrorModel,
    sensors: Sequence[AidingSensor],
    settings: FilterSettings,
) -> float:
    """Log-likelihood of all measurements, up to a constant; minus infinity for a filter that breaks down."""
    trial = ErrorStateFilter(start, model, sensors, replace(settings, gated=False, checkpoints=False))
    try:
        trial.feed(increments)
    except FilterError:
        return -np.inf
    return -0.5 * sum(
        min(entry.nis, MOST_NIS * entry.z.size) + float(np.linalg.slogdet(entry.S)[1])
        for entry in trial.record.innovations
        if entry.status == "used"
    )


def _first(increments: ImuIncrements, length: float) -> ImuIncrements:
    last = int(np.searchsorted(increments.time, increments.time[0] + length))
    return increments.piece(0, min(last, len(increments)))
