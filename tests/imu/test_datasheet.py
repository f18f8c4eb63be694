from __future__ import annotations

import math

import numpy as np
import pytest

from navfuse.analysis.allan.terms import gauss_markov_allan
from navfuse.config.imu_section import imu_section, model_of_file
from navfuse.core.constants import ALLAN_FLOOR
from navfuse.errors import ConfigError
from navfuse.imu.datasheet import NOISE_BANDWIDTH, PEAK, SheetReading, from_sheet, sheet_fields, to_sheet
from navfuse.imu.grades import grade
from navfuse.io.unit_text import parse_measure

DEG = math.pi / 180.0


def test_constants():
    curve = np.sqrt(gauss_markov_allan(np.linspace(1.0, 3.0, 2001), 1.0))
    assert curve.max() == pytest.approx(PEAK, abs=5e-5)
    assert pytest.approx(0.6643, abs=5e-5) == ALLAN_FLOOR
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
    untouched, told = from_sheet({"gyro_noise": "0.3 deg/sqrt(h)"}, SheetReading(one_sided=True))
    assert untouched.arw == pytest.approx(same.arw)
    assert "--one-sided changes nothing" in told[0]


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
    assert other.gyro_bias_sd == pytest.approx(ALLAN_FLOOR * model.gyro_bias_sd)
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


# Figures of the size and in the form in which data sheets of these sensors print them; examples, but for those of the
# ADIS16405 (docs/allan.md). The right side is by hand: 1 deg = 0.01745329 rad, 1 g = 9.80665 m/s^2, 1 ft = 0.3048 m.
HAND = [
    # ADIS16405: 2.0 / 60 x 0.01745329; one-sided density 0.05 / 1.4142136; 0.2 / 60; 0.2e-3 x 9.80665 / 0.6174
    ("gyro_noise", "2.0 °/√hr", {}, "arw", 5.817764e-4),
    ("gyro_noise", "0.05 °/s/√Hz", {"one_sided": True}, "arw", 6.170671e-4),
    ("accel_noise", "0.2 m/s/√hr", {}, "vrw", 3.333333e-3),
    ("accel_bias", "0.2 mg", {}, "accel_bias_sd", 3.176757e-3),
    # BMI088: 0.014 deg/s/rtHz; 175e-6 x 9.80665; 0.1 deg/s in 47 Hz, f_n = 1.5707963 x 47 = 73.82743, / sqrt(147.65486)
    ("gyro_noise", "0.014 °/s/√Hz", {}, "arw", 2.443461e-4),
    ("accel_noise", "175 µg/√Hz", {}, "vrw", 1.716164e-3),
    ("gyro_noise", "0.1 °/s", {"bandwidth": 47.0}, "arw", 1.436327e-4),
    # VN-100: 0.0035 deg/s/rtHz; 0.14e-3 x 9.80665; 5 deg/h / 3600 x 0.01745329 / 0.6174
    ("gyro_noise", "0.0035 °/s/√Hz", {}, "arw", 6.108652e-5),
    ("accel_noise", "0.14 mg/√Hz", {}, "vrw", 1.372931e-3),
    ("gyro_bias", "5 °/hr", {}, "gyro_bias_sd", 3.926252e-5),
    # ICM-42688: 2.8e-3 deg/s/rtHz, one-sided; 70e-6 x 9.80665; 2 mg rms in 100 Hz of order 2, f_n = 111.07207
    ("gyro_noise", "2.8 mdps/√Hz", {"one_sided": True}, "arw", 3.455576e-5),
    ("accel_noise", "70 μg/rt(Hz)", {}, "vrw", 6.864655e-4),
    ("accel_noise", "2 mg", {"bandwidth": 100.0, "order": 2}, "vrw", 1.315931e-3),
    # HG1700 class: 0.125 / 60 deg; 0.065 x 0.3048 / 60; B = 1 deg/h, floor 0.6642824, sd 1.075935 deg/h; 1 mg turn-on
    ("gyro_noise", "0.125 deg/rt-hr", {}, "arw", 3.636103e-5),
    ("accel_noise", "0.065 ft/s/√hr", {}, "vrw", 3.302000e-4),
    ("gyro_bias", "1 deg/hr", {"coefficient": True}, "gyro_bias_sd", 5.216280e-6),
    ("accel_turn_on", "1 mg", {}, "accel_bias_sd", 9.80665e-3),
]


