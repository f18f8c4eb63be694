"""The six-state DR/GNSS filter: its twin, its frames, its loops, its smoother, its claims; a published exercise."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from navfuse.core.earth import dcm_en, ecef_to_geodetic_batch, geodetic_to_ecef_batch
from navfuse.data.logs import GnssLog
from navfuse.data.trajectory import Trajectory
from navfuse.dead_reckoning.integration import DrModel, at_epochs, integrate
from navfuse.dead_reckoning.odometry import StartPoint, from_velocity
from navfuse.errors import ConfigError, FilterError, InputError

START = StartPoint(np.radians(50.4), np.radians(-3.6), 37.0)
MODEL = DrModel(velocity_psd=0.05, vertical_psd=0.02, sd_position=(4.0, 5.0, 6.0), sd_velocity=(0.4, 0.5, 0.3))
SD_R, SD_V = 2.0, 0.1
N, DT = 121, 0.5


def drawn(seed, model=MODEL, slow=(0.0, 1.0)):
    """A dead-reckoned track whose errors are those of the model, fixes, and the true track in e."""
    rng = np.random.default_rng(seed)
    t = DT * np.arange(N)
    heading = 0.4 + 0.8 * np.sin(0.05 * t)
    velocity = np.column_stack((12.0 * np.cos(heading), 12.0 * np.sin(heading), 0.2 * np.sin(0.1 * t)))
    true = from_velocity(t, velocity, START)
    psd = np.array([model.velocity_psd, model.velocity_psd, model.vertical_psd])
    dv = np.asarray(model.sd_velocity) * rng.standard_normal(3)
    dr = np.asarray(model.sd_position) * rng.standard_normal(3)
    errors = [(dv, dr)]
    for _ in range(N - 1):
        a, b = rng.standard_normal((2, 3))
        w = np.sqrt(psd * DT) * a
        dr = dr + DT * dv + 0.5 * DT * w + np.sqrt(psd * DT**3 / 12.0) * b
        dv = dv + w
        errors.append((dv, dr))
    dv, dr = (np.array(found) for found in zip(*errors, strict=True))
    C = np.array([np.reshape(dcm_en(a, b), (3, 3)) for a, b in zip(true.lat, true.lon, strict=True)])
    true_e = geodetic_to_ecef_batch(true.lat, true.lon, true.height)
    # Errors are constant in e, as the filter in e has them: all are resolved at the first place.
    place = ecef_to_geodetic_batch(true_e - dr @ C[0].T)
    v_dr = np.einsum("kji,kj->ki", C, np.einsum("kij,kj->ki", C, velocity) - dv @ C[0].T)
    track = Trajectory(t, *place, v_dr, source="dr")
    lasting = np.zeros((N, 3))
    keep = np.exp(-DT / slow[1])
    for k in range(N):
        before = lasting[k - 1] * keep if k else 0.0
        lasting[k] = before + slow[0] * np.sqrt(1.0 - keep**2 if k else 1.0) * rng.standard_normal(3)
    seen = true_e + np.einsum("kij,kj->ki", C, SD_R * rng.standard_normal((N, 3)) + lasting)
    fixes = GnssLog(
        t, *ecef_to_geodetic_batch(seen), np.full((N, 3), SD_R),
        velocity + SD_V * rng.standard_normal((N, 3)), np.full((N, 3), SD_V),
    )  # fmt: skip
    every = np.arange(N) % 4 == 0
    return track, fixes.take(every), true


def apart(one, other):
    """Largest distance of two trajectories [m]."""
    a, b = (geodetic_to_ecef_batch(found.lat, found.lon, found.height) for found in (one, other))
    return float(np.linalg.norm(a - b, axis=1).max())


def error_n(track, true):
    """True minus estimate, north, east, down."""
    a, b = (geodetic_to_ecef_batch(found.lat, found.lon, found.height) for found in (true, track))
    C = np.array([np.reshape(dcm_en(lat, lon), (3, 3)) for lat, lon in zip(true.lat, true.lon, strict=True)])
    return np.einsum("kji,kj->ki", C, a - b)


def twin(track, fixes, model):
    """The lecture's filter in e, with its own signs: error = estimate - true, H = -(0 I; I 0)."""
    r = geodetic_to_ecef_batch(track.lat, track.lon, track.height)
    C = [np.reshape(dcm_en(a, b), (3, 3)) for a, b in zip(track.lat, track.lon, strict=True)]
    v = np.array([C[k] @ track.velocity_n[k] for k in range(len(track))])
    g = geodetic_to_ecef_batch(fixes.lat, fixes.lon, fixes.height)
    I, O = np.eye(3), np.zeros((3, 3))
    x = np.zeros(6)
    P = np.zeros((6, 6))
    P[:3, :3] = C[0] @ np.diag(np.square(model.sd_velocity)) @ C[0].T
    P[3:, 3:] = C[0] @ np.diag(np.square(model.sd_position)) @ C[0].T
    H = -np.block([[O, I], [I, O]])
    out = []
    for k in range(len(track)):
        if k:
            tau = track.time[k] - track.time[k - 1]
            S = C[k - 1] @ np.diag([model.velocity_psd, model.velocity_psd, model.vertical_psd]) @ C[k - 1].T
            Phi = np.block([[I, O], [tau * I, I]])
            Q = np.block([[S * tau, S * tau**2 / 2], [S * tau**2 / 2, S * tau**3 / 3]])
            x, P = Phi @ x, Phi @ P @ Phi.T + Q
        j = np.flatnonzero(fixes.time == track.time[k])
        if j.size:
            j = int(j[0])
            G = np.reshape(dcm_en(fixes.lat[j], fixes.lon[j]), (3, 3))
            R = np.block([[G * fixes.sd_position[j] ** 2 @ G.T, O], [O, C[k] * fixes.sd_velocity[j] ** 2 @ C[k].T]])
            z = np.concatenate((g[j] - r[k], C[k] @ fixes.velocity_n[j] - v[k])) - H @ x
            # The velocity of a fix is resolved where the fix is.
            z[3:] += (G - C[k]) @ fixes.velocity_n[j]
            K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
            x, P = x + K @ z, (np.eye(6) - K @ H) @ P
        out.append((r[k] - x[3:], v[k] - x[:3]))
    return (np.array(found) for found in zip(*out, strict=True))


