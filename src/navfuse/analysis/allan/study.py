"""The whole analysis of a static record: check, curves, noise terms, recommended filter settings."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from navfuse.analysis.allan import notes as remarks
from navfuse.analysis.allan.deviations import KINDS, curve_of_phases
from navfuse.analysis.allan.identify import SHORTEST, Identification, identify_and_bridge
from navfuse.analysis.allan.noise_types import types_of_model
from navfuse.analysis.allan.phase import phase_stretches
from navfuse.analysis.allan.precheck import StaticSpan, check_channel, static_span, without_held
from navfuse.analysis.allan.recommend import BiasModel, bias_model
from navfuse.analysis.allan.results import AllanStudy, AxisStudy, StudySettings
from navfuse.analysis.allan.spectra import autocorrelation, power_spectrum
from navfuse.analysis.allan.terms import RANDOM_TERMS
from navfuse.errors import ConfigError, InputError
from navfuse.io.static_record import StaticRecord

Array = np.ndarray

MOST_MOVING = 0.5
"""Share of a record in motion beyond which it is refused."""

_UPPER = 1.645
"""Sigmas above a rate random walk that it exceeds in 5 % of all records."""

_FAR = 1e15
"""Samples; more than any record has."""


def study(
    record: StaticRecord,
    settings: StudySettings | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> AllanStudy:
    """Analyse a record of a sensor at rest.

    Parameters
    ----------
    record : StaticRecord
    settings : StudySettings, optional
    progress : callable, optional
        Called with a stage and the fraction of it that is done.

    Returns
    -------
    AllanStudy

    Raises
    ------
    InputError
        If the record moves for most of its time (or at all, if so asked), an axis is constant, samples are missing
        while that is refused, or the record is too short for what is asked.
    ConfigError
        For settings out of range.
    """
    settings = settings or StudySettings()
    _check_settings(settings)
    part = _part(record, settings)
    notes = list(record.notes)
    for channel in part.channels:
        if _constant(channel.values):
            raise InputError(
                f"{part.source}: {channel.name} is constant: the channel is not connected, or stuck; leave it out or "
                "record anew"
            )
    rest = _rest(part, settings, notes)
    used = part.between(rest.begin, rest.end)
    if settings.longest_s is not None and settings.longest_s * part.rate > (rest.end - rest.begin) / 2:
        raise InputError(
            f"{part.source}: an averaging time of {settings.longest_s:g} s needs a record of twice that; there are "
            f"{(rest.end - rest.begin) / part.rate:.6g} s at rest"
        )
    if settings.longest_s is not None and settings.longest_s * part.rate < 1.0:
        raise InputError(
            f"{part.source}: a longest averaging time of {settings.longest_s:g} s is shorter than the sampling "
            f"interval, {1.0 / part.rate:.6g} s"
        )
    axes = []
    for k, channel in enumerate(used.channels):
        axes.append(_axis(used, channel, settings))
        notes += remarks.of_axis(part.source, channel.name, axes[-1], used)
        if progress:
            progress("axes", (k + 1) / len(used.channels))
    span = (rest.end - rest.begin) / part.rate
    models = {sensor: _bias(axes, sensor, span, settings.horizon_s) for sensor in ("gyro", "accel")}
    notes += remarks.of_turning(axes, part.source) + remarks.of_drift(used, axes)
    return AllanStudy(
        part.source, part.rate, span, used.start, part.kind, rest, tuple(axes), models["gyro"], models["accel"],
        settings, tuple(dict.fromkeys(notes)),
    )  # fmt: skip


def _constant(values: Array) -> bool:
    there = np.isfinite(values)
    low = np.min(values, where=there, initial=math.inf)
    return not low < np.max(values, where=there, initial=-math.inf)


def _check_settings(settings: StudySettings) -> None:
    unknown = [kind for kind in settings.kinds if kind not in KINDS]
    if unknown or not settings.kinds:
        raise ConfigError(f"unknown deviation {', '.join(unknown) or '(none)'}: known are {', '.join(KINDS)}")
    if not 0.0 < settings.level < 1.0:
        raise ConfigError(f"level = {settings.level} must be a probability between 0 and 1")
    for name in ("horizon_s", "longest_s"):
        value = getattr(settings, name)
        if value is not None and not (math.isfinite(value) and value > 0.0):
            raise ConfigError(f"{name.removesuffix('_s')} = {value} must be a finite number of seconds > 0")
    for name in ("from_s", "until_s"):
        value = getattr(settings, name)
        if value is not None and not (math.isfinite(value) and value >= 0.0):
            raise ConfigError(f"{name} = {value} must be a finite number of seconds, 0 or more")


def _part(record: StaticRecord, settings: StudySettings) -> StaticRecord:
    size = record.channels[0].values.size
    begin = 0 if settings.from_s is None else round(min(settings.from_s * record.rate, _FAR))
    end = size if settings.until_s is None else round(min(settings.until_s * record.rate, _FAR))
    if not 0 <= begin < min(end, size):
        raise InputError(
            f"{record.source}: the part from {begin / record.rate:g} to {end / record.rate:g} s is not in the record, "
            f"which is {size / record.rate:g} s long"
        )
    part = record.between(begin, min(end, size))
    if part.channels[0].values.size < SHORTEST:
        raise InputError(
            f"{record.source}: {part.channels[0].values.size} samples are too short a record: at least {SHORTEST} are "
            "needed to identify noise"
        )
    return part


def _rest(part: StaticRecord, settings: StudySettings, notes: list[str]) -> StaticSpan:
    size = part.channels[0].values.size
    if settings.motion == "ignore":
        return StaticSpan(0, size, 0.0, 0.0, ())
    rest = static_span([(channel.sensor, channel.values) for channel in part.channels], part.rate)
    if rest.shaken > 0.0:
        notes.append(
            f"{part.source}: its noise stands out in {100.0 * rest.shaken:.2g} % of the seconds, as from steps "
            f"or traffic; the "
            "sensor stays where it is, and the noise is part of what is found"
        )
    if not rest.windows:
        return rest
    seconds = [f"{a / part.rate:.6g} to {b / part.rate:.6g}" for a, b in rest.windows]
    told = f"{part.source}: it moves for {100.0 * rest.moving:.1f} % of the record, at {', '.join(seconds)} s"
    kept = rest.end - rest.begin
    if settings.motion == "refuse" or rest.moving > MOST_MOVING or kept < max(SHORTEST, 0.2 * size):
        raise InputError(
            f"{told} from its start; Allan variance needs a sensor at rest: cut the record with --from-s and --until-s"
            + ("" if settings.motion == "refuse" else ", or say --motion ignore if it was at rest")
        )
    notes.append(
        f"{told} from its start; only the longest part at rest is used, {rest.begin / part.rate:.6g} to "
        f"{rest.end / part.rate:.6g} s"
    )
    return rest


def _axis(record: StaticRecord, channel: Any, settings: StudySettings) -> AxisStudy:
    check = check_channel(channel.values, record.rate)
    values = without_held(channel.values, check)
    good = np.isfinite(values)
    missing = int(values.size - np.count_nonzero(good))
    if missing and settings.gaps == "refuse":
        raise InputError(
            f"{record.source}: {channel.name}: {missing} samples are "
            f"missing{' or stuck' if check.held else ''}, the first "
            f"{int(np.argmin(good)) / record.rate:.6g} s "
            "from the start; --gaps split averages over the stretches between"
        )
    try:
        found, whole = identify_and_bridge(values, record.rate, settings.terms, settings.flicker_band)
    except InputError as error:
        raise InputError(f"{record.source}: {channel.name}: {error}") from error
    phases = phase_stretches(values, record.rate)
    curves = {
        kind: curve_of_phases(
            phases, record.rate, kind, grid=settings.grid, level=settings.level, longest_s=settings.longest_s,
            alpha=types_of_model(lambda tau: _random_part(found, tau)),
        )
        for kind in settings.kinds
    }  # fmt: skip
    del phases
    return AxisStudy(
        channel.name,
        channel.sensor,
        float(values.mean(where=good)),
        float(values.std(where=good)),
        curves,
        found,
        check,
        power_spectrum(whole, record.rate),
        autocorrelation(whole, record.rate, average=max(1.0 / record.rate, whole.size / record.rate / 4000.0)),
        missing,
    )


def _random_part(found: Identification, tau: Array) -> Array:
    """Allan variance of the random terms of a fit, NaN at averaging times too short for it."""
    names = [term.name for term in found.terms if term.present and term.name in (*RANDOM_TERMS, "GM")]
    total = np.sum([np.zeros(tau.size), *(found.allan_variance(tau, name) for name in names)], axis=0)
    return np.where((total > 0.0) & (tau * found.highest >= 1.0), total, np.nan)


def _bias(axes: Sequence[AxisStudy], sensor: str, span: float, horizon: float) -> BiasModel | None:
    mine = [axis for axis in axes if axis.sensor == sensor]
    if not mine:
        return None
    tau = np.geomspace(1.0, max(10.0, 2.0 * horizon), 200)
    slow: list[Array | None] = []
    white, most = [], []
    for axis in mine:
        found = axis.identification
        used = () if axis.check.clipped else ("B", "K", "GM")
        parts = [found.allan_variance(tau, name) for name in used if _has(found, name)]
        slow.append(np.sum(parts, axis=0) if parts else None)
        white.append(found.term("N").value if _has(found, "N") else 0.0)
        most.append(largest_walk(found))
    return bias_model(slow, white, tau, min(horizon, max(0.25 * span, 4.0)), most)


def largest_walk(found: Identification) -> float:
    """Rate random walk that a record allows: the upper value of K, or its limit; inf where nothing is known of it."""
    walks = [term for term in found.terms if term.name == "K"]
    upper = next((term.value + _UPPER * term.sigma if term.present else term.limit for term in walks), math.inf)
    return math.inf if math.isnan(upper) else upper


def _has(found: Identification, name: str) -> bool:
    """Whether a term is seen, in a record long enough to take it for a setting."""
    return any(term.name == name and term.present and not found.too_short(term) for term in found.terms)
