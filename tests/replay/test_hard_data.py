"""Readable but hard data: gaps, wrong settings, outliers, odd starts. The run is right, or it says that it is not."""

from __future__ import annotations

import numpy as np
import pytest

from navfuse.demo import write_logs
from navfuse.imu.grades import grade
from navfuse.simulation import simulate, static

GYRO = ["gyro_x_radps", "gyro_y_radps", "gyro_z_radps"]
ACCEL = ["accel_x_mps2", "accel_y_mps2", "accel_z_mps2"]
VELOCITY = ["vn_mps", "ve_mps", "vd_mps", "sd_vn_mps", "sd_ve_mps", "sd_vd_mps"]
SD = ["sd_north_m", "sd_east_m", "sd_down_m", "sd_vn_mps", "sd_ve_mps", "sd_vd_mps"]
METRE_DEG = np.degrees(1.0 / 6.37e6)
KINDS = ("rates", "increments")


def without(job, begin, end, table="imu"):
    rows = getattr(job, table)
    setattr(job, table, rows[(rows["time_s"] < begin) | (rows["time_s"] >= end)])
    return job


def inside_sigmas(done, times, sigmas=4.0, name="forward"):
    """Whether position, velocity and roll, pitch, heading are all within some sigmas of the truth at some times."""
    solution, truth = done.trajectory(name), done.job.truth
    for time in times:
        k, j = (int(np.argmin(np.abs(t.time - time))) for t in (solution, truth))
        assert abs(solution.time[k] - truth.time[j]) < 1e-6
        radius = np.array([6.37e6, 6.37e6 * np.cos(truth.lat[j]), -1.0])
        position = radius * [
            solution.lat[k] - truth.lat[j],
            solution.lon[k] - truth.lon[j],
            solution.height[k] - truth.height[j],
        ]
        velocity = solution.velocity_n[k] - truth.velocity_n[j]
        attitude = (solution.attitude[k] - truth.attitude[j] + np.pi) % (2.0 * np.pi) - np.pi
        for error, sd in (
            (position, solution.sd_position[k]),
            (velocity, solution.sd_velocity[k]),
            (attitude, solution.sd_attitude[k]),
        ):
            assert np.all(np.abs(error) < sigmas * sd), (time, error, sd)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("begin", [60.0, 41.0], ids=["between fixes", "in a turn"])
def test_a_gap_of_half_a_second_is_bridged(make_job, kind, begin):
    whole = make_job(kind)
    sd_without = whole.done().trajectory()
    done = without(make_job(kind), begin, begin + 0.5).done("inertial samples are missing in 1 place, 0.510 s in all")
    solution = done.trajectory()
    assert not np.any((solution.time > begin) & (solution.time < begin + 0.49))
    k, j = (int(np.argmin(np.abs(t.time - begin - 0.5))) for t in (solution, sd_without))
    assert np.all(solution.sd_attitude[k] > 1.5 * sd_without.sd_attitude[j])
    assert np.all(solution.sd_velocity[k] > 1.01 * sd_without.sd_velocity[j])
    inside_sigmas(done, begin + np.arange(0.5, 10.0, 0.5))
    inside_sigmas(done, begin + np.concatenate([[-2.0, -1.0, -0.5], np.arange(0.5, 10.0, 0.5)]), name="smoothed")


@pytest.mark.parametrize("kind", KINDS)
def test_single_lost_rows_do_no_harm(make_job, kind):
    job = make_job(kind)
    sound = job.done().errors(skip_s=5.0)
    lost = np.random.default_rng(3).choice(np.arange(1000, 11000), 20, replace=False)
    job.imu = job.imu.drop(index=lost)
    found = job.done("inertial samples are missing in 20 places").errors(skip_s=5.0)
    for name in ("position_horizontal", "velocity_3d", "heading"):
        assert found.statistics[name].rms < 1.2 * sound.statistics[name].rms


@pytest.mark.parametrize("kind", KINDS)
def test_after_a_gap_of_half_a_minute_navigation_starts_anew(make_job, kind):
    done = without(make_job(kind), 60.0, 90.0).done("no inertial data for 30.010 s after 59.990 s", "starts anew")
    solution = done.trajectory()
    assert not np.any((solution.time > 60.0) & (solution.time < 89.9))
    assert len(done.summary["start"]) == 2
    assert done.errors("smoothed").statistics["position_horizontal"].max < 1.0
    inside_sigmas(done, [90.5, 91.0, 95.0, 100.0, 110.0, 120.0])


