from __future__ import annotations

import math

import numpy as np
import pymap3d
import pytest

from navfuse.errors import ConfigError, InputError
from navfuse.simulation import UwbAnchor, UwbModel, measure_uwb, static
from reference.aiding_sensors import ANCHORS, sway, within_chi_square

ARM = (1.0, -2.0, -1.5)


def measure(motion, seed=0, **keys):
    model = UwbModel.from_datasheet(**({"anchors": ANCHORS} | keys))
    return measure_uwb(motion, model, np.random.default_rng(seed))


def test_without_errors_it_is_the_distance_of_the_antenna():
    motion = sway()
    log, truth = measure(motion, rate_hz=4.0, lever_arm_m=ARM)
    antenna = motion.r_e(log.time) + motion.C_eb(log.time) @ np.array(ARM)
    places = {a["name"]: pymap3d.geodetic2ecef(a["lat_deg"], a["lon_deg"], a["height_m"]) for a in ANCHORS}
    twin = np.linalg.norm(antenna - np.array([places[name] for name in log.anchor]), axis=1)
    np.testing.assert_allclose(log.range, twin, atol=1e-6)
    np.testing.assert_array_equal(log.range, truth.range)
    assert log.sd_range is None
    assert np.ptp(log.range[::3]) > 100.0


def test_anchors_are_polled_in_turn():
    log, truth = measure(static(10.0, 0.8, 0.2, 100.0), rate_hz=5.0)
    np.testing.assert_array_equal(log.anchor[:4], ["mast", "roof", "gate", "mast"])
    np.testing.assert_array_equal(truth.anchor, np.arange(51) % 3)
    np.testing.assert_allclose(np.diff(log.time[truth.anchor == 0]), 0.6)


def test_beyond_its_reach_an_anchor_is_silent():
    motion = sway()
    full, _ = measure(motion, 3, range_sd_m=0.1)
    reach = float(np.median(full.range))
    log, truth = measure(motion, 3, range_sd_m=0.1, max_range_m=reach)
    heard = measure(motion)[1].range <= reach
    np.testing.assert_array_equal(log.time, full.time[heard])
    np.testing.assert_array_equal(log.range, full.range[heard])
    assert truth.range.max() <= reach


def test_all_anchors_out_of_reach_are_refused():
    with pytest.raises(InputError, match=r"no anchor is within 10 m, the nearest one is .* m away; give anchors near"):
        measure(sway(), max_range_m=10.0)


def test_the_log_is_made_of_the_stated_parts_and_rounded():
    log, truth = measure(sway(), bias_m=(0.1, -0.2, 0.3), bias_sd_m=0.1, range_sd_m=0.1, nlos_percent=20.0,
                         nlos_mean_m=2.0, range_lsb_cm=5.0)  # fmt: skip
    total = truth.range + truth.bias[truth.anchor] + truth.nlos + truth.noise
    assert abs(log.range - total).max() <= 0.025 + 1e-9
    np.testing.assert_allclose(log.range / 0.05, np.rint(log.range / 0.05), atol=1e-6)
    np.testing.assert_allclose(log.sd_range, math.hypot(0.1, 0.05 / math.sqrt(12.0)))


def test_a_range_is_never_negative():
    motion = static(200.0, math.radians(45.84), math.radians(11.46), 300.0)
    log, _ = measure(motion, anchors=ANCHORS[:1], range_sd_m=1.0)
    assert log.range.min() == 0.0


def test_errors_have_the_stated_deviations():
    motion = static(4000.0)
    _, truth = measure(motion, rate_hz=1.0, range_sd_m=0.1, nlos_percent=25.0, nlos_mean_m=2.0)
    assert within_chi_square(truth.noise[:, None], 0.1)
    detours = truth.nlos[truth.nlos > 0.0]
    assert abs(detours.size - 0.25 * 4001) < 3.5 * math.sqrt(4001 * 0.1875)
    assert detours.mean() == pytest.approx(2.0, rel=3.5 / math.sqrt(detours.size))
    assert np.mean(detours > 2.0) == pytest.approx(math.exp(-1.0), abs=3.5 * 0.5 / math.sqrt(detours.size))
    short = static(2.0)
    biases = [measure(short, s, bias_m=0.5, bias_sd_m=(0.1, 0.2, 0.3))[1].bias for s in range(500)]
    assert within_chi_square(np.array(biases) - 0.5, (0.1, 0.2, 0.3))


def test_the_table_of_anchors_is_that_of_the_model():
    table = UwbModel(anchors=(UwbAnchor("a", 48.0, -120.0, 5.0),)).anchor_table()
    columns = table.columns()
    assert list(columns) == ["anchor", "lat_deg", "lon_deg", "height_m"]
    assert columns["anchor"].tolist() == ["a"]
    np.testing.assert_allclose([columns[name][0] for name in ("lat_deg", "lon_deg", "height_m")], [48.0, -120.0, 5.0])


PLACE = {"lat_deg": 1.0, "lon_deg": 2.0, "height_m": 3.0}


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"anchors": ()}, "anchors must name at least one anchor"),
        ({"anchors": [PLACE | {"name": "a"}] * 2}, "the anchor 'a' is there twice"),
        ({"anchors": [PLACE | {"name": " "}]}, "an anchor needs a name, not ' '"),
        ({"anchors": [{"name": "a", "lat_deg": 1.0}]}, "lacks lon_deg, height_m"),
        ({"anchors": [PLACE | {"name": "a", "heigth_m": 1.0}]}, "'heigth_m': did you mean 'height_m'"),
        ({"anchors": [PLACE | {"name": "a", "lat_deg": 91.0}]}, r"lat_deg of anchor 'a' must be within \+-90, not 91"),
        ({"anchors": [PLACE | {"name": "a", "height_m": np.nan}]}, "height_m of anchor 'a' must be a number"),
        ({"anchors": 4}, "anchors must be a list, not 4"),
        ({"anchors": "mast"}, "anchors must be a list, not 'mast'"),
        ({"anchors": ["a"]}, "anchors must hold UwbAnchor or tables of its fields, not str"),
        ({"bias_m": (1.0, 2.0)}, "bias must be one number or one for each of the 3 anchors"),
        ({"max_range_m": 0.0}, "max_range must be more than 0"),
        ({"nlos_percent": 101.0, "nlos_mean_m": 1.0}, "nlos_fraction must be a chance of at most 1"),
        ({"nlos_percent": 10.0}, "detours need nlos_fraction and nlos_mean > 0"),
    ],
)  # fmt: skip
def test_settings_that_make_no_sense_are_refused(keys, message):
    with pytest.raises(ConfigError, match=message):
        UwbModel.from_datasheet(**({"anchors": ANCHORS} | keys))
