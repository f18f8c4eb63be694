"""The flight of the thesis: its Simple EKF is the engine with a configuration, and both filters do what they claim."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from navfuse.core.earth import ecef_to_geodetic, geodetic_to_ecef_batch
from navfuse.errors import ConfigError
from navfuse.filters.ekf import ErrorStateFilter, FilterSettings
from navfuse.imu.increments import to_increments
from navfuse.reproduce import STUDIES, Wishes, reproduce
from navfuse.reproduce import ins_gps_thesis as thesis
from navfuse.simulation.drawn_start import true_start, wrong_start
from navfuse.simulation.scenario_run import run_scenario, section_stream
from reference.lecture_ins_gnss_twin import gradient, mechanized, rotated, second_order
from reference.navigation_algebra import dcm, rotation_en

I3, ZERO = np.eye(3), np.zeros((3, 3))


def test_nine_states_are_the_engine_with_an_attitude_that_is_known():
    """Velocity, position and accelerometer bias in e, written out, against the engine told a known attitude."""
    setup = replace(thesis.SIMPLE, gnss_rate=10.0, frame="ecef")
    scenario, truth = thesis._scenario(True, False, 10.0)
    logs = run_scenario(scenario, 3, truth=truth, aiding=False)
    fixes = replace(logs.gnss, sd_position=np.full_like(logs.gnss.sd_position, 4.0))
    start, root = true_start(truth.motion, 0.0, np.full(3, 4.0), np.full(3, 0.03), np.zeros(3))
    start = wrong_start(start, root, section_stream(3, "start"))
    model = thesis.told_model(setup)
    increments = to_increments(logs.imu).piece(0, 2000)
    settings = FilterSettings(ecef=True, covariance_period=0.0, gated=False)
    engine = ErrorStateFilter(start, model, thesis._sensors(fixes, setup), settings)
    v, r, b = slice(0, 3), slice(3, 6), slice(6, 9)
    P = np.zeros((9, 9))
    P[v, v], P[r, r] = engine.P[3:6, 3:6], engine.P[:3, :3]
    P[b, b] = np.square(model.axes("accel_bias_sd")) * I3
    at, speed, C, bias = engine.nav[:3].copy(), engine.nav[3:6].copy(), dcm(engine.nav[6:10]), np.zeros(3)
    engine.feed(increments)

    Q = np.zeros((9, 9))
    Q[v, v] = model.vrw**2 * I3
    places = geodetic_to_ecef_batch(fixes.lat, fixes.lon, fixes.height)
    at_fix = {round(time * 100): k for k, time in enumerate(fixes.time)}

    def use(what, value, sd):
        nonlocal at, speed, bias, P
        H = np.zeros((3, 9))
        H[:, what] = I3
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + sd**2 * I3)
        dx = K @ (value - (at if what == r else speed))
        A = np.eye(9) - K @ H
        P = A @ P @ A.T + sd**2 * K @ K.T
        at, speed, bias = at + dx[r], speed + dx[v], bias + dx[b]

    def fix(k):
        use(r, places[k], 4.0)
        lat, lon, _ = ecef_to_geodetic(*at)
        use(v, rotation_en(lat, lon) @ fixes.velocity_n[k], fixes.sd_velocity[k, 0])

    if 0 in at_fix:
        fix(at_fix[0])
    for k, dt in enumerate(increments.dt):
        theta, u = increments.inc_theta_b[k], increments.inc_v_b[k] - bias * dt
        force, before = rotated(theta, u), C
        at, speed, C = mechanized(at, speed, C, dt, theta, force)
        whole = second_order(dt, before @ force, 0.5 * (before + C) * dt, gradient(at))
        Phi = whole[3:12, 3:12]
        P = Phi @ (P + 0.5 * dt * Q) @ Phi.T + 0.5 * dt * Q
        if k + 1 in at_fix:
            fix(at_fix[k + 1])
    order = np.r_[3:6, 0:3, 9:12]
    sd = np.sqrt(np.diag(P))
    assert engine.layout.names == ("position", "velocity", "attitude", "accel_bias")
    assert np.abs(engine.P[6:9]).max() == 0.0
    assert np.abs(engine.nav[:3] - at).max() < 1e-6
    assert np.abs(engine.nav[3:6] - speed).max() < 1e-9
    assert np.abs(engine.s - bias).max() < 1e-9
    np.testing.assert_allclose(engine.P[np.ix_(order, order)] / np.outer(sd, sd), P / np.outer(sd, sd), atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(("setup", "components"), [(thesis.SIMPLE, 6), (thesis.FULL, 9)], ids=["simple", "full"])
def test_the_filters_are_consistent_at_the_end(setup, components):
    runs = 20
    flown = [thesis.fly(replace(setup, gnss_rate=10.0), seed) for seed in range(100, 100 + runs)]
    ratio = np.array([one.error[-1, :components] / one.sd[-1, :components] for one in flown])
    for k in range(components):
        low, high = chi2.ppf((0.0005, 0.9995), runs)
        assert low < np.sum(ratio[:, k] ** 2) < high, thesis.COLUMNS[k]


def test_perfect_sensors_stay_on_the_truth():
    flown = thesis.fly(thesis.PERFECT, 1)
    assert np.abs(flown.error[:, :3]).max() < 1e-3
    assert np.abs(flown.error[:, 3:6]).max() < 1e-5
    assert np.abs(flown.error[:, 6:]).max() < 1e-6


def test_sensors_without_errors_leave_the_other_draws_alone():
    one, other = (thesis._scenario(True, gyro, 10.0) for gyro in (True, False))
    both = [run_scenario(scenario, 5, truth=truth, aiding=False) for scenario, truth in (one, other)]
    np.testing.assert_array_equal(both[0].imu.accel, both[1].imu.accel)
    np.testing.assert_array_equal(both[0].gnss.lat, both[1].gnss.lat)
    assert not np.array_equal(both[0].imu.gyro, both[1].imu.gyro)


def test_the_study_writes_its_tables_and_figures(tmp_path, monkeypatch):
    """All of it on a flight of seconds, with one run."""
    for name in ("RATES_HZ", "OUTAGES_S"):
        monkeypatch.setattr(thesis, name, getattr(thesis, name)[-1:])
    monkeypatch.setattr(thesis, "FACTORS", (1.0,))
    monkeypatch.setattr(thesis, "OUTAGE_FROM_S", 5.0)
    monkeypatch.setattr(thesis, "OUTAGES_S", (3.0,))
    original = thesis.load_scenario
    monkeypatch.setattr(
        thesis, "load_scenario", lambda name, changes: original(name, {**changes, "": {"duration_s": 12.0}})
    )
    thesis._scenario.cache_clear()
    try:
        study = reproduce("ins-gps-thesis", Wishes(runs=2))
        files = study.write(tmp_path / "out")
    finally:
        thesis._scenario.cache_clear()
    assert all(path.is_file() and path.stat().st_size > 500 for path in files)
    assert study.tables[0].title.startswith("Errors at 12 s, rms over 2 runs")
    text = study.text()
    for name in thesis.CASES:
        assert name in text
    assert "Full EKF" in (tmp_path / "out" / "ins-gps-thesis.md").read_text(encoding="utf-8")


def test_wishes_that_cannot_be():
    with pytest.raises(ConfigError, match="at least one run"):
        reproduce("ins-gps-thesis", Wishes(runs=0))
    with pytest.raises(ConfigError, match="is 'ins-gps-thesis' meant"):
        reproduce("ins-gps-thesi")
    assert "ins-gps-thesis" in STUDIES
