from __future__ import annotations

import math

import numpy as np
import pytest

from navfuse.analysis.allan.terms import FLOOR as TERM_FLOOR
from navfuse.analysis.allan.terms import gauss_markov_allan
from navfuse.errors import ConfigError
from navfuse.imu.datasheet import FLOOR, NOISE_BANDWIDTH, PEAK, SheetReading, from_sheet, to_sheet
from navfuse.imu.grades import grade

DEG = math.pi / 180.0


def test_constants():
    curve = np.sqrt(gauss_markov_allan(np.linspace(1.0, 3.0, 2001), 1.0))
    assert curve.max() == pytest.approx(PEAK, abs=5e-5)
    assert FLOOR == TERM_FLOOR
    f = np.linspace(0.0, 2000.0, 2_000_001)
    for order, ratio in NOISE_BANDWIDTH.items():
        assert np.trapezoid(1.0 / (1.0 + f ** (2 * order)), f) == pytest.approx(ratio, rel=1e-3)


def test_densities_and_random_walks_are_one_thing():
    model, formulas = from_sheet({"gyro_noise": "0.005 deg/s/sqrt(Hz)", "accel_noise": "120 ug/sqrt(Hz)"})
    same, _ = from_sheet({"gyro_noise": "0.3 deg/sqrt(h)", "accel_noise": "0.0706079 m/s/sqrt(h)"})
    assert model.arw == pytest.approx(same.arw, rel=1e-9)
    assert model.vrw == pytest.approx(same.vrw, rel=1e-6)
    assert "gyro: N = 0.005 deg/s/sqrt(Hz) = 0.3 deg/sqrt(h)" in formulas[0]
    half, _ = from_sheet({"gyro_noise": "0.005 deg/s/sqrt(Hz)"}, SheetReading(one_sided=True))
    assert half.arw == pytest.approx(model.arw / math.sqrt(2.0))
    untouched, _ = from_sheet({"gyro_noise": "0.3 deg/sqrt(h)"}, SheetReading(one_sided=True))
    assert untouched.arw == pytest.approx(same.arw)


def test_rms_noise_in_a_bandwidth():
    model, formulas = from_sheet({"gyro_noise": "0.1 deg/s"}, SheetReading(bandwidth=50.0, order=2))
    assert model.arw == pytest.approx(0.1 * DEG / math.sqrt(2.0 * 50.0 * 1.1107), rel=1e-4)
    assert "sqrt(2 f_n)" in formulas[0]
    rows = {what: figure for what, figure, _ in to_sheet(model, 50.0, 2)}
    assert rows["gyro rms noise in 50 Hz"] == "360 deg/h = 0.1 deg/s"


def test_in_run_bias():
    model, _ = from_sheet({"gyro_bias": "10 deg/h"}, SheetReading(tau=500.0))
    assert model.gyro_bias_tau == 500.0
    assert model.gyro_bias_sd * PEAK == pytest.approx(10.0 * DEG / 3600.0)
    other, formulas = from_sheet({"gyro_bias": "10 deg/h"}, SheetReading(coefficient=True))
    assert other.gyro_bias_sd == pytest.approx(FLOOR * model.gyro_bias_sd)
    assert "floor = 0.664 B" in formulas[0]
    rows = {what: figure for what, figure, _ in to_sheet(model)}
    assert rows["gyro in-run bias stability"].startswith("10 deg/h")


def test_turn_on_and_walk():
    reading = SheetReading(tau=1000.0)
    figures = {"accel_bias": "40 ug", "accel_turn_on": "2 mg", "accel_walk": "60 ug/sqrt(h)"}
    model, formulas = from_sheet(figures, reading)
    sd = 40e-6 * 9.80665 / PEAK
    assert model.accel_bias_sd == pytest.approx(math.hypot(2e-3 * 9.80665, sd))
    assert model.accel_bias_walk == pytest.approx(math.hypot(sd * math.sqrt(2e-3), 9.80665e-6))
    assert math.isinf(model.accel_bias_tau)
    assert any("rate random walk, root of the sum" in text for text in formulas)
    rows = {what: figure for what, figure, _ in to_sheet(model)}
    assert "accel rate random walk K" in rows


def test_both_directions_for_the_grades():
    for name in ("tactical", "navigation"):
        rows = {what: figure for what, figure, _ in to_sheet(grade(name))}
        back, _ = from_sheet({"gyro_noise": rows["gyro random walk N"].split(" = ")[0]})
        assert back.arw == pytest.approx(grade(name).arw, rel=1e-4)
        back, _ = from_sheet({"accel_noise": rows["accel random walk N"].split(" = ")[1]})
        assert back.vrw == pytest.approx(grade(name).vrw, rel=1e-4)


@pytest.mark.parametrize(
    ("figures", "reading", "message"),
    [
        ({"gyro_nose": "1 deg/h"}, {}, "unknown entry 'gyro_nose'"),
        ({"gyro_noise": "0.1 deg/s"}, {}, "is an rms noise: it needs --bandwidth"),
        ({"gyro_bias": "-1 deg/h"}, {}, "--gyro-bias = '-1 deg/h' must not be negative"),
        ({"gyro_noise": "0.1 mg"}, {}, "'mg' is a unit of acceleration"),
        ({}, {"tau": 0.0}, "tau = 0.0 must be"),
        ({}, {"bandwidth": -1.0}, "bandwidth = -1.0 must be"),
        ({}, {"order": 5}, "order = 5 must be one of 1, 2, 3, 4"),
    ],
)
def test_figures_that_make_no_sense(figures, reading, message):
    with pytest.raises(ConfigError, match=message):
        from_sheet(figures, SheetReading(**reading))
