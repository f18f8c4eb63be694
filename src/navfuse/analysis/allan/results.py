"""What an analysis of a static record is asked for, and what it finds."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from navfuse.analysis.allan.deviations import DeviationCurve
from navfuse.analysis.allan.identify import Identification
from navfuse.analysis.allan.precheck import ChannelCheck, StaticSpan
from navfuse.analysis.allan.recommend import HORIZON, BiasModel
from navfuse.analysis.allan.spectra import Autocorrelation, PowerSpectrum

Array = np.ndarray

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
        Samples that are not there, or were not measured because the axis was stuck.
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

        Axes that are clipped, or whose record is too short for N, do not count. NaN where the record has no such
        sensor, or N was not looked for, or no axis tells.
        """
        found = [axis.identification for axis in self.of(sensor) if not axis.check.clipped]
        terms = [t for one in found for t in one.terms if t.name == "N" and not one.too_short(t)]
        values = np.array([t.value if t.present else t.limit for t in terms])
        values = values[np.isfinite(values)]
        return float(np.sqrt(np.mean(np.square(values)))) if values.size else math.nan