@pytest.mark.parametrize(("name", "figure", "reading", "field", "value"), HAND)
def test_figures_of_data_sheets_by_hand(name, figure, reading, field, value):
    model, formulas = from_sheet({name: figure}, SheetReading(**reading))
    assert getattr(model, field) == pytest.approx(value, rel=1e-6)
    assert formulas


@pytest.mark.parametrize(
    ("entry", "figure", "row"),
    [
        ("gyro_noise", "0.168 deg/sqrt(h)", "gyro random walk N"),
        ("accel_noise", "70 ug/sqrt(Hz)", "accel random walk N"),
        ("gyro_bias", "7.3 deg/h", "gyro in-run bias stability"),
        ("accel_bias", "0.0413 mg", "accel in-run bias stability"),
        ("gyro_walk", "8.1 deg/h/sqrt(h)", "gyro rate random walk K"),
        ("accel_walk", "0.0517 mg/sqrt(h)", "accel rate random walk K"),
        ("gyro_turn_on", "0.23 deg/s", "gyro bias, one sigma"),
        ("accel_turn_on", "16.7 mg", "accel bias, one sigma"),
    ],
)
def test_there_and_back_with_all_digits(tmp_path, entry, figure, row):
    model, _ = from_sheet({entry: figure})
    path = tmp_path / "imu.toml"
    path.write_text(imu_section(model, (), sheet_fields({entry: figure}), 17))
    back = {what: text for what, text, _ in to_sheet(model_of_file(path), digits=17)}[row]
    given = parse_measure(figure).value
    assert [parse_measure(text).value for text in back.split(" = ")] == pytest.approx([given, given], rel=1e-12)
    again, _ = from_sheet({entry: back.split(" = ")[0]})
    for field in sheet_fields({entry: figure}):
        assert getattr(again, field) == pytest.approx(getattr(model, field), rel=1e-12)


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_one_sided_densities_and_rms_noise_there_and_back(order):
    model, _ = from_sheet({"gyro_noise": "0.0123 deg/s/sqrt(Hz)", "accel_noise": "0.91 mg/sqrt(Hz)"})
    rows = {what: text for what, text, _ in to_sheet(model, 47.0, order, 17)}
    for reading, kind in (
        (SheetReading(one_sided=True), "one-sided noise density"),
        (SheetReading(bandwidth=47.0, order=order), "rms noise in 47 Hz"),
    ):
        figures = {f"{sensor}_noise": rows[f"{sensor} {kind}"].split(" = ")[0] for sensor in ("gyro", "accel")}
        back, _ = from_sheet(figures, reading)
        assert back.arw == pytest.approx(model.arw, rel=1e-12)
        assert back.vrw == pytest.approx(model.vrw, rel=1e-12)


@pytest.mark.parametrize("digits", [0, -1, 18])
def test_digits_that_no_number_has(digits):
    with pytest.raises(ConfigError, match=f"digits = {digits} must be 1 to 17"):
        to_sheet(grade("tactical"), digits=digits)


@pytest.mark.parametrize(
    ("figures", "reading", "message"),
    [
        ({"gyro_nose": "1 deg/h"}, {}, "unknown entry 'gyro_nose'"),
        ({"gyro_noise": "0.1 deg/s"}, {}, "is an rms noise: it needs --bandwidth"),
        ({"gyro_bias": "-1 deg/h"}, {}, "--gyro-bias = '-1 deg/h' must not be negative"),
        ({"gyro_noise": "0.1 mg"}, {}, "'mg' is a unit of acceleration"),
        ({}, {"tau": 0.0}, "tau = 0.0 must be"),
        ({}, {"bandwidth": -1.0}, "bandwidth = -1.0 must be"),
        ({"gyro_noise": "1 deg/sqrt(h)"}, {"bandwidth": 50.0}, "--bandwidth is for an rms noise, and none is given"),
        ({"gyro_noise": "1 deg/sqrt(h)"}, {"coefficient": True}, "--coefficient is for a bias instability, and none"),
        ({}, {"order": 5}, "order = 5 must be one of 1, 2, 3, 4"),
    ],
)
def test_figures_that_make_no_sense(figures, reading, message):
    with pytest.raises(ConfigError, match=message):
        from_sheet(figures, SheetReading(**reading))
