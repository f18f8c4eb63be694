"""What leaves navfuse: the right point at the right times with honest standard deviations, nothing made up."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from navfuse.analysis.export_track import export_track, lever_arm_of
from navfuse.analysis.interpolation import earth_states
from navfuse.core.rotation import dcm_from_euler
from navfuse.data.gps_epoch import GpsEpoch
from navfuse.data.logs import GnssLog
from navfuse.data.result import Innovations, Result
from navfuse.data.trajectory import Trajectory
from navfuse.errors import ConfigError, InputError, NavfuseWarning
from navfuse.gnss.geoid import undulation
from navfuse.simulation.vehicles import car_drive

ARM = np.array([0.4, -0.3, -1.6])


@pytest.fixture(scope="module", name="motion")
def _motion():
    return car_drive(60.0)


@pytest.fixture(name="trajectory")
def _trajectory(motion):
    time = np.arange(0.0, 60.0, 0.1)
    sd = np.tile([0.02, 0.03, 0.05], (time.size, 1))
    return replace(motion.trajectory(time), sd_position=sd, sd_velocity=0.1 * sd, sd_attitude=np.radians(sd))


def level(n=5, **more):
    """Northward at 1 m/s, level, on the equator."""
    time = np.arange(float(n))
    zeros, triad = np.zeros(n), np.zeros((n, 3))
    values = {"velocity_n": np.tile([1.0, 0.0, 0.0], (n, 1)), "attitude": triad.copy()} | more
    return Trajectory(time, time / 6335439.0, zeros, zeros + 50.0, **values)


def test_the_imu_at_its_own_epochs_is_the_trajectory_itself(trajectory):
    track = export_track(trajectory)
    assert track.trajectory is trajectory
    assert (track.point, track.labels, track.fix, track.epoch) == ("IMU", None, None, None)
    np.testing.assert_array_equal(track.undulation, undulation(trajectory.lat, trajectory.lon))
    np.testing.assert_array_equal(track.heights(), trajectory.height)
    above = export_track(trajectory, height="geoid")
    np.testing.assert_array_equal(above.heights(), trajectory.height - above.undulation)


def test_antenna_by_hand():
    """Heading east: forward is east, right is south."""
    n = 4
    time, zeros = np.arange(n) * 0.1, np.zeros(n)
    attitude = np.tile([0.0, 0.0, np.pi / 2], (n, 1))
    trajectory = Trajectory(time, zeros, zeros, zeros, np.zeros((n, 3)), attitude)
    moved = export_track(trajectory, point=(2.0, 1.0, -3.0)).trajectory
    np.testing.assert_allclose(moved.lat * 6335439.327, -1.0, atol=1e-5)
    np.testing.assert_allclose(moved.lon * 6378137.0, 2.0, atol=1e-5)
    np.testing.assert_allclose(moved.height, 3.0, atol=1e-5)


def test_there_and_back(trajectory):
    there = export_track(trajectory, point=ARM).trajectory
    back = export_track(there, point=-ARM).trajectory
    np.testing.assert_allclose(earth_states(back).r_e, earth_states(trajectory).r_e, atol=1e-8)
    np.testing.assert_allclose(back.velocity_n, trajectory.velocity_n, atol=1e-8)
    np.testing.assert_allclose(back.attitude, trajectory.attitude, atol=1e-6)


def test_events_of_a_moved_point_against_the_exact_motion(motion, trajectory):
    at = np.random.default_rng(3).uniform(0.0, 59.9, 300)
    track = export_track(trajectory, point=ARM, at=at, labels=[f"picture {k}" for k in range(300)])
    order = np.argsort(at)
    assert track.labels.tolist() == [f"picture {k}" for k in order]
    exact, states = motion.at(at[order]), earth_states(track.trajectory)
    C_eb = motion.C_eb(at[order])
    np.testing.assert_allclose(states.r_e, exact.r_e + C_eb @ ARM, atol=1e-5)
    swept = np.einsum("nij,nj->ni", C_eb, np.cross(exact.w_eb_b, ARM))
    np.testing.assert_allclose(states.v_e, exact.v_e + swept, atol=1e-4)
    truth = motion.trajectory(at[order])
    turned = np.angle(np.exp(1j * (track.trajectory.attitude - truth.attitude)))
    assert np.abs(turned).max() < np.radians(0.001)
    dt = 1e-3
    inner = (at[order] > dt) & (at[order] < 59.9 - dt)
    C_nb = [motion.C_nb(at[order][inner] + sign * dt) for sign in (-1.0, 1.0)]
    W = np.einsum("nji,njk->nik", motion.C_nb(at[order][inner]), (C_nb[1] - C_nb[0]) / (2.0 * dt))
    w_nb_b = np.column_stack((W[:, 2, 1], W[:, 0, 2], W[:, 1, 0]))
    np.testing.assert_allclose(track.w_nb_b[inner], w_nb_b, atol=2e-4)


def test_standard_deviations_are_an_upper_bound_whatever_the_correlations():
    """The exact sd, with position and attitude errors correlated in any way, is never above the exported one."""
    rng = np.random.default_rng(7)
    attitude = np.array([0.2, -0.3, 1.1])
    sd_r, sd_a = np.array([0.02, 0.03, 0.05]), np.radians([0.2, 0.3, 0.9])
    n = 3
    trajectory = Trajectory(
        np.arange(n) * 0.1, np.full(n, 0.5), np.zeros(n), np.zeros(n), np.zeros((n, 3)), np.tile(attitude, (n, 1)),
        np.tile(sd_r, (n, 1)), None, np.tile(sd_a, (n, 1)),
    )  # fmt: skip
    found = export_track(trajectory, point=ARM).trajectory.sd_position[1]
    h = 1e-6
    steps = [
        np.array(dcm_from_euler(*(attitude + h * row))).reshape(3, 3) @ ARM
        for row in np.vstack((np.eye(3), -np.eye(3)))
    ]
    J = np.column_stack([(steps[k] - steps[k + 3]) / (2.0 * h) for k in range(3)])
    np.testing.assert_allclose(found, sd_r + np.abs(J) @ sd_a, rtol=1e-6)
    D, H = np.diag(np.concatenate((sd_r, sd_a))), np.hstack((np.eye(3), J))
    for _ in range(200):
        A = rng.standard_normal((6, rng.integers(1, 7)))
        A /= np.linalg.norm(A, axis=1, keepdims=True)
        exact = np.sqrt(np.diagonal(H @ D @ A @ A.T @ D @ H.T))
        assert np.all(exact <= found * (1.0 + 1e-6))


def test_velocity_sd_grows_where_the_vehicle_turns(trajectory):
    moved = export_track(trajectory, point=ARM).trajectory
    grown = moved.sd_velocity - trajectory.sd_velocity
    turning = np.abs(trajectory.attitude[:, 2] - np.roll(trajectory.attitude[:, 2], 1)) > 0.01
    assert grown.min() >= 0.0
    assert grown[turning].max() > 100.0 * grown[:100].max()
    np.testing.assert_array_equal(moved.sd_attitude, trajectory.sd_attitude)


def test_rate(motion, trajectory):
    shifted = replace(trajectory, time=trajectory.time + 0.03)
    track = export_track(shifted, rate_hz=4.0)
    np.testing.assert_allclose(track.trajectory.time, np.arange(1, 240) / 4.0)
    exact = motion.trajectory(track.trajectory.time - 0.03)
    np.testing.assert_allclose(earth_states(track.trajectory).r_e, earth_states(exact).r_e, atol=1e-5)
    np.testing.assert_allclose(track.trajectory.sd_position[5], trajectory.sd_position[5])
    assert len(export_track(trajectory, rate_hz=200.0).trajectory) == 59.9 * 200 + 1


def test_no_epochs_in_gaps(trajectory):
    holed = trajectory.take((trajectory.time < 20.0) | (trajectory.time > 30.0))
    time = export_track(holed, rate_hz=1.0).trajectory.time
    np.testing.assert_array_equal(time, [*np.arange(20.0), *np.arange(31.0, 60.0)])


def test_events_outside_are_named_and_left_out(trajectory):
    holed = trajectory.take((trajectory.time < 20.0) | (trajectory.time > 30.0))
    with pytest.warns(
        NavfuseWarning, match=r"3 of 5 events .*'b' at -0.001 s, 'd' at 25.000 s, 'e' at 60.000 s;.*left out"
    ):
        track = export_track(holed, at=[5.0, -0.001, 40.0, 25.0, 60.0], labels=list("abcde"))
    assert track.labels.tolist() == ["a", "c"]
    with pytest.raises(
        InputError, match=r"7 of 7 events.*'1' at 100.000 s.*'5' at 104.000 s, \.\.\.; .*time of the log"
    ):
        export_track(trajectory, at=100.0 + np.arange(7))


def test_coinciding_events_stand_beside_each_other(trajectory):
    track = export_track(trajectory, at=[7.03, 3.0, 7.03], labels=["left", "first", "right"])
    assert track.labels.tolist() == ["first", "left", "right"]
    assert export_track(trajectory, at=[1.0], labels=["half \ud83d"]).labels.tolist() == ["half ?"]
    np.testing.assert_array_equal(track.trajectory.lat[1], track.trajectory.lat[2])


def test_an_event_at_the_very_end_is_inside(trajectory):
    end = trajectory.time[-1]
    track = export_track(trajectory, at=[0.0, end, end + 5e-7])
    np.testing.assert_array_equal(track.trajectory.time, [0.0, end, end])
    np.testing.assert_allclose(track.trajectory.lat[1], trajectory.lat[-1], atol=1e-15)


def test_without_attitude_or_velocity(trajectory):
    bare = replace(trajectory, attitude=None, velocity_n=None, sd_attitude=None, sd_velocity=None)
    track = export_track(bare, rate_hz=1.0)
    assert track.trajectory.velocity_n is None
    assert track.trajectory.attitude is None
    assert track.a_eb_b is None
    assert track.w_nb_b is None
    with pytest.raises(InputError, match="another point than the IMU needs the attitude"):
        export_track(bare, point=ARM)
    turning = export_track(replace(bare, attitude=trajectory.attitude), point=ARM)
    assert turning.trajectory.velocity_n is None
    assert turning.w_nb_b.shape == (len(bare), 3)
    unsure = export_track(replace(trajectory, sd_attitude=None), point=ARM).trajectory
    np.testing.assert_array_equal(unsure.sd_position, trajectory.sd_position)


def test_one_epoch():
    one = level(1)
    with pytest.warns(NavfuseWarning, match="1 epochs have no neighbour"):
        moved = export_track(one, point=(1.0, 0.0, 0.0), at=[0.0]).trajectory
    np.testing.assert_allclose(moved.lat, 1.0 / 6335439.3, rtol=1e-4)
    np.testing.assert_allclose(moved.velocity_n, one.velocity_n, atol=1e-6)
    with pytest.raises(InputError, match="outside"):
        export_track(one, at=[0.5])


@pytest.mark.parametrize("lat_deg", [-90.0, 90.0, 89.99999])
def test_poles(lat_deg):
    time, n = np.arange(4) * 0.1, 4
    trajectory = Trajectory(
        time, np.full(n, np.radians(lat_deg)), np.full(n, 0.7), np.zeros(n), np.zeros((n, 3)), np.zeros((n, 3)) + 0.1
    )
    track = export_track(trajectory, point=ARM, at=[0.05, 0.3])
    C_eb_arm = np.linalg.norm(earth_states(track.trajectory).r_e - earth_states(trajectory).r_e[:2], axis=1)
    np.testing.assert_allclose(C_eb_arm, np.linalg.norm(ARM), atol=1e-7)
    assert np.isfinite(track.w_nb_b).all()
    assert np.isfinite(track.undulation).all()


def test_across_the_date_line():
    time = np.arange(20) * 0.1
    lon = np.pi - 1e-6 + time * 1e-6
    lon = np.where(lon > np.pi, lon - 2.0 * np.pi, lon)
    speed = np.tile([0.0, 6378137.0 * 1e-6, 0.0], (20, 1))
    trajectory = Trajectory(time, np.zeros(20), lon, np.zeros(20), speed, np.zeros((20, 3)))
    moved = export_track(trajectory, at=[0.95, 1.05], point=(0.0, 1.0, 0.0)).trajectory
    expected = np.pi - 1e-6 + np.array([0.95, 1.05]) * 1e-6 + 1.0 / 6378137.0
    np.testing.assert_allclose(np.mod(moved.lon, 2.0 * np.pi), expected, atol=1e-12)


def fixes(**more):
    time = np.array([0.0, 1.0, 2.0, 9.0])
    zeros = np.zeros(4)
    return GnssLog(time, zeros, zeros, zeros, np.ones((4, 3)), **more)


def result(used=(0, 1, 2, 3), **more):
    n = len(used)
    block, status = np.full((n, 3), np.nan), np.full(n, "used")
    innovations = Innovations(
        fixes().time[list(used)], np.full(n, "gnss_position"), status, np.ones(n), np.full(n, 3), block, block,
        np.array(used, dtype=int),
    )  # fmt: skip
    return Result(forward=level(13), innovations=innovations, **more)


def test_fix_types_and_satellites():
    kinds = {"fix": np.array(["single", "rtk-float", "rtk-fixed", "dgnss"]), "n_satellites": np.array([5, 6, 7, 8])}
    track = export_track(result(fixes=fixes(**kinds)))
    assert track.fix.tolist() == ["single", "rtk-float", *["rtk-fixed"] * 3, *["none"] * 4, *["dgnss"] * 3, "none"]
    assert track.n_satellites.tolist() == [5, 6, 7, 7, 7, 0, 0, 0, 0, 8, 8, 8, 0]
    rejected = export_track(result(used=(0, 1, 3), fixes=fixes(**kinds)))
    assert rejected.fix.tolist()[:5] == ["single", *["rtk-float"] * 3, "none"]
    untyped = export_track(result(fixes=fixes())).fix
    assert untyped.tolist() == ["none" if kind == "none" else "" for kind in track.fix.tolist()]
    offered = result(fixes=fixes(**kinds))
    refused = replace(offered.innovations, status=np.array(["rejected", "withheld", "rejected", "late"]))
    nothing = export_track(replace(offered, innovations=refused))
    assert set(nothing.fix.tolist()) == {"none"}
    assert not nothing.n_satellites.any()


@pytest.mark.parametrize("arm", ["abc", None, [1.0, 2.0], [1.0, 2.0, float("nan")], ["a", 1, 2], {}, 1e9])
def test_a_damaged_lever_arm_of_a_run(arm):
    damaged = replace(result(), summary={"settings": {"gnss": {"lever_arm_m": arm}}})
    with pytest.raises(InputError, match=r"settings\.gnss\.lever_arm_m = "):
        lever_arm_of("antenna", damaged)
    assert export_track(result()).n_satellites is None


def test_a_result_knows_its_antenna_epoch_and_solutions():
    epoch = GpsEpoch(2374, 100.0)
    run = result(summary={"settings": {"gnss": {"lever_arm_m": [1.0, 2.0, 3.0]}}}, epoch=epoch)
    with pytest.warns(NavfuseWarning, match="epochs are 1 s apart; the velocity of the point is interpolated"):
        track = export_track(run, point="antenna")
    assert (track.point, track.epoch) == ("antenna", epoch)
    with pytest.warns(NavfuseWarning, match="run with output.rate_hz = 10 or more"):
        expected = export_track(run.forward, point=[1.0, 2.0, 3.0])
    assert expected.point == "1 m forward, 2 m right, 3 m down of the IMU"
    np.testing.assert_array_equal(track.trajectory.lat, expected.trajectory.lat)
    assert export_track(run, epoch=GpsEpoch(1, 2.0)).epoch == GpsEpoch(1, 2.0)
    smoothed = replace(run, smoothed=level(4))
    assert [len(export_track(smoothed, solution=s).trajectory) for s in ("best", "smoothed", "forward")] == [4, 4, 13]


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"point": "camera"}, 'point = "camera"'),
        ({"point": "antenna"}, "summary.json of a run"),
        ({"point": (1.0, 2.0)}, "three numbers"),
        ({"point": (1.0, np.nan, 2.0)}, "three numbers"),
        ({"point": (1.0, 2e3, 2.0)}, "within 1000 m"),
        ({"solution": "backward"}, 'solution = "backward"'),
        ({"height": "msl"}, 'height = "msl"'),
        ({"geoid": "egm84"}, "no geoid"),
        ({"rate_hz": 0.0}, "above 0"),
        ({"rate_hz": np.nan}, "above 0"),
        ({"rate_hz": 1e6}, "at most 1000"),
        ({"rate_hz": 1.0, "at": [1.0]}, "either regular epochs or"),
        ({"labels": ["a"]}, "`at` has to be given"),
    ],
)
def test_settings_that_make_no_sense(settings, message):
    with pytest.raises(ConfigError, match=message):
        export_track(level(), **settings)


def test_a_rate_too_low_to_give_an_epoch():
    late = replace(level(), time=np.arange(5.0) + 0.5)
    with pytest.raises(ConfigError, match="gives no epoch"):
        export_track(late, rate_hz=0.01)


def test_no_smoothed_solution():
    with pytest.raises(ConfigError, match='"forward" is there'):
        export_track(result(), solution="smoothed")


@pytest.mark.parametrize(
    ("at", "labels", "message"),
    [
        ([], None, "at least one"),
        ([[1.0]], None, "a list"),
        ([np.inf], None, "finite"),
        ([1.0, 2.0], ["a"], "2 times but 1 labels"),
    ],
)
def test_event_lists_that_do_not_fit(at, labels, message):
    with pytest.raises(InputError, match=message):
        export_track(level(), at=at, labels=labels)


def test_trajectories_that_cannot_be_exported():
    with pytest.raises(InputError, match="no epochs"):
        export_track(level().take(slice(0, 0)))
    with pytest.raises(InputError, match="time does not increase"):
        export_track(level().take([0, 2, 1]))


def test_coarse_epochs_are_not_interpolated_without_a_word():
    with pytest.warns(NavfuseWarning, match="epochs are 1 s apart; the motion between epochs is interpolated"):
        export_track(level(), at=[0.5, 1.0])
    assert len(export_track(level(), at=[1.0, 2.0]).trajectory) == 2
