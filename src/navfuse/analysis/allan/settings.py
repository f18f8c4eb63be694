"""Error model of the engine from a static record."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from navfuse.analysis.allan.recommend import BiasModel
from navfuse.analysis.allan.study import AllanStudy, largest_walk
from navfuse.imu.error_model import ImuErrorModel


def error_model(study: AllanStudy, turn_on_gyro: float = 0.0, turn_on_accel: float = 0.0) -> ImuErrorModel:
    """White noise and biases as the record shows them, for a simulation of this very record.

    :func:`filter_settings` has those for a filter, which must not take what a record cannot show for zero.

    Parameters
    ----------
    study : AllanStudy
    turn_on_gyro, turn_on_accel : float [rad/s], [m/s^2]
        Standard deviation of the bias from one switch-on to the next, which no static record shows. If given, it starts
        the bias, and the in-run change becomes a random walk: a Gauss-Markov process would forget it.

    Returns
    -------
    ImuErrorModel
        ``arw`` and ``vrw`` are root mean squares over the axes; zero where a sensor is not in the record. Scale factors
        are zero: a static record says nothing about them.
    """
    white = {sensor: study.white(sensor) for sensor in ("gyro", "accel")}
    fields: dict[str, object] = {
        "arw": white["gyro"] if math.isfinite(white["gyro"]) else 0.0,
        "vrw": white["accel"] if math.isfinite(white["accel"]) else 0.0,
        "source": _source(study),
    }
    for sensor, model, turn_on in (("gyro", study.gyro, turn_on_gyro), ("accel", study.accel, turn_on_accel)):
        fields |= _bias_fields(sensor, model, turn_on, len(study.of(sensor)))
    return ImuErrorModel(**fields)  # type: ignore[arg-type]


def filter_settings(
    study: AllanStudy, turn_on_gyro: float | None = None, turn_on_accel: float | None = None
) -> tuple[ImuErrorModel, list[str]]:
    """What of the error model a filter should take from the record, the rest being left to its grade.

    Parameters
    ----------
    study : AllanStudy
    turn_on_gyro, turn_on_accel : float or None [rad/s], [m/s^2]
        Standard deviation of the bias from one switch-on to the next. None if it is not known: then the bias begins as
        the grade says, and what the record shows of it becomes a random walk.

    Returns
    -------
    model : ImuErrorModel
        Only the fields below are set. An axis of whose bias the record shows nothing takes the largest of the others.
    fields : list of str
        Those of the model that the record, or the turn-on figure, says something of.
    """
    fields: dict[str, object] = {}
    for sensor, noise, model, start in (
        ("gyro", "arw", study.gyro, turn_on_gyro),
        ("accel", "vrw", study.accel, turn_on_accel),
    ):
        if not study.of(sensor):
            continue
        if math.isfinite(study.white(sensor)):
            fields[noise] = study.white(sensor)
        if model is not None:
            most = [math.inf if axis.check.clipped else largest_walk(axis.identification) for axis in study.of(sensor)]
            walk, free = _filled(model.walk, most), _filled(model.free_walk, most)
            model = replace(model, sd=_filled(model.sd, []), walk=walk, free_walk=free)
        bias = _bias_fields(sensor, model, start or 0.0, len(study.of(sensor)), walk=start is None)
        if start is None:
            bias = {name: value for name, value in bias.items() if name.endswith("walk")}
        fields |= bias
    return ImuErrorModel(source=_source(study), **fields), list(fields)  # type: ignore[arg-type]


def _filled(values: tuple[float, ...], most: Sequence[float]) -> tuple[float, ...]:
    """The largest in place of zeros, but no more than an axis may have."""
    limits = [*most, *[math.inf] * (len(values) - len(most))]
    return tuple(value or min(max(values), limit) for value, limit in zip(values, limits, strict=True))


def _source(study: AllanStudy) -> str:
    return f"Allan variance of {study.source}, {study.span:.6g} s"


def _bias_fields(
    sensor: str, model: BiasModel | None, turn_on: float, axes: int, walk: bool = False
) -> dict[str, object]:
    """Fields of a bias; `walk` makes a random walk of any process, as a turn-on bias does."""
    if model is None:
        return {f"{sensor}_bias_sd": turn_on}
    sd, drive = np.array(model.sd), np.array(model.free_walk)
    if axes != 3:
        sd, drive = np.full(3, sd.max()), np.full(3, drive.max())
    tau = model.tau
    if (walk or turn_on > 0.0) and math.isfinite(tau):
        tau = math.inf
    fields: dict[str, object] = {f"{sensor}_bias_sd": np.hypot(sd, turn_on), f"{sensor}_bias_tau": tau}
    if math.isinf(tau):
        fields[f"{sensor}_bias_walk"] = drive
    return fields


def missing_turn_on(study: AllanStudy, turn_on: tuple[float | None, float | None]) -> str:
    """A warning that the bias at switch-on is not in the record; "" where it was given for every sensor of it."""
    without = [
        sensor for sensor, given in zip(("gyro", "accel"), turn_on, strict=True) if given is None and study.of(sensor)
    ]
    if not without:
        return ""
    keys = " and ".join(f"{sensor}_bias_sd" for sensor in without)
    return (
        f"{study.source}: the bias at switch-on is not in a record at rest: the grade of the project keeps "
        f"{keys}; give the data sheet's repeatability with {' and '.join(f'--{sensor}-turn-on' for sensor in without)}"
    )


def remarks(study: AllanStudy, turn_on: tuple[float | None, float | None] = (None, None)) -> list[str]:
    """Comments for the settings: where they come from and what they do not contain."""
    lines = [f"from {study.source}: Allan variance of {study.span:.6g} s at rest, {study.rate:.6g} Hz"]
    for sensor, model, given in (("gyro", study.gyro, turn_on[0]), ("accel", study.accel, turn_on[1])):
        if not study.of(sensor):
            continue
        clipped = [axis.name for axis in study.of(sensor) if axis.check.clipped]
        if len(clipped) == len(study.of(sensor)):
            lines.append(f"{sensor}: every axis is saturated, which hides its noise: nothing is written, record anew")
            continue
        if clipped:
            lines.append(f"{sensor}: {', '.join(clipped)} saturated, which hides its noise: not used")
        if model is None:
            lines.append(f"{sensor}: no bias but a constant one is seen in this record")
        else:
            if 0.0 in model.sd:
                lines.append(
                    f"{sensor} bias: an axis that shows none takes the largest of the others (a walk: up to its limit)"
                )
            shape = "a random walk" if math.isinf(model.tau) else f"a Gauss-Markov process of {model.tau:.4g} s"
            lines.append(
                f"{sensor} bias: {shape} follows the Allan deviation of the in-run bias from {model.span[0]:.3g} to "
                f"{model.span[1]:.3g} s within {_percent(model.error)} % (root mean square)"
            )
        if model is not None and math.isfinite(model.tau) and given != 0.0:
            held = "" if not any(model.held) else ", held below the rate random walk that the record allows"
            lines.append(
                f"{sensor}_bias_walk: a random walk in place of this process, fitted over the same averaging "
                f"times{held}; "
                f"its Allan deviation is off by {_percent(model.free_error)} % (root mean square), mostly low at the "
                "short and high at the long ones"
            )
        if given is not None:
            continue
        lines.append(
            f"{sensor}_bias_sd: left to the grade. The bias changes at every switch-on, which no static record shows: "
            f"add the data sheet's repeatability with --{sensor}-turn-on"
        )
    return lines


def _percent(error: float) -> str:
    return f"{100.0 * math.expm1(error):.0f}"