def test_it_is_the_filter_of_the_lecture():
    track, fixes, _ = drawn(1)
    model = replace(MODEL, gate_probability=1.0)
    found = integrate(track, fixes, model, frame="ecef", smooth=False).forward
    place, velocity = twin(track, fixes, model)
    r = geodetic_to_ecef_batch(found.lat, found.lon, found.height)
    assert np.abs(r - place).max() < 1e-7
    C = [np.reshape(dcm_en(a, b), (3, 3)) for a, b in zip(found.lat, found.lon, strict=True)]
    assert np.abs(np.array([c @ v for c, v in zip(C, found.velocity_n, strict=True)]) - velocity).max() < 1e-8


@pytest.mark.parametrize("feedback", ["open", "closed"])
def test_both_frames_agree(feedback):
    track, fixes, _ = drawn(2)
    ned, ecef = (integrate(track, fixes, MODEL, frame=frame, feedback=feedback) for frame in ("ned", "ecef"))
    assert apart(ned.forward, ecef.forward) < 1e-3
    assert apart(ned.smoothed, ecef.smoothed) < 1e-3
    np.testing.assert_allclose(ned.forward.sd_position, ecef.forward.sd_position, rtol=1e-4)
    np.testing.assert_allclose(ned.innovations.z, ecef.innovations.z, atol=2e-3)
    np.testing.assert_allclose(ned.innovations.sd, ecef.innovations.sd, rtol=1e-4)
    np.testing.assert_array_equal(ned.innovations.status, ecef.innovations.status)