@pytest.mark.parametrize("kind", KINDS)
def test_a_gap_can_be_told_to_stop_the_run(make_job, kind):
    job = without(make_job(kind), 60.0, 90.0).set("imu", on_gap="stop")
    job.refused("30.010 s after 59.990 s", "on_gap")
    assert without(make_job(kind), 60.0, 60.5).set("imu", on_gap="stop").done().outcome.code == 0
    without(make_job(kind), 60.0, 60.5).set("imu", on_gap="stop", max_gap_s=0.2).refused("0.510 s after 59.990 s")


def test_a_stretch_without_fixes_is_left_out(job):
    done = without(without(job, 40.0, 80.0), 79.0, 121.0, "gnss").done(
        "the stretch from 80.000 s to 120.000 s is left out"
    )
    assert done.trajectory().time[-1] < 40.0


def test_a_hole_of_a_minute_in_gnss(job):
    done = without(job, 40.0, 100.0, "gnss").done("no fix was used from 39.5 s to 100.0 s: inertial navigation alone")
    assert done.errors("smoothed").statistics["position_horizontal"].max < 2.0
    assert done.errors("forward").statistics["position_horizontal"].max < 60.0
    inside_sigmas(done, [70.0, 99.0])


def turned(job, matrix):
    for names in (GYRO, ACCEL):
        job.imu[names] = job.imu[names].to_numpy() @ np.transpose(matrix)
    return job


@pytest.mark.parametrize(
    ("matrix", "upward"),
    [
        (np.diag([1.0, -1.0, -1.0]), "+z"),
        ([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]], "+x"),
        ([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]], "-y"),
    ],
)
def test_gravity_shows_wrong_axes(job, matrix, upward):
    message = turned(job, matrix).refused("gravity points the wrong way", "[imu] axes")
    assert f"The upward axis is {upward} " in message


@pytest.mark.parametrize(("axes", "matrix"), [("FLU", np.diag([1.0, -1.0, -1.0])), ("BLD", np.diag([-1.0, -1.0, 1.0]))])
def test_right_axes_make_it_good(job, axes, matrix):
    sound = job.done().trajectory()
    done = turned(job, matrix).set("imu", axes=axes).done()
    assert done.outcome.err == ""
    np.testing.assert_allclose(done.trajectory().attitude, sound.attitude, atol=1e-9)


@pytest.mark.parametrize(
    ("matrix", "off"), [([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]], 90), (np.diag([-1.0, -1.0, 1.0]), 180)]
)
def test_axes_turned_about_the_vertical_are_absorbed_and_told(job, matrix, off):
    """The heading found is that of the turned axes, which may be meant so; a car does not move sideways, though."""
    job.set("gnss", lever_arm_m=None)
    done = turned(job, matrix).done(f"moves {off} deg off its forward axis")
    assert done.errors("smoothed").statistics["position_horizontal"].rms < 2.0


@pytest.mark.parametrize("matrix", [np.diag([1.0, -1.0, 1.0]), [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]])
def test_a_mirrored_sensor_is_told(job, matrix):
    """No rotation can mend it, and gravity does not show it."""
    warns_or_refuses(turned(job, matrix), "imu.axes")


def test_a_gyro_of_the_wrong_sign_is_refused(job):
    job.imu["gyro_z_radps"] *= -1.0
    job.refused("the gyroscopes turn left where the course over ground turns right")


def test_degrees_that_the_imu_alone_does_not_betray(job):
    """Driving slowly about the vertical; it is GNSS that tells."""
    job.imu[GYRO] *= 8.0 / np.abs(job.imu[GYRO]).max().max()
    job.refused("times as much as the course over ground")


def test_velocities_that_are_none(job):
    job.gnss["vn_mps"] = 360.0
    job.refused("gnss.csv", "'vn_mps', 've_mps'", "away from how the positions move")


def test_only_velocities_wanted_and_none_there(job):
    job.gnss = job.gnss.drop(columns=VELOCITY)
    job.set("gnss", use=["velocity"]).refused("gnss.use", "velocit")


@pytest.mark.parametrize("windows", [[[0.0, 121.0]], [[-5.0, 60.0], [60.0, 1000.0]], [[0.0, 120.0]]])
def test_everything_withheld(job, windows):
    message = job.set("gnss", outages_s=windows).refused()
    assert "nan" not in message


