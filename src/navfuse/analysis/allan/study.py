"""The whole analysis of a static record: check, curves, noise terms, recommended filter settings."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from navfuse.analysis.allan.deviations import KINDS, DeviationCurve, curve_of_phases
from navfuse.analysis.allan.identify import SHORTEST, Identification, identify
from navfuse.analysis.allan.noise_types import types_of_model
from navfuse.analysis.allan.phase import phase_stretches
from navfuse.analysis.allan.precheck import ChannelCheck, StaticSpan, check_channel, static_span
from navfuse.analysis.allan.recommend import HORIZON, BiasModel, bias_model
from navfuse.analysis.allan.spectra import Autocorrelation, PowerSpectrum, autocorrelation, power_spectrum
from navfuse.analysis.allan.terms import RANDOM_TERMS
from navfuse.errors import ConfigError, InputError
from navfuse.io.static_record import StaticRecord

Array = np.ndarray

MOST_MOVING = 0.5
"""Share of a record in motion beyond which it is refused."""

TURNS = math.radians(5.0)
"""Mean rate [rad/s] beyond which a record is asked whether it turns."""

_FAR = 1e15
"""Samples; more than any record has."""

DEFAULT_TERMS = ("Q", "N", "B", "K", "R")


@dataclass(frozen=True, slots=True)
class StudySettings:
    """What to compute.

    Attributes
    ----------
    kinds : tuple of str
        Deviations, keys of :data:`~navfuse.analysis.allan.deviations.KINDS`; the first is drawn and compared with the
        model.
    grid : str
        Averaging times, as :func:`~navfuse.analysis.allan.grids.averaging_factors`.
    terms : tuple of str
        Noise terms to look for.
    gaps : {"split", "refuse"}
        What to do about missing samples.
    level : float
        Probability of the confidence intervals.
    motion : {"trim", "refuse", "ignore"}
        What to do about motion: take the longest part at rest, raise, or nothing.
    from_s, until_s : float [s] or None
        Part of the record, from its first sample.
    longest_s : float [s] or None
        Longest averaging time.
    flicker_band : (float, float) [s]
        Correlation times between which bias instability is flat.
    horizon_s : float [s]
        Over which a filter is to carry the bias.
    """

    kinds: tuple[str, ...] = ("oadev",)
    grid: str = "20 per decade"
    terms: tuple[str, ...] = DEFAULT_TERMS
    gaps: Literal["split", "refuse"] = "split"
    level: float = 0.6826894921370859
    motion: Literal["trim", "refuse", "ignore"] = "trim"
    from_s: float | None = None
    until_s: float | None = None
    longest_s: float | None = None
    flicker_band: tuple[float, float] = (0.1, 1e4)
    horizon_s: float = HORIZON


@dataclass(frozen=True, slots=True, eq=False)
class AxisStudy:
    """Results of one axis, in SI units.

    Attributes
    ----------
    name, sensor : str
        "gyro x", "gyro".
    mean, sd : float
        Of the samples. The mean holds the bias and, of a gyro, the Earth rate.
    curves : dict
        Deviations by kind.
    identification : Identification
    check : ChannelCheck
    spectrum : PowerSpectrum
    autocorrelation : Autocorrelation
    missing : int
        Samples that are not there.
    """

    name: str
    sensor: str
    mean: float
    sd: float
    curves: dict[str, DeviationCurve]
    identification: Identification
    check: ChannelCheck
    spectrum: PowerSpectrum
    autocorrelation: Autocorrelation
    missing: int


@dataclass(frozen=True, slots=True, eq=False)
class AllanStudy:
    """Results of a record.

    Attributes
    ----------
    source : str
    rate : float [Hz]
    span : float [s]
        Length of the part that was used.
    start : float [s]
        Stamp of its first sample.
    kind : {"rates", "increments"}
    rest : StaticSpan
        Where the record is at rest, in samples of the part that was asked for.
    axes : tuple of AxisStudy
    gyro, accel : BiasModel or None
        Recommended models of the biases.
    settings : StudySettings
    warnings : tuple of str
    """

    source: str
    rate: float
    span: float
    start: float
    kind: str
    rest: StaticSpan
    axes: tuple[AxisStudy, ...]
    gyro: BiasModel | None
    accel: BiasModel | None
    settings: StudySettings
    warnings: tuple[str, ...]

    def of(self, sensor: str) -> list[AxisStudy]:
        """The axes of a sensor."""
        return [axis for axis in self.axes if axis.sensor == sensor]

    def white(self, sensor: str) -> float:
        """Root mean square over the axes of the random walk coefficient N, or of its limit where it is not seen.

        Axes whose record is too short for N do not count. NaN where the record has no such sensor, or N was not looked
        for, or no axis tells.
        """
        found = [axis.identification for axis in self.of(sensor)]
        terms = [t for one in found for t in one.terms if t.name == "N" and not one.too_short(t)]
        values = np.array([t.value if t.present else t.limit for t in terms])
        values = values[np.isfinite(values)]
        return float(np.sqrt(np.mean(np.square(values)))) if values.size else math.nan


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
    checks = [check_channel(channel.values, part.rate) for channel in part.channels]
    for channel, check in zip(part.channels, checks, strict=True):
        if check.constant:
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
        notes += _oddities(part.source, channel.name, axes[-1], used)
        if progress:
            progress("axes", (k + 1) / len(used.channels))
    span = (rest.end - rest.begin) / part.rate
    models = {sensor: _bias(axes, sensor, span, settings.horizon_s) for sensor in ("gyro", "accel")}
    notes += _turn_notes(axes, part.source) + _drift_notes(used)
    return AllanStudy(
        part.source, part.rate, span, used.start, part.kind, rest, tuple(axes), models["gyro"], models["accel"],
        settings, tuple(dict.fromkeys(notes)),
    )  # fmt: skip


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
    values = channel.values
    good = np.isfinite(values)
    missing = int(values.size - np.count_nonzero(good))
    if missing and settings.gaps == "refuse":
        raise InputError(
            f"{record.source}: {channel.name}: {missing} samples are missing, the first "
            f"{int(np.argmin(good)) / record.rate:.6g} s "
            "from the start; --gaps split averages over the stretches between"
        )
    check = check_channel(values, record.rate)
    whole = values[_longest_stretch(good)]
    try:
        found = identify(whole, record.rate, terms=settings.terms, flicker_band=settings.flicker_band)
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
    seen = values[good]
    return AxisStudy(
        channel.name,
        channel.sensor,
        float(seen.mean()),
        float(seen.std()),
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


def _longest_stretch(good: Array) -> slice:
    edge = np.diff(good.astype(np.int8), prepend=0, append=0)
    begin, end = np.flatnonzero(edge == 1), np.flatnonzero(edge == -1)
    longest = int(np.argmax(end - begin))
    return slice(int(begin[longest]), int(end[longest]))


def _oddities(source: str, name: str, axis: AxisStudy, record: StaticRecord) -> list[str]:
    notes, check = [], axis.check
    if axis.missing:
        used = axis.identification.span
        notes.append(
            f"{source}: {name}: {axis.missing} samples are missing; the deviations average over the stretches between, "
            f"the noise terms come from the longest one, {used:.6g} s"
        )
    if check.stuck is not None:
        begin, end = check.stuck
        notes.append(
            f"{source}: {name} repeats one value {end - begin + 1} times, from {begin / record.rate:.6g} s: it "
            f"was stuck there"
        )
    if check.saturated:
        notes.append(f"{source}: {name}: {check.saturated} samples stand at the end of the range: it is saturated")
    found = axis.identification
    notes += [
        f"{source}: {name}: {term.name} is uncertain by more than a quarter: the record of {found.span:.6g} s is "
        f"shorter than the {term.least_span:.6g} s that it needs; it is not used for [imu]"
        for term in found.terms
        if found.too_short(term)
    ]
    if found.misfit > 0.0:
        above = "" if math.isinf(found.highest) else f" above {found.highest:.3g} Hz and"
        notes.append(
            f"{source}: {name}: no sum of the terms fits the whole spectrum; what is{above} in "
            f"{100.0 * found.left_out:.0f} % of "
            f"the other bins is left out (vibration, lines, the edge of a filter), the rest is taken for good to "
            f"{100.0 * found.misfit:.1f} %"
        )
    return notes


def _turn_notes(axes: Sequence[AxisStudy], source: str) -> list[str]:
    turn = math.hypot(*(axis.mean for axis in axes if axis.sensor == "gyro"))
    if turn <= TURNS:
        return []
    return [
        f"{source}: the gyros show {math.degrees(turn):.3g} deg/s on average: does it turn steadily, or is the unit "
        "wrong? Few sensors have such a bias"
    ]


def _drift_notes(record: StaticRecord) -> list[str]:
    notes = []
    warm = record.temperature
    if warm is not None and np.isfinite(warm).any():
        span = float(np.nanmax(warm) - np.nanmin(warm))
        if span > 1.0:
            notes.append(
                f"{record.source}: the temperature changes by {span:.3g} K along the record; what follows it is "
                f"drift, not noise"
            )
    drifting = [c.name for c in record.channels if check_channel(c.values, record.rate).drifts]
    if drifting:
        notes.append(
            f"{record.source}: {', '.join(drifting)}: a straight line explains most of the slow change, as in "
            f"warm-up; K, R and "
            "long averaging times tell of that more than of noise: let the sensor warm up, or cut the beginning"
        )
    return notes


def _bias(axes: Sequence[AxisStudy], sensor: str, span: float, horizon: float) -> BiasModel | None:
    mine = [axis for axis in axes if axis.sensor == sensor]
    if not mine:
        return None
    tau = np.geomspace(1.0, max(10.0, 2.0 * horizon), 200)
    slow: list[Array | None] = []
    white = []
    for axis in mine:
        found = axis.identification
        parts = [found.allan_variance(tau, name) for name in ("B", "K", "GM") if _has(found, name)]
        slow.append(np.sum(parts, axis=0) if parts else None)
        white.append(found.term("N").value if _has(found, "N") else 0.0)
    return bias_model(slow, white, tau, min(horizon, max(0.25 * span, 4.0)))


def _has(found: Identification, name: str) -> bool:
    """Whether a term is seen, in a record long enough to take it for a setting."""
    return any(term.name == name and term.present and not found.too_short(term) for term in found.terms)