def test_open_and_closed_loop_are_the_same_in_e_and_part_in_n_where_the_track_has_drifted_away():
    track, fixes, _ = drawn(3)
    loops = [integrate(track, fixes, MODEL, frame="ecef", feedback=loop) for loop in ("open", "closed")]
    assert apart(loops[0].smoothed, loops[1].smoothed) < 1e-3
    # 100 km off, latitude and longitude per metre are others: the closed loop is right, the open one is not.
    far = replace(track, lat=track.lat + 100e3 / 6.4e6)
    model = replace(MODEL, sd_position=200e3, gate_probability=1.0)
    reference = integrate(track, fixes, model, frame="ecef").forward
    opened, closed = (integrate(far, fixes, model, frame="ned", feedback=loop).forward for loop in ("open", "closed"))
    settled = slice(40, None)
    assert apart(closed.take(settled), reference.take(settled)) < 0.5
    assert apart(opened.take(settled), reference.take(settled)) > 2.0 * apart(
        closed.take(settled), reference.take(settled)
    )


def test_smoothing_is_least_squares_over_everything():
    """All states of a short log at once, from the normal equations of start, steps and fixes."""
    track, fixes, _ = drawn(4)
    track, fixes = track.take(slice(0, 21)), fixes.take(slice(0, 6))
    model = replace(MODEL, gate_probability=1.0)
    found = integrate(track, fixes, model, frame="ecef").smoothed
    n = len(track)
    r = geodetic_to_ecef_batch(track.lat, track.lon, track.height)
    g = geodetic_to_ecef_batch(fixes.lat, fixes.lon, fixes.height)
    C = [np.reshape(dcm_en(a, b), (3, 3)) for a, b in zip(track.lat, track.lon, strict=True)]
    N, b = np.zeros((6 * n, 6 * n)), np.zeros(6 * n)

    def add(J, residual, covariance):
        W = np.linalg.inv(covariance)
        N[:] += J.T @ W @ J
        b[:] += J.T @ W @ residual

    J0 = np.zeros((6, 6 * n))
    J0[:, :6] = np.eye(6)
    P0 = np.zeros((6, 6))
    P0[:3, :3] = C[0] * np.square(model.sd_velocity) @ C[0].T
    P0[3:, 3:] = C[0] * np.square(model.sd_position) @ C[0].T
    add(J0, np.zeros(6), P0)
    for k in range(1, n):
        S = C[k - 1] * np.array([model.velocity_psd, model.velocity_psd, model.vertical_psd]) @ C[k - 1].T
        Phi = np.eye(6)
        Phi[3:, :3] = DT * np.eye(3)
        J = np.zeros((6, 6 * n))
        J[:, 6 * k : 6 * k + 6], J[:, 6 * k - 6 : 6 * k] = np.eye(6), -Phi
        add(J, np.zeros(6), np.block([[S * DT, S * DT**2 / 2], [S * DT**2 / 2, S * DT**3 / 3]]))
    for j, t in enumerate(fixes.time):
        k = round(t / DT)
        G = np.reshape(dcm_en(fixes.lat[j], fixes.lon[j]), (3, 3))
        J = np.zeros((6, 6 * n))
        J[:3, 6 * k + 3 : 6 * k + 6], J[3:, 6 * k : 6 * k + 3] = np.eye(3), np.eye(3)
        z = np.concatenate((g[j] - r[k], G @ fixes.velocity_n[j] - C[k] @ track.velocity_n[k]))
        R = np.zeros((6, 6))
        R[:3, :3], R[3:, 3:] = G * fixes.sd_position[j] ** 2 @ G.T, C[k] * fixes.sd_velocity[j] ** 2 @ C[k].T
        add(J, z, R)
    x = np.linalg.solve(N, b).reshape(n, 6)
    assert np.abs(geodetic_to_ecef_batch(found.lat, found.lon, found.height) - r - x[:, 3:]).max() < 1e-6
    cov = np.linalg.inv(N)
    sd = np.array(
        [np.sqrt(np.diag(C[k].T @ cov[6 * k + 3 : 6 * k + 6, 6 * k + 3 : 6 * k + 6] @ C[k])) for k in range(n)]
    )
    np.testing.assert_allclose(found.sd_position, sd, rtol=1e-5)