def test_an_output_rate_that_leaves_no_epoch(job):
    job.set("start", time_s=1.0).set("output", rate_hz=0.001).refused("output.rate_hz")


def test_a_start_after_the_last_fix(job):
    done = without(job, 119.6, 121.0, "gnss").set("start", time_s=119.7, heading_deg=30.0).done()
    assert len(done.trajectory()) == 4


def test_a_lever_arm_three_metres_wrong_is_told(job):
    job.set("gnss", lever_arm_m=(2.6, 0.2, -1.3)).done("gnss.lever_arm_m")


@pytest.mark.parametrize("late_s", [-3.0, 1.0, 3.0])
def test_a_time_offset_is_told_with_its_size(job, late_s):
    job.imu["time_s"] += late_s
    done = job.done(f"with {-late_s:+.1f} s added to imu.time_offset_s")
    assert any("innovations are larger than claimed" in warning for warning in done.outcome.warnings)
    assert job.set("imu", time_offset_s=-late_s).done().outcome.err == ""


def test_a_small_time_offset_is_told(job):
    job.imu["time_s"] += 0.3
    job.done("innovations are larger than claimed: gnss_velocity")


def warns_or_refuses(job, word):
    outcome = job.run()
    assert word in outcome.err
    assert outcome.code == 1 or any(word in warning for warning in outcome.warnings)
    assert "Traceback" not in outcome.err


# hard GNSS


def with_outliers(job, share=0.1, metres=100.0):
    rng = np.random.default_rng(3)
    hit = rng.random(len(job.gnss)) < share
    hit[0] = False
    for column in ("lat_deg", "lon_deg"):
        job.gnss.loc[hit, column] += metres * METRE_DEG * rng.choice([-1.0, 1.0], hit.sum())
    return int(hit.sum())


@pytest.mark.parametrize("velocity", [True, False])
def test_outliers_are_rejected(job, velocity):
    if not velocity:
        job.gnss = job.gnss.drop(columns=VELOCITY)
    count = with_outliers(job)
    done = job.done("of gnss_position rejected; what was used agrees with its standard deviations")
    assert count <= done.counts()["rejected"] <= count + 5
    assert done.errors("smoothed").statistics["position_horizontal"].rms < 0.5
    assert done.errors("forward", skip_s=20.0).consistency["position"].nees_per_dof < 3.0


@pytest.mark.parametrize("velocity", [True, False])
def test_the_first_fix_is_an_outlier(job, velocity):
    if not velocity:
        job.gnss = job.gnss.drop(columns=VELOCITY)
    job.gnss.loc[0, "lat_deg"] += 100.0 * METRE_DEG
    done = job.done()
    assert done.errors("smoothed").statistics["position_horizontal"].rms < 1.0
    assert done.errors("forward", skip_s=15.0).statistics["position_horizontal"].max < 5.0


@pytest.mark.parametrize("velocity", [True, False])
def test_sigmas_ten_times_too_small_are_told(job, velocity):
    job.gnss[SD] *= 0.1
    if not velocity:
        job.gnss = job.gnss.drop(columns=VELOCITY)
    done = job.done("innovations are larger than claimed: gnss_position 1", "gnss.sd_scale")
    assert done.counts()["used"] > 200
    assert done.errors("smoothed").statistics["position_horizontal"].rms < 1.0


def test_sigmas_ten_times_too_large_are_in_the_summary(job):
    job.gnss[SD] *= 10.0
    assert job.done().measurements()["verdict"].startswith("pessimistic by factor 9.")


def test_in_motion_from_the_first_sample(job):
    for velocity in (True, False):
        job.imu = job.imu[job.imu["time_s"] > 50.0]
        job.gnss = job.gnss if velocity else job.gnss.drop(columns=VELOCITY)
        done = job.done()
        assert done.outcome.err == ""
        assert done.summary["start"][0]["level_from"] == "moving"
        assert done.errors("smoothed").statistics["heading"].rms < 2.0
        inside_sigmas(done, np.arange(51.0, 120.0, 1.0))


def test_gnss_begins_in_the_middle(job):
    done = without(job, 0.0, 60.0, "gnss").done()
    assert done.summary["start"][0]["time_s"] == 60.0
    assert done.errors("smoothed").statistics["position_horizontal"].rms < 0.5


