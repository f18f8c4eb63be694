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
SEARCH_HEADING_SD = np.radians(30.0)
FAR = np.radians(3.0)
"""An attitude that the smoother moves further than this is smoothed once more, from where it was moved to."""
REFINE_S = 120.0
HEADINGS = 12
HEADING_SPACING_SD = np.radians(20.0)
SEARCH_S = 600.0
MOST_NIS = 100.0
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
        same measurements again.
    """
    trial = replace(settings, output_period=-1.0, checkpoints=True, open_loop=False)
    sd = np.sqrt(np.diagonal(alignment.start.P)[6:9])
    measured = alignment.heading_source in ("motion", "course")
    if alignment.heading_source == "unknown" or (measured and sd[2] > SEARCH_HEADING_SD):
        found = _likeliest_heading(alignment.start, increments, model, sensors, trial)
        if found is None:
            return alignment
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
    once = _smoothed_once(start, increments, model, sensors, settings)
    if _turn_between(start.nav[6:10], once.nav[6:10]) < FAR:
        return once
    return _smoothed_once(replace(once, P=start.P), increments, model, sensors, settings)


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
    try:
        trial.feed(head)
    except FilterError:
        return start
    run = smooth(trial, head)
    row = run.start
    nav = np.concatenate([row[:6], quat_from_euler(*row[6:9])])
    J = euler_axes(*row[6:9])
    P = start.P.copy()
    P[6:9, 6:9] = J @ np.diag(np.maximum(TWICE_USED * row[15:18], MIN_ATTITUDE_SD) ** 2) @ J.T
    states = dict(start.states)
    if "gyro_bias" in trial.layout:
        where = slice(
            *(
                i - NAVIGATION_STATES
                for i in (trial.layout.slice("gyro_bias").start, trial.layout.slice("gyro_bias").stop)
            )
        )
        states["gyro_bias"] = (run.state_value[0, where], TWICE_USED * run.state_sd[0, where])
    return replace(start, nav=nav, P=P, states=states)


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
        min(entry.nis, MOST_NIS) + 2.0 * float(np.log(entry.sd).sum())
        for entry in trial.record.innovations
        if entry.status == "used"
    )


def _first(increments: ImuIncrements, length: float) -> ImuIncrements:
    last = int(np.searchsorted(increments.time, increments.time[0] + length))
    return increments.piece(0, min(last, len(increments)))
