from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from navfuse.errors import ConfigError, InputError
from navfuse.simulation import BodyVelocityModel, measure_body_velocity, static
from reference.aiding_sensors import attitude_b, point_velocity_twin, sway, within_chi_square

ARM = (-2.0, 1.5, 3.0)
JANUS = {"beam_angle_deg": 30.0, "beam_azimuth_deg": 45.0}


def measure(motion, seed=0, **keys):
    return measure_body_velocity(motion, BodyVelocityModel.from_datasheet(**keys), np.random.default_rng(seed))


@pytest.mark.parametrize("beams", [{}, JANUS])
def test_without_errors_it_is_the_velocity_of_its_point(beams):
    motion = sway()
    log, truth = measure(motion, rate_hz=2.0, offset_s=1.03, lever_arm_m=ARM, **beams)
    twin = point_velocity_twin(motion, log.time[:-1], ARM)
    np.testing.assert_allclose(log.velocity_b[:-1], twin, atol=1e-5)
    np.testing.assert_allclose(log.velocity_b, truth.velocity_b, atol=1e-12)
    assert log.sd_velocity is None
    assert np.ptp(log.velocity_b, axis=0).min() > 0.2


def test_against_water_the_current_is_missing():
    motion = sway()
    current = (0.5, -1.0, 0.1)
    log, _ = measure(motion, rate_hz=2.0, current_mps=current)
    ground, _ = measure(motion, rate_hz=2.0)
    turned = attitude_b(motion, log.time).apply(ground.velocity_b - log.velocity_b)
    np.testing.assert_allclose(turned, np.tile(current, (log.time.size, 1)), atol=1e-10)


def test_a_sensor_turned_to_the_right_sees_forward_motion_from_the_right():
    log, truth = measure(sway(), misalignment_deg=(0.0, 0.0, 10.0))
    speed = truth.velocity_b[:, 0]
    np.testing.assert_allclose(log.velocity_b[:, 0], speed * math.cos(math.radians(10.0)), atol=0.01)
    np.testing.assert_allclose(log.velocity_b[:, 1], -speed * math.sin(math.radians(10.0)), atol=0.01)


def test_the_log_is_made_of_the_stated_parts_and_rounded():
    log, truth = measure(sway(), lever_arm_m=ARM, scale_percent=(1.0, 2.0, 3.0), scale_sd_percent=0.5,
                         misalignment_deg=(1.0, -2.0, 3.0), misalignment_sd_deg=0.5, velocity_sd_mps=0.05,
                         velocity_lsb_mmps=10.0)  # fmt: skip
    seen = Rotation.from_rotvec(truth.misalignment).apply(truth.velocity_b, inverse=True)
    assert abs(log.velocity_b - (1.0 + truth.scale) * seen - truth.noise).max() <= 0.005 + 1e-12
    np.testing.assert_allclose(log.velocity_b / 0.01, np.rint(log.velocity_b / 0.01), atol=1e-6)
    np.testing.assert_allclose(log.sd_velocity, math.hypot(0.05, 0.01 / math.sqrt(12.0)))


@pytest.mark.parametrize(("axes", "measured"), [("x", 1), ("xy", 2), ("xyz", 3)])
def test_axes_that_are_not_measured_are_nan_and_have_no_column(axes, measured):
    log, _ = measure(static(20.0), axes=axes, velocity_sd_mps=0.1)
    assert np.isfinite(log.velocity_b[:, :measured]).all()
    assert np.isnan(log.velocity_b[:, measured:]).all()
    np.testing.assert_array_equal(np.isnan(log.sd_velocity), np.isnan(log.velocity_b))
    velocities, sigmas = [[f"{lead}v_{axis}_mps" for axis in axes] for lead in ("", "sd_")]
    assert list(log.columns()) == ["time_s", *velocities, *sigmas]


def test_errors_have_the_stated_deviations():
    _, truth = measure(static(4000.0), rate_hz=1.0, velocity_sd_mps=(0.01, 0.02, 0.03))
    assert within_chi_square(truth.noise, (0.01, 0.02, 0.03))
    short = static(2.0)
    keys = {"scale_percent": 1.0, "scale_sd_percent": (0.5, 1.0, 2.0), "misalignment_deg": (1.0, 2.0, 3.0)}
    truths = [measure(short, seed, misalignment_sd_deg=(0.1, 0.2, 0.3), **keys)[1] for seed in range(500)]
    assert within_chi_square(np.array([t.scale for t in truths]) - 0.01, (0.005, 0.01, 0.02))
    angles = np.degrees([t.misalignment for t in truths]) - (1.0, 2.0, 3.0)
    assert within_chi_square(angles, (0.1, 0.2, 0.3))


