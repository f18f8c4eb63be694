"""Allan deviation of simulated static records against the parameters that were put in."""

from __future__ import annotations

import math

import numpy as np
import pytest

from navfuse.data.logs import ImuLog
from navfuse.imu.error_model import ImuErrorModel
from navfuse.simulation import ImuSensorModel, measure_imu
from navfuse.simulation.measured_imu import flicker_taus

RATE = 100.0
FLOOR = 2.0 * math.log(2.0) / math.pi
NODES, WEIGHTS = (0.5 * x for x in np.polynomial.legendre.leggauss(400))


def overlapping_allan_variance(integral, spans, dt):
    """Mean over the axes, from the integrated output (n, 3), for spans in samples."""
    found = []
    for m in spans:
        second = integral[2 * m :] - 2.0 * integral[m:-m] + integral[: -2 * m]
        found.append(np.mean(second**2) / (2.0 * (m * dt) ** 2))
    return np.array(found)


def fitted(values, kind, from_s, to_s, shapes):
    """Coefficients of the shapes in the Allan variance of a record (n, 3), weighted by its uncertainty; as roots."""
    increments = values / RATE if kind == "rates" else values
    integral = np.vstack([np.zeros(3), np.cumsum(increments, axis=0)])
    spans = np.unique(np.round(np.geomspace(from_s, to_s, 30) * RATE).astype(int))
    tau = spans / RATE
    variance = overlapping_allan_variance(integral, spans, 1.0 / RATE)
    columns = np.column_stack([{"N": 1.0 / tau, "B": np.full(tau.size, FLOOR), "K": tau / 3.0}[s] for s in shapes])
    weight = 1.0 / (variance * np.sqrt(tau))
    squares, *_ = np.linalg.lstsq(columns * weight[:, None], variance * weight, rcond=None)
    return np.sqrt(squares)


def record(hours, kind, seed, **fields):
    count = round(hours * 3600.0 * RATE)
    log = ImuLog(np.arange(count) / RATE, np.zeros((count, 3)), np.zeros((count, 3)), kind)
    return measure_imu(log, ImuSensorModel(**fields), np.random.default_rng(seed))[0]


def check(hours, kind, seed, bars):
    """Noise with instability on the gyros and noise with rate walk on the accelerometers, then the other way round.

    Standard deviations of the estimates over seeds: for 4 h, noise 0.0004, instability 0.0074, walk 0.0026; for half an
    hour 0.001, 0.012 and 0.010. The one process per decade lowers noise by 0.004 and instability by 0.014.
    """
    white_bar, instability_bar, walk_bar = bars
    unit = {"gyro": 1e-4, "accel": 1e-2}
    for flat, walking in (("gyro", "accel"), ("accel", "gyro")):
        base = ImuErrorModel(arw=unit["gyro"], vrw=unit["accel"])
        fields = {f"{flat}_bias_instability": unit[flat], f"{walking}_rate_walk": 5.0 * unit[walking]}
        log = record(hours, kind, seed, base=base, **fields)
        white, instability = fitted(getattr(log, flat), kind, 0.01, min(100.0, 100.0 * hours), "NB") / unit[flat]
        assert white == pytest.approx(1.0, abs=white_bar)
        assert instability == pytest.approx(1.0, abs=instability_bar)
        white, walk = fitted(getattr(log, walking), kind, 0.01, 10.0, "NK") / unit[walking]
        assert white == pytest.approx(1.0, abs=white_bar)
        assert walk / 5.0 == pytest.approx(1.0, abs=walk_bar)


@pytest.mark.parametrize("kind", ["rates", "increments"])
def test_a_short_record_shows_the_parameters_put_in(kind):
    check(0.5, kind, 1, (0.01, 0.062, 0.04))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["rates", "increments"])
def test_four_hours_show_the_parameters_put_in(kind):
    check(4.0, kind, 2, (0.01, 0.05, 0.012))


def test_the_estimator_notices_what_is_wrong():
    log = record(0.5, "rates", 3, base=ImuErrorModel(arw=1.06), gyro_bias_instability=1.2)
    white, instability = fitted(log.gyro, "rates", 0.01, 50.0, "NB")
    assert abs(white - 1.0) > 0.04
    assert abs(instability - 1.0) > 0.1


def gauss_markov_allan_variance(tau, correlation):
    """Of a first-order process of unit variance, by numerical integration of its autocorrelation."""

    def mean_covariance(lag):
        u = NODES + 0.5
        both = np.exp(-np.abs(lag + u) * tau / correlation) + np.exp(-np.abs(lag - u) * tau / correlation)
        return np.sum(WEIGHTS * (1.0 - u) * both)

    return mean_covariance(0.0) - mean_covariance(1.0)


@pytest.mark.parametrize(("shortest", "longest"), [(0.1, 1e4), (1.0, 1e5), (0.5, 3e3)])
def test_the_processes_make_a_flat_floor(shortest, longest):
    taus, variance = flicker_taus(shortest, longest)
    assert (taus[0], taus[-1]) == (pytest.approx(shortest), pytest.approx(longest))
    for tau in np.geomspace(12.0 * shortest, longest / 3.0, 40):
        floor = variance * sum(gauss_markov_allan_variance(tau, c) for c in taus)
        assert math.sqrt(floor / FLOOR) == pytest.approx(1.0, abs=0.02)
