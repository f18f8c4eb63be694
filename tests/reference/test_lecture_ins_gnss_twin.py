"""The open-loop INS/GNSS integration of the lecture is the engine with a configuration."""

import numpy as np
import pytest

from navfuse.aiding.gnss_fix import GnssPosition, GnssVelocity
from navfuse.core.earth import ecef_to_geodetic, geodetic_to_ecef_batch
from navfuse.data.logs import GnssLog
from navfuse.filters.ekf import ErrorStateFilter, FilterSettings
from navfuse.imu.error_model import ImuErrorModel
from navfuse.imu.increments import ImuIncrements
from reference.engine_runs import perfect_increments, start_at
from reference.lecture_ins_gnss_twin import BA, BG, PSI, OpenLoop, R, V
from reference.missions import mission
from reference.navigation_algebra import dcm, rotation_en

DURATION, RATE = 60.0, 100.0
SD_POSITION, SD_VELOCITY = 2.5, 0.1
MODEL = ImuErrorModel.from_datasheet(
    arw_deg_per_sqrt_h=0.02,
    accel_noise_ug_per_sqrt_hz=200.0,
    gyro_bias_sd_dph=10.0,
    gyro_bias_walk_dph_per_sqrt_h=2.0,
    accel_bias_sd_mg=1.0,
    accel_bias_walk_mg_per_sqrt_h=0.1,
)
ORDER = np.r_[6:9, 3:6, 0:3, 12:15, 9:12]
"""Our states in the order of the lecture."""


def _scene(rate):
    motion = mission("aircraft", DURATION)
    increments = perfect_increments(motion, rate)
    rng = np.random.default_rng(4)
    dt = increments.dt[:, np.newaxis]
    shape = increments.inc_theta_b.shape
    bias_g, bias_a = 5e-5 * rng.standard_normal(3), 0.01 * rng.standard_normal(3)
    increments = ImuIncrements(
        increments.time,
        increments.inc_theta_b + bias_g * dt + MODEL.arw * np.sqrt(dt) * rng.standard_normal(shape),
        increments.inc_v_b + bias_a * dt + MODEL.vrw * np.sqrt(dt) * rng.standard_normal(shape),
    )
    start = start_at(motion, 0.0, np.full(3, 3.0), np.full(3, 0.2), np.radians([0.5, 0.5, 1.0]), rng)
    time = np.arange(1.0, DURATION + 0.5)
    truth = motion.trajectory(time)
    log = GnssLog(
        time,
        truth.lat + SD_POSITION / 6.4e6 * rng.standard_normal(time.size),
        truth.lon + SD_POSITION / 6.4e6 * rng.standard_normal(time.size),
        truth.height + SD_POSITION * rng.standard_normal(time.size),
        np.full((time.size, 3), SD_POSITION),
        truth.velocity_n + SD_VELOCITY * rng.standard_normal((time.size, 3)),
        np.full((time.size, 3), SD_VELOCITY),
    )
    return increments, start, log


def _engine(increments, start, log):
    settings = FilterSettings(ecef=True, open_loop=True, covariance_period=0.0, output_period=-1.0, gated=False)
    sensors = (GnssPosition(log, np.zeros(3)), GnssVelocity(log, np.zeros(3)))
    filter_ = ErrorStateFilter(start, MODEL, sensors, settings)
    filter_.feed(increments)
    return filter_


def _twin(increments, start, log, second_order=True):
    first = ErrorStateFilter(start, MODEL, (), FilterSettings(ecef=True))
    nav, P = first.nav, first.P[np.ix_(ORDER, ORDER)]
    twin = OpenLoop(nav[:3].copy(), nav[3:6].copy(), dcm(nav[6:10]), np.zeros(15), P.copy())
    walks = [MODEL.axes(f"{name}_bias_walk")[0] for name in ("gyro", "accel")]
    noise = np.square([MODEL.arw, MODEL.vrw, *walks])
    r_e = geodetic_to_ecef_batch(log.lat, log.lon, log.height)
    fix = 0
    for k, dt in enumerate(increments.dt):
        twin.advance(dt, increments.inc_theta_b[k], increments.inc_v_b[k], noise, second_order)
        if fix < log.time.size and abs(increments.time[k + 1] - log.time[fix]) < 1e-9:
            twin.measure(R, r_e[fix], SD_POSITION)
            # north and east of the velocity are those at the best position, which is some metres from the fix
            lat, lon, _ = ecef_to_geodetic(*(twin.r + twin.x[R]))
            twin.measure(V, rotation_en(lat, lon) @ log.velocity_n[fix], SD_VELOCITY)
            fix += 1
    assert fix == log.time.size
    return twin


def _differences(filter_, twin):
    """Solution, errors estimated and their sigmas: largest difference over the size of each."""
    nav, x, P = filter_.nav, filter_.x[ORDER], filter_.P[np.ix_(ORDER, ORDER)]
    sd, sd_twin = np.sqrt(np.diag(P)), np.sqrt(np.diag(twin.P))
    return {
        "position": np.linalg.norm(nav[:3] - twin.r) / np.linalg.norm(twin.r),
        "velocity": np.linalg.norm(nav[3:6] - twin.v) / np.linalg.norm(twin.v),
        "attitude": np.abs(dcm(nav[6:10]) - twin.C).max(),
        "errors": max(np.linalg.norm((x - twin.x)[b]) / np.linalg.norm(twin.x[b]) for b in (PSI, V, R, BA, BG)),
        "sigmas": np.abs(sd / sd_twin - 1.0).max(),
        "correlations": np.abs((P - twin.P) / np.outer(sd_twin, sd_twin)).max(),
    }


def test_the_engine_is_the_filter_of_the_lecture():
    scene = _scene(RATE)
    found = _differences(_engine(*scene), _twin(*scene))
    assert max(found.values()) < 1e-9, found


@pytest.mark.slow
def test_the_matrix_as_printed_is_the_first_order_of_it():
    sizes = []
    for rate in (50.0, 100.0, 200.0):
        scene = _scene(rate)
        sizes.append(_differences(_engine(*scene), _twin(*scene, second_order=False))["sigmas"])
    assert sizes[1] == pytest.approx(0.5 * sizes[0], rel=0.3)
    assert sizes[2] == pytest.approx(0.5 * sizes[1], rel=0.3)


def test_the_order_of_the_states():
    first = ErrorStateFilter(_scene(RATE)[1], MODEL, (), FilterSettings(ecef=True))
    names = {"gyro_bias": BG, "accel_bias": BA}
    for name, where in names.items():
        assert ORDER[where].tolist() == list(range(*first.layout.slice(name).indices(15)))
    assert [ORDER[where].tolist() for where in (R, V, PSI)] == [[0, 1, 2], [3, 4, 5], [6, 7, 8]]