@pytest.mark.parametrize("frame", ["ned", "ecef"])
@pytest.mark.parametrize("slow", [(0.0, 1.0), (3.0, 8.0)])
def test_errors_and_innovations_are_as_large_as_it_says(frame, slow):
    runs = 60
    model = replace(MODEL, gate_probability=1.0, fix_error_sd=slow[0], fix_error_tau=slow[1])
    ratios, nis, dof = {"forward": [], "smoothed": []}, 0.0, 0
    for seed in range(runs):
        track, fixes, true = drawn(1000 + seed, slow=slow)
        found = integrate(track, fixes, model, frame=frame)
        for role in ratios:
            best = getattr(found, role)
            ratios[role].append((error_n(best, true)[60] / best.sd_position[60]) ** 2)
        nis, dof = nis + found.innovations.nis.sum(), dof + found.innovations.dof.sum()
    low, high = chi2.ppf((0.0005, 0.9995), runs)
    for role, squares in ratios.items():
        total = np.sum(squares, axis=0)
        assert ((total > low) & (total < high)).all(), role
    # position and velocity of one epoch are used one after the other, each innovation new
    low, high = chi2.ppf((0.0005, 0.9995), dof)
    assert low < nis < high


def test_a_filter_that_is_told_too_small_sigmas_shows():
    nis = dof = 0.0
    for seed in range(20):
        track, fixes, _ = drawn(seed)
        fixes = replace(fixes, sd_position=0.5 * fixes.sd_position, sd_velocity=0.5 * fixes.sd_velocity)
        found = integrate(track, fixes, replace(MODEL, gate_probability=1.0)).innovations
        nis, dof = nis + found.nis.sum(), dof + found.dof.sum()
    assert nis > chi2.ppf(0.9995, dof)


def test_outliers_outages_and_a_jump():
    track, fixes, true = drawn(6)
    metre = 1.0 / 6.4e6
    lat = fixes.lat.copy()
    lat[10] += 200.0 * metre
    one = integrate(track, replace(fixes, lat=lat), MODEL, outages=[(30.0, 36.0)]).innovations
    bad = one.select(one.status == "rejected")
    assert bad.source.tolist() == ["gnss_position"]
    assert bad.row.tolist() == [10]
    assert set(one.select((one.time >= 30.0) & (one.time < 36.0)).status) == {"withheld"}
    assert one.z[(one.row == 10) & (one.source == "gnss_position"), 0] == pytest.approx(200.0, abs=12.0)
    # A jump that stays is believed after the patience.
    jumped = replace(fixes, lat=fixes.lat + 500.0 * metre * (fixes.time > 20.0))
    for frame in ("ned", "ecef"):
        found = integrate(track, jumped, replace(MODEL, patience=8.0), frame=frame)
        assert found.innovations.count("gnss_position", "reset") == 1
        error = error_n(found.forward, true)[:, 0]
        assert abs(error[-1] + 500.0) < 12.0
        assert np.abs(error[:41]).max() < 15.0


@pytest.mark.parametrize("frame", ["ned", "ecef"])
def test_a_jump_of_position_and_velocity_at_once(frame):
    """Both are believed in the same row; what the smoother says of the time before stays what it was."""
    track, fixes, true = drawn(6)
    late = fixes.time > 40.0
    velocity = fixes.velocity_n + np.where(late, 60.0, 0.0)[:, None] * np.array([1.0, 0.0, 0.0])
    jumped = replace(
        fixes, lat=fixes.lat + np.where(late, 500.0 + 60.0 * (fixes.time - 40.0), 0.0) / 6.4e6, velocity_n=velocity
    )
    found = integrate(track, jumped, replace(MODEL, patience=8.0), frame=frame)
    reset = found.innovations.select(found.innovations.status == "reset")
    assert sorted(reset.source) == ["gnss_position", "gnss_velocity"]
    assert np.ptp(reset.time) == 0.0
    for values in (found.smoothed.sd_position, found.smoothed.sd_velocity):
        assert np.isfinite(values).all()
        assert (values > 0.0).all()
    before = track.time <= 38.0
    assert (found.smoothed.sd_position[before] <= found.forward.sd_position[before] * (1.0 + 1e-9)).all()
    ratio = error_n(found.smoothed, true)[before] / found.smoothed.sd_position[before]
    assert np.abs(ratio).max() < 4.5


