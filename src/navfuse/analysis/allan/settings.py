"""Error model of the engine from a static record."""

from __future__ import annotations

import math

import numpy as np

from navfuse.analysis.allan.recommend import BiasModel
from navfuse.analysis.allan.study import AllanStudy
from navfuse.imu.error_model import ImuErrorModel


def error_model(study: AllanStudy, turn_on_gyro: float = 0.0, turn_on_accel: float = 0.0) -> ImuErrorModel:
    """White noise and biases for the filter.

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
        "source": f"Allan variance of {study.source}, {study.span:.6g} s",
    }
    for sensor, model, turn_on in (("gyro", study.gyro, turn_on_gyro), ("accel", study.accel, turn_on_accel)):
        fields |= _bias_fields(sensor, model, turn_on, len(study.of(sensor)))
    return ImuErrorModel(**fields)  # type: ignore[arg-type]


def _bias_fields(sensor: str, model: BiasModel | None, turn_on: float, axes: int) -> dict[str, object]:
    if model is None:
        return {f"{sensor}_bias_sd": turn_on}
    sd, walk = np.array(model.sd), np.array(model.walk)
    if axes != 3:
        sd, walk = np.full(3, sd.max()), np.full(3, walk.max())
    tau = model.tau
    if turn_on > 0.0 and math.isfinite(tau):
        walk, tau = sd * math.sqrt(2.0 / tau), math.inf
    fields: dict[str, object] = {f"{sensor}_bias_sd": np.hypot(sd, turn_on), f"{sensor}_bias_tau": tau}
    if math.isinf(tau):
        fields[f"{sensor}_bias_walk"] = walk
    return fields


def remarks(study: AllanStudy, turn_on: tuple[float, float] = (0.0, 0.0)) -> list[str]:
    """Comments for the settings: where they come from and what they do not contain."""
    lines = [f"from {study.source}: Allan variance of {study.span:.6g} s at rest, {study.rate:.6g} Hz"]
    for sensor, model, given in (("gyro", study.gyro, turn_on[0]), ("accel", study.accel, turn_on[1])):
        if not study.of(sensor):
            continue
        if model is None:
            lines.append(f"{sensor}: no bias but a constant one is seen in this record")
        else:
            shape = "a random walk" if math.isinf(model.tau) else f"a Gauss-Markov process of {model.tau:.4g} s"
            lines.append(
                f"{sensor} bias: {shape} follows the Allan deviation of the in-run bias from {model.span[0]:.3g} to "
                f"{model.span[1]:.3g} s within {100.0 * math.expm1(model.error):.0f} % (root mean square)"
            )
        if given == 0.0:
            lines.append(
                f"{sensor}_bias_sd: in-run only. The bias changes at every switch-on, which no static record "
                f"shows: add the "
                f"data sheet's repeatability with --{sensor}-turn-on"
            )
    return lines