def static_job(job, seconds, sensor, **motion):
    logs = simulate(static(seconds, **motion), grade(sensor), 1, imu_kind="rates", gnss_rate=1.0)
    write_logs(job.folder, logs)
    import pandas as pd

    job.imu, job.gnss = pd.read_parquet(job.folder / "imu.parquet"), pd.read_csv(job.folder / "gnss.csv")
    job.truth = logs.truth
    return job.set("imu", grade=sensor).set("gnss", lever_arm_m=None)


@pytest.mark.parametrize("velocity", [True, False])
def test_a_log_without_motion_leaves_the_heading_unknown(job, velocity):
    static_job(job, 120.0, "industrial-mems", heading=2.0)
    if not velocity:
        job.gnss = job.gnss.drop(columns=VELOCITY)
    done = job.done("heading could not be found")
    for name in ("forward", "smoothed"):
        assert np.all(np.degrees(done.trajectory(name).sd_attitude[:, 2]) > 60.0)
    assert done.errors("smoothed").statistics["position_horizontal"].max < 1.5


def test_a_good_sensor_finds_north_standing(job):
    done = static_job(job, 300.0, "navigation", heading=1.0).done()
    assert done.summary["start"][0]["heading_from"] == "earth rate"
    assert done.errors("forward").statistics["heading"].max < 0.5


def test_a_grade_that_flatters_the_sensor_is_told(job):
    static_job(job, 120.0, "industrial-mems").set("imu", grade="navigation").done("grade")


def truth_as_start(job):
    truth = job.truth
    roll, pitch, heading = (float(value) for value in np.degrees(truth.attitude[0]))
    return {
        "lat_deg": float(np.degrees(truth.lat[0])),
        "lon_deg": float(np.degrees(truth.lon[0])),
        "height_m": float(truth.height[0]),
        "velocity_mps": (0.0, 0.0, 0.0),
        "roll_deg": roll,
        "pitch_deg": pitch,
        "heading_deg": heading,
    }


PARTS = [
    (),
    ("lat_deg", "lon_deg", "height_m"),
    ("velocity_mps",),
    ("heading_deg",),
    ("roll_deg",),
    ("roll_deg", "pitch_deg"),
    ("lat_deg", "lon_deg", "height_m", "heading_deg"),
    ("lat_deg", "lon_deg", "height_m", "velocity_mps", "roll_deg", "pitch_deg", "heading_deg"),
]


@pytest.mark.parametrize("parts", PARTS, ids=["+".join(parts) or "nothing" for parts in PARTS])
@pytest.mark.parametrize("frame", ["ned", "ecef"])
def test_a_start_given_in_part(job, parts, frame):
    start = truth_as_start(job)
    done = job.set("start", **{name: start[name] for name in parts}).set("filter", frame=frame).done()
    assert done.outcome.err == ""
    assert done.errors("smoothed").statistics["heading"].rms < 0.3
    inside_sigmas(done, np.arange(0.0, 120.0, 1.0), sigmas=4.5)


def heading_off(job, degrees, sd):
    start = truth_as_start(job)
    start["heading_deg"] = (start["heading_deg"] + degrees) % 360.0
    return job.set("start", **start, sd_attitude_deg=(2.0, 2.0, sd))


def test_a_heading_half_a_turn_wrong_with_an_honest_sigma(job):
    done = heading_off(job, 180.0, 180.0).done()
    assert done.errors("smoothed").statistics["heading"].rms < 0.3
    inside_sigmas(done, np.arange(0.0, 120.0, 1.0))


@pytest.mark.parametrize("degrees", [30.0, -30.0])
def test_a_heading_three_sigmas_wrong(job, degrees):
    done = heading_off(job, degrees, 10.0).done()
    assert done.errors("smoothed").statistics["heading"].rms < 0.3
    assert done.errors("forward", skip_s=60.0).statistics["heading"].max < 1.0
    inside_sigmas(done, np.arange(0.0, 120.0, 1.0), sigmas=4.5)


@pytest.mark.parametrize(
    ("wrong", "word"),
    [
        ({"heading_deg": 214.4, "sd_attitude_deg": (2.0, 2.0, 5.0)}, "heading_deg"),
        ({"roll_deg": 60.0}, "roll_deg"),
        ({"lat_deg": 55.8}, "[start]"),
    ],
    ids=["heading", "roll", "latitude"],
)
def test_a_start_that_contradicts_the_data_is_told(job, wrong, word):
    warns_or_refuses(job.set("start", **{**truth_as_start(job), **wrong}), word)