def test_fixes_between_the_epochs_of_the_track():
    """A coarse track with fixes of its own times is the fine one, up to the curvature of the way."""
    track, fixes, _ = drawn(7)
    coarse = track.take(slice(0, None, 3))
    found = integrate(coarse, fixes, MODEL, frame="ecef")
    assert set(fixes.time) <= set(found.forward.time)
    fine = at_epochs(coarse, track.time)
    np.testing.assert_allclose(fine.lat[::3], coarse.lat, atol=1e-14)
    # errors of the track are random walks, which no interpolation knows of
    assert apart(fine, track) < 1.0
    assert np.isin(fixes.time, found.innovations.time).all()


def test_a_track_across_the_date_line():
    track, fixes, _ = drawn(8)
    shift = np.pi - track.lon[40]

    def moved(log):
        return replace(log, lon=(log.lon + shift + np.pi) % (2 * np.pi) - np.pi)

    plain, across = integrate(track, fixes, MODEL), integrate(moved(track), moved(fixes), MODEL)
    assert apart(moved(plain.smoothed), across.smoothed) < 1e-6
    assert np.ptp(across.smoothed.lon) > 6.0
    np.testing.assert_allclose(plain.innovations.z, across.innovations.z, atol=1e-6)


def test_a_single_fix_is_enough():
    track, fixes, _ = drawn(10)
    found = integrate(track, fixes.take(slice(3, 4)), MODEL)
    assert len(found.innovations) == 2
    assert found.smoothed.sd_position[6, 0] < 2.0 < found.forward.sd_position[0, 0]


def test_what_it_refuses():
    track, fixes, _ = drawn(9)
    with pytest.raises(ConfigError, match='frame = "enu" must be "ned" or "ecef"'):
        integrate(track, fixes, frame="enu")
    with pytest.raises(ConfigError, match='feedback = "half" must be'):
        integrate(track, fixes, feedback="half")
    with pytest.raises(ConfigError, match="must hold"):
        integrate(track, fixes, use=("range",))
    with pytest.raises(InputError, match="needs a velocity in every row"):
        integrate(replace(track, velocity_n=None), fixes)
    with pytest.raises(InputError, match="has no velocity to interpolate"):
        at_epochs(replace(track, velocity_n=None), track.time[:3])
    with pytest.raises(InputError, match="no fix lies inside; are both on one time scale"):
        integrate(track, replace(fixes, time=fixes.time + 1e5))
    stuck = track.time.copy()
    stuck[4] = stuck[3]
    with pytest.raises(InputError, match=r"dr: row 4 at 1\.500 s is not later than the one before"):
        integrate(replace(track, time=stuck), fixes)
    with pytest.raises(InputError, match="gnss: row 1 at"):
        integrate(track, replace(fixes, time=fixes.time[::-1].copy()))
    with pytest.raises(InputError, match="nothing in it can be used: velocity"):
        integrate(track, replace(fixes, velocity_n=None, sd_velocity=None), use=("velocity",))
    with pytest.raises(InputError, match="nothing in it can be used"):
        integrate(track, fixes, outages=[(-1.0, 1e9)])
    with pytest.raises(FilterError, match="the DR/GNSS filter failed at"):
        integrate(track, replace(fixes, sd_position=np.full_like(fixes.sd_position, np.nan)), MODEL)
    for values, message in (
        ({"velocity_psd": -1.0}, "velocity_psd = -1.0 must be finite and not negative"),
        ({"sd_position": (1.0, 2.0)}, "sd_position = .* must be one positive number, or three"),
        ({"fix_error_sd": (1.0, 0.0, 1.0)}, "fix_error_sd = .* positive or all zero"),
        ({"fix_error_tau": 0.0}, "fix_error_tau = 0.0 must be positive"),
        ({"gate_probability": 0.0}, "gate_probability = 0.0"),
    ):
        with pytest.raises(ConfigError, match=message):
            DrModel(**values)


def test_a_smoother_that_fails_says_where(monkeypatch):
    from navfuse.dead_reckoning import kernels

    track, fixes, _ = drawn(11)
    monkeypatch.setattr(kernels, "run_backward", lambda *arrays: 8)
    with pytest.raises(FilterError, match=r"the DR/GNSS smoother failed at 4\.000 s"):
        integrate(track, fixes, MODEL)
