"""Data sheet figures to an error model and back, with the formula of every step.

The words of data sheets and what they stand for here:

* *angle random walk*, deg/sqrt(h): the coefficient N. *Noise density*, deg/s/sqrt(Hz): the same number in other units
  if it is meant two-sided (``N[deg/sqrt(h)] = 60 D``), but N is smaller by sqrt(2) if it is one-sided, as an analyser
  shows it. Sheets that print both figures tell which: the ADIS16405 has 2.0 deg/sqrt(h) and 0.05 deg/s/sqrt(Hz),
  a ratio of 1.5 to the two-sided reading, so one-sided.
* *rms noise* within a bandwidth: ``N = sigma / sqrt(2 f_n)`` with the noise bandwidth f_n, pi/2 times the -3 dB
  bandwidth of a first-order filter.
* *in-run bias stability* or *instability*: the floor of the Allan deviation, 0.664 B.
* *bias repeatability*: from one switch-on to the next.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass

from navfuse.core.constants import ALLAN_FLOOR, STANDARD_GRAVITY
from navfuse.errors import ConfigError
from navfuse.imu.error_model import ImuErrorModel
from navfuse.io.unit_text import QUANTITIES, parse_quantity

_DEG = math.pi / 180.0
_DPH = _DEG / 3600.0
_UG = 1e-6 * STANDARD_GRAVITY

PEAK = 0.6174
"""Largest Allan deviation of a Gauss-Markov process over its standard deviation, at 1.89 correlation times."""

NOISE_BANDWIDTH = {n: 0.5 * math.pi / n / math.sin(0.5 * math.pi / n) for n in (1, 2, 3, 4)}
"""Order of a Butterworth filter -> its noise bandwidth over its -3 dB bandwidth."""

SMALLEST = 1e-30
"""SI value below which a figure is none of a sensor; smaller ones end as 0, which says that there is no noise."""

LARGEST = 1e6
"""No figure of a sensor is larger, in SI units: a million rad/s or m/s^2."""

MOST_DIGITS = 17
"""Digits that tell every two floats apart."""

SENSORS = ("gyro", "accel")
ENTRIES: dict[str, tuple[str, str]] = {
    "noise": ("angle random walk", "velocity random walk"),
    "bias": ("angular rate", "acceleration"),
    "walk": ("rate random walk", "acceleration random walk"),
    "turn_on": ("angular rate", "acceleration"),
}
"""What a sheet says of a sensor -> quantity of a gyro, of an accelerometer."""


@dataclass(frozen=True, slots=True)
class SheetReading:
    """How the figures of a sheet are meant.

    Attributes
    ----------
    one_sided : bool
        Noise densities per sqrt(Hz) are one-sided.
    coefficient : bool
        The bias instability is the coefficient B of IEEE Std 952, not the floor 0.664 B.
    tau : float [s]
        Correlation time of the Gauss-Markov process that stands for the in-run bias.
    bandwidth : float or None [Hz]
        -3 dB bandwidth that an rms noise is for.
    order : int
        Of that filter.
    """

    one_sided: bool = False
    coefficient: bool = False
    tau: float = 1000.0
    bandwidth: float | None = None
    order: int = 1

    def __post_init__(self) -> None:
        if not (math.isfinite(self.tau) and self.tau > 0.0):
            raise ConfigError(f"tau = {self.tau} must be a finite number of seconds > 0")
        if self.bandwidth is not None and not (math.isfinite(self.bandwidth) and self.bandwidth > 0.0):
            raise ConfigError(f"bandwidth = {self.bandwidth} must be a finite number of hertz > 0")
        if self.order not in NOISE_BANDWIDTH:
            raise ConfigError(f"order = {self.order} must be one of {', '.join(map(str, NOISE_BANDWIDTH))}")


def from_sheet(figures: Mapping[str, str], reading: SheetReading | None = None) -> tuple[ImuErrorModel, list[str]]:
    """Error model of the filter from figures of a data sheet.

    Parameters
    ----------
    figures : mapping
        "gyro_noise", "gyro_bias", "gyro_walk", "gyro_turn_on" and the same with "accel" -> number with unit as text.
    reading : SheetReading, optional

    Returns
    -------
    model : ImuErrorModel
    formulas : list of str
        What was done, with numbers.

    Raises
    ------
    ConfigError
        For an unknown entry or unit, a negative or absurdly large figure, an rms noise without bandwidth, or a reading
        of figures that are not there.
    """
    reading = reading or SheetReading()
    known = [f"{sensor}_{entry}" for sensor in SENSORS for entry in ENTRIES]
    for name in figures:
        if name not in known:
            raise ConfigError(f"unknown entry {name!r} of a data sheet; known: {', '.join(known)}")
    if reading.bandwidth is not None and not any(_is_rms(figures, sensor, k) for k, sensor in enumerate(SENSORS)):
        raise ConfigError("--bandwidth is for an rms noise, and none is given; leave it out")
    if reading.coefficient and not any(f"{sensor}_bias" in figures for sensor in SENSORS):
        raise ConfigError("--coefficient is for a bias instability, and none is given; leave it out")
    fields: dict[str, float] = {}
    formulas: list[str] = []
    for k, sensor in enumerate(SENSORS):
        if f"{sensor}_noise" in figures:
            noise = _noise(sensor, k, figures[f"{sensor}_noise"], reading, formulas)
            fields["arw" if sensor == "gyro" else "vrw"] = noise
        values = {
            entry: _figure(f"{sensor}_{entry}", figures[f"{sensor}_{entry}"], ENTRIES[entry][k])
            for entry in ("bias", "walk", "turn_on")
            if f"{sensor}_{entry}" in figures
        }
        if values:
            fields |= _bias(sensor, values, reading, formulas)
    source = "data sheet: " + ", ".join(f"{name} {text}" for name, text in figures.items())
    return ImuErrorModel(source=source, **fields), formulas


def sheet_fields(figures: Mapping[str, str]) -> list[str]:
    """Fields of the error model that figures of a data sheet say something of; of the others the sheet is silent.

    Parameters
    ----------
    figures : mapping
        As :func:`from_sheet`.

    Returns
    -------
    list of str
        The walk is among them where an in-run bias beside a turn-on bias becomes one.
    """
    fields = []
    for sensor, noise in zip(SENSORS, ("arw", "vrw"), strict=True):
        in_run, walk, turn_on = (f"{sensor}_{entry}" in figures for entry in ("bias", "walk", "turn_on"))
        known = {
            noise: f"{sensor}_noise" in figures,
            f"{sensor}_bias_sd": in_run or turn_on,
            f"{sensor}_bias_tau": in_run,
            f"{sensor}_bias_walk": walk or (in_run and turn_on),
        }
        fields += [name for name, given in known.items() if given]
    return fields


def _figure(name: str, text: str, *quantities: str) -> float:
    measure, _ = parse_quantity(text, *quantities, what=f"--{name.replace('_', '-')}")
    if measure.value < 0.0:
        raise ConfigError(f"--{name.replace('_', '-')} = {text!r} must not be negative")
    if not measure.value < LARGEST:
        raise ConfigError(f"--{name.replace('_', '-')} = {text!r} is beyond any sensor; check number and unit")
    if measure.value < SMALLEST and re.match(r"[\s+]*[0._]*[1-9]", text):
        raise ConfigError(
            f"--{name.replace('_', '-')} = {text!r} is too small a number for any sensor; check number and unit"
        )
    return measure.value


def _is_rms(figures: Mapping[str, str], sensor: str, k: int) -> bool:
    """Whether the noise of a sensor is an rms value."""
    text, quantities = figures.get(f"{sensor}_noise"), (ENTRIES["noise"][k], ENTRIES["bias"][k])
    return text is not None and parse_quantity(text, *quantities, what=f"--{sensor}-noise")[1] == quantities[1]


def _noise(sensor: str, k: int, text: str, reading: SheetReading, formulas: list[str]) -> float:
    what = f"--{sensor}-noise"
    walk, rms = ENTRIES["noise"][k], ENTRIES["bias"][k]
    measure, quantity = parse_quantity(text, walk, rms, what=what)
    value = _figure(f"{sensor}_noise", text, walk, rms)
    if quantity == rms:
        if reading.bandwidth is None:
            raise ConfigError(
                f"{what} = {text!r} is an rms noise: it needs --bandwidth; a density is written in "
                f"{QUANTITIES[walk][1]}"
            )
        width = NOISE_BANDWIDTH[reading.order] * reading.bandwidth
        noise = value / math.sqrt(2.0 * width)
        formulas.append(
            f"{sensor}: N = rms / sqrt(2 f_n) = {text} / sqrt(2 x {width:.6g} Hz) = {_walk_text(sensor, noise)}; f_n = "
            f"{NOISE_BANDWIDTH[reading.order]:.4g} x {reading.bandwidth:g} Hz (order {reading.order})"
        )
        return noise
    if reading.one_sided and "hz" in measure.unit.lower():
        formulas.append(
            f"{sensor}: N = one-sided density / sqrt(2) = {text} / 1.414 = {_walk_text(sensor, value / math.sqrt(2.0))}"
        )
        return value / math.sqrt(2.0)
    sides = "; per root of a time, so --one-sided changes nothing" if reading.one_sided else ""
    formulas.append(
        f"{sensor}: N = {text} = {_walk_text(sensor, value)}; 1 per sqrt(Hz) = 1 per sqrt(1/s) = 60 per sqrt(h){sides}"
    )
    return value


def _bias(sensor: str, values: Mapping[str, float], reading: SheetReading, formulas: list[str]) -> dict[str, float]:
    sd, walk, tau = 0.0, values.get("walk", 0.0), math.inf
    turn_on = values.get("turn_on", 0.0)
    if "bias" in values:
        floor = values["bias"] * (ALLAN_FLOOR if reading.coefficient else 1.0)
        if reading.coefficient:
            formulas.append(f"{sensor}: floor = 0.664 B = {_rate_text(sensor, floor)}")
        sd = floor / PEAK
        tau = reading.tau
        formulas.append(
            f"{sensor}: Gauss-Markov sd = floor / 0.617 = {_rate_text(sensor, sd)}: its Allan deviation peaks "
            f"at the floor "
            f"{_rate_text(sensor, floor)} after 1.89 tau = {1.893 * tau:.4g} s"
        )
    if tau < math.inf and (turn_on > 0.0 or walk > 0.0):
        drive = sd * math.sqrt(2.0 / tau)
        walk = math.hypot(walk, drive)
        formulas.append(
            f"{sensor}: the bias does not forget its start: random walk instead, sd x sqrt(2 / tau)"
            f"{' and the rate random walk, root of the sum of squares' if 'walk' in values else ''} = "
            f"{_slope_text(sensor, walk)}"
        )
        tau = math.inf
    if "bias" in values and "turn_on" not in values:
        formulas.append(
            f"{sensor}: bias sd is in-run only; the bias at switch-on is not in it: give the repeatability with "
            f"--{sensor}-turn-on"
        )
    if turn_on > 0.0:
        formulas.append(
            f"{sensor}: bias sd = sqrt(turn-on^2 + in-run^2) = {_rate_text(sensor, math.hypot(turn_on, sd))}"
        )
    return {
        f"{sensor}_bias_sd": math.hypot(turn_on, sd),
        f"{sensor}_bias_tau": tau,
        f"{sensor}_bias_walk": walk if math.isinf(tau) else 0.0,
    }


def check_digits(digits: int) -> int:
    """A number of digits that a figure can have.

    Raises
    ------
    ConfigError
    """
    if not 1 <= digits <= MOST_DIGITS:
        raise ConfigError(f"digits = {digits} must be 1 to {MOST_DIGITS}")
    return digits


def to_sheet(
    model: ImuErrorModel, bandwidth: float | None = None, order: int = 1, digits: int = 5
) -> list[tuple[str, str, str]]:
    """Figures of a data sheet from an error model.

    Parameters
    ----------
    model : ImuErrorModel
    bandwidth : float, optional [Hz]
        Adds the rms noise within this -3 dB bandwidth.
    order : int
        Of that filter.
    digits : int
        Of each figure, 1 to 17; with 17 the way back gives the same model.

    Returns
    -------
    list of (what, figures, formula)

    Raises
    ------
    ConfigError
        For a bandwidth, an order or a number of digits out of range.
    """
    SheetReading(bandwidth=bandwidth, order=order)
    check_digits(digits)
    rows = []
    for sensor, noise in (("gyro", model.arw), ("accel", model.vrw)):
        rows.append((f"{sensor} random walk N", _walk_text(sensor, noise, digits), "N"))
        root = math.sqrt(2.0)
        rows.append((f"{sensor} one-sided noise density", _density_text(sensor, root * noise, digits), "sqrt(2) N"))
        if bandwidth is not None:
            width = NOISE_BANDWIDTH[order] * bandwidth
            rows.append(
                (f"{sensor} rms noise in {bandwidth:g} Hz", _rate_text(sensor, noise * math.sqrt(2.0 * width), digits),
                 f"N sqrt(2 f_n), f_n = {width:.5g} Hz")
            )  # fmt: skip
        sd, walk = float(max(model.axes(f"{sensor}_bias_sd"))), float(max(model.axes(f"{sensor}_bias_walk")))
        tau = getattr(model, f"{sensor}_bias_tau")
        rows.append((f"{sensor} bias, one sigma", _rate_text(sensor, sd, digits), "bias_sd, largest axis"))
        if math.isfinite(tau):
            rows.append(
                (
                    f"{sensor} in-run bias stability",
                    _rate_text(sensor, PEAK * sd, digits),
                    f"0.617 sd, at 1.89 tau = {1.893 * tau:.4g} s",
                )
            )
        elif walk > 0.0:
            rows.append((f"{sensor} rate random walk K", _slope_text(sensor, walk, digits), "bias_walk, largest axis"))
    return rows


def _walk_text(sensor: str, value: float, digits: int = 5) -> str:
    if sensor == "gyro":
        return f"{value * 60.0 / _DEG:.{digits}g} deg/sqrt(h) = {value / _DEG:.{digits}g} deg/s/sqrt(Hz)"
    return f"{value * 60.0:.{digits}g} m/s/sqrt(h) = {value / _UG:.{digits}g} ug/sqrt(Hz)"


def _density_text(sensor: str, value: float, digits: int = 5) -> str:
    return f"{value / _DEG:.{digits}g} deg/s/sqrt(Hz)" if sensor == "gyro" else f"{value / _UG:.{digits}g} ug/sqrt(Hz)"


def _rate_text(sensor: str, value: float, digits: int = 5) -> str:
    if sensor == "gyro":
        return f"{value / _DPH:.{digits}g} deg/h = {value / _DEG:.{digits}g} deg/s"
    return f"{value / (1e3 * _UG):.{digits}g} mg = {value:.{digits}g} m/s^2"


def _slope_text(sensor: str, value: float, digits: int = 5) -> str:
    if sensor == "gyro":
        return f"{value * 60.0 / _DPH:.{digits}g} deg/h/sqrt(h) = {value / _DEG:.{digits}g} deg/s/sqrt(s)"
    return f"{value * 60.0 / (1e3 * _UG):.{digits}g} mg/sqrt(h) = {value / _UG:.{digits}g} ug/sqrt(s)"