@pytest.mark.parametrize("azimuth", [45.0, 0.0, 17.0])
def test_four_beams_make_the_noise_that_geometry_says(azimuth):
    """Pairs of opposite beams: sd / (sqrt(2) sin) across, sd / (2 cos) along the axis, at any azimuth."""
    log, truth = measure(static(4000.0), rate_hz=1.0, beam_angle_deg=30.0, beam_azimuth_deg=azimuth, beam_sd_mps=0.02)
    across, along = 0.02 / (math.sqrt(2.0) * 0.5), 0.02 / (2.0 * math.cos(math.radians(30.0)))
    np.testing.assert_allclose(log.sd_velocity, np.tile([across, across, along], (4001, 1)))
    assert within_chi_square(truth.noise, (across, across, along))
    assert truth.beams.all()


def test_the_beams_point_where_stated():
    beams = BodyVelocityModel.from_datasheet(**JANUS).beams_b
    np.testing.assert_allclose(np.linalg.norm(beams, axis=1), 1.0)
    np.testing.assert_allclose(beams[:, 2], math.cos(math.radians(30.0)))
    across = 0.5 * math.sqrt(0.5)
    np.testing.assert_allclose(beams[:, :2], across * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]))


def test_three_beams_are_enough_and_two_are_not():
    log, truth = measure(static(4000.0), rate_hz=1.0, beam_sd_mps=0.02, beam_dropped_percent=20.0, **JANUS)
    echoes = truth.beams.sum(axis=1)
    assert set(echoes) == {3, 4}
    kept = 0.8**4 + 4 * 0.8**3 * 0.2
    assert abs(log.time.size - 4001 * kept) < 3.5 * math.sqrt(4001 * kept * (1.0 - kept))
    assert abs(np.mean(echoes == 4) - 0.8**4 / kept) < 3.5 * math.sqrt(0.25 / log.time.size)
    assert within_chi_square(truth.noise / log.sd_velocity, 1.0)
    assert log.sd_velocity[echoes == 3].min(axis=0)[0] > log.sd_velocity[echoes == 4].max(axis=0)[0]


def test_sigmas_are_those_of_the_beams_that_found_an_echo():
    keys = {"beam_angle_deg": 30.0, "beam_azimuth_deg": 17.0}
    log, truth = measure(static(400.0), rate_hz=1.0, beam_sd_mps=0.02, beam_dropped_percent=20.0, **keys)
    beams = BodyVelocityModel.from_datasheet(**keys).beams_b
    normal = [np.linalg.inv(beams[used].T @ beams[used]) for used in truth.beams]
    np.testing.assert_allclose(log.sd_velocity, 0.02 * np.sqrt([np.diag(matrix) for matrix in normal]))
    assert len(np.unique(truth.beams, axis=0)) == 5


def test_outages_and_losses_leave_no_rows():
    log, truth = measure(static(4000.0), rate_hz=1.0, outages_s=[[10.0, 20.0], [15.0, 30.0]], latency_s=2.0)
    hidden = np.setdiff1d(np.arange(4001.0), truth.true_time)
    np.testing.assert_array_equal(hidden, np.arange(10.0, 30.0))
    np.testing.assert_array_equal(log.time, truth.true_time + 2.0)
    lost, _ = measure(static(4000.0), rate_hz=1.0, dropped_percent=10.0)
    assert abs(lost.time.size - 0.9 * 4001) < 3.5 * math.sqrt(4001 * 0.09)


@pytest.mark.parametrize("on", [{"beam_dropped_percent": 20.0}, {"dropped_percent": 20.0}, {"outages_s": [[3.0, 9.0]]}])
def test_losses_leave_the_noise_of_four_beams_alone(on):
    motion = static(200.0)
    full, less = (measure(motion, 5, beam_sd_mps=0.02, **JANUS, **keys)[1] for keys in ({}, on))
    rows = np.searchsorted(full.true_time, less.true_time)
    whole = less.beams.all(axis=1)
    assert less.true_time.size < full.true_time.size
    np.testing.assert_array_equal(less.noise[whole], full.noise[rows[whole]])


def test_no_row_at_all_is_refused():
    with pytest.raises(InputError, match="none of the 11 rows of the body velocity survives outages and losses"):
        measure(static(2.0), rate_hz=5.0, outages_s=[[0.0, 10.0]])


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"axes": "yz"}, "axes must be one of x, xy, xyz, not 'yz'"),
        ({"dropped_percent": 100.0}, r"dropped must be a chance below 1 \(100 %\), not 1"),
        ({"beam_sd_mps": 0.1}, "beam_sd and beam_dropped need beam_angle > 0"),
        ({"beam_dropped_percent": 1.0}, "beam_sd and beam_dropped need beam_angle > 0"),
        ({"beam_angle_deg": 90.0}, "beam_angle must be below 90 deg"),
        ({"beam_angle_deg": 30.0, "axes": "x"}, "four beams give all three axes"),
        ({"beam_angle_deg": 30.0, "velocity_sd_mps": 0.1}, "give beam_sd, not velocity_sd"),
        ({"scale_percent": (1.0, 2.0)}, "scale must be one number or one for each of the 3 axes"),
        ({"outages_s": [1.0, 2.0]}, r"outages must be windows \[from, to\]"),
    ],
)
def test_settings_that_make_no_sense_are_refused(keys, message):
    with pytest.raises(ConfigError, match=message):
        BodyVelocityModel.from_datasheet(**keys)
