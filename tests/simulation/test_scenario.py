"""Scenario files: those that come along, what they say, and every way in which one can be wrong."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest

from navfuse.errors import ConfigError, InputError
from navfuse.simulation.scenario import load_scenario, read_scenario, scenario_names, scenario_text
from navfuse.simulation.scenario_run import run_scenario, scenario_truth

NAMED = (
    "aircraft-1hz", "aircraft-300s", "boat", "city-car", "drone", "highway", "lawnmower", "pedestrian-foot", "rc-car",
    "static",
)  # fmt: skip
WHOLE = {"city-car": 600.0, "aircraft-300s": 300.0, "rc-car": 600.0, "highway": 3600.0, "static": 3600.0}
"""Lengths that a title or a description promises [s]."""


def small(**sections):
    """A scenario of some seconds, with sections changed or left out (None)."""
    data = {
        "motion": {
            "vehicle": "car",
            "segments": [{"do": "hold", "duration_s": 2.0}, {"do": "accelerate", "speed_mps": 5.0}],
        },
        "imu": {"rate_hz": 20.0, "grade": "tactical"},
        "gnss": {"position_sd_m": 1.0, "lever_arm_m": [1.0, 0.0, -1.0]},
    }
    for name, keys in sections.items():
        if keys is None:
            del data[name]
        elif isinstance(keys, dict) and name in data:
            data[name] = {key: value for key, value in (data[name] | keys).items() if value is not None}
        else:
            data[name] = keys
    return data


def test_those_that_are_promised_are_there():
    assert set(NAMED) <= set(scenario_names())


@pytest.mark.parametrize("name", scenario_names())
def test_a_scenario_of_the_package_is_whole(name):
    scenario = load_scenario(name)
    assert scenario.title
    assert scenario.description
    motion = scenario.motion
    assert motion.end == pytest.approx(WHOLE.get(name, motion.end), abs=1e-6)
    assert scenario.imu_rate > 0.0


def test_the_motion_is_cut_at_the_duration_and_not_otherwise_changed():
    whole = read_scenario(small(), "x").motion
    cut = read_scenario(small() | {"duration_s": 3.3}, "x").motion
    assert cut.end == 3.3
    assert np.array_equal(cut.r_e([0.0, 1.0, 3.3]), whole.r_e([0.0, 1.0, 3.3]))
    assert whole.until(1e9) is whole
    with pytest.raises(InputError, match="nothing is left of the motion"):
        whole.until(0.0)


def test_the_same_seed_gives_the_same_numbers_and_sections_do_not_disturb_one_another():
    one = run_scenario(read_scenario(small(), "x"), 5)
    again = run_scenario(read_scenario(small(), "x"), 5)
    other = run_scenario(read_scenario(small(), "x"), 6)
    noisier = run_scenario(
        read_scenario(small(gnss={"position_correlated_sd_m": 3.0, "position_correlated_tau_s": 9.0}), "x"), 5
    )
    assert np.array_equal(one.imu.gyro, again.imu.gyro)
    assert np.array_equal(one.gnss.lat, again.gnss.lat)
    assert not np.array_equal(one.imu.gyro, other.imu.gyro)
    assert not np.array_equal(one.gnss.lat, noisier.gnss.lat)
    assert np.array_equal(one.imu.gyro, noisier.imu.gyro)


def test_a_start_is_told_only_where_the_scenario_tells_it():
    assert run_scenario(read_scenario(small(), "x")).start is None
    told = run_scenario(read_scenario(small(start={"sd_attitude_deg": [1.0, 1.0, 5.0]}), "x")).start
    assert np.sqrt(told.P[:3, :3].diagonal()) == pytest.approx([1.0, 1.0, 2.0])
    truth = scenario_truth(read_scenario(small(), "x")).motion.trajectory(np.zeros(1))
    assert 0.0 < abs(told.nav[2] - truth.height[0]) < 10.0


def test_what_the_package_holds_can_be_printed_and_loaded_from_a_file(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(scenario_text("boat"), encoding="utf-8")
    mine, ours = load_scenario(path), load_scenario("boat")
    assert (mine.name, mine.title) == ("mine", ours.title)
    assert np.array_equal(mine.motion.coefficients, ours.motion.coefficients)


def test_changes_stand_in_the_place_of_the_files_keys():
    changed = load_scenario("city-car", {"imu": {"grade": "tactical"}, "": {"duration_s": 30.0}})
    assert changed.motion.end == 30.0
    assert changed.imu_keys["grade"] == "tactical"


def test_a_track_is_relative_to_the_scenario(tmp_path):
    rows = ["time_s,lat_deg,lon_deg,height_m"] + [f"{k},{48.0 + 1e-4 * k},11.0,500.0" for k in range(20)]
    (tmp_path / "track.csv").write_text("\n".join(rows), encoding="utf-8")
    motion = {"vehicle": "track", "file": "track.csv", "rule": "car", "segments": None}
    scenario = read_scenario(small(motion=motion), "x", folder=tmp_path)
    assert scenario.motion.end == 19.0
    gap = [row for row in rows if not row.startswith(("7,", "8,", "9,", "10,", "11,", "12,"))]
    (tmp_path / "track.csv").write_text("\n".join(gap), encoding="utf-8")
    with pytest.raises(InputError, match=r"x: \[motion\]: .*track\.csv.*gaps above"):
        assert read_scenario(small(motion=motion), "x", folder=tmp_path).motion


def test_waypoints_moves_and_the_other_forms():
    points = [
        {"north_m": 0.0, "east_m": 0.0, "speed_mps": 0.0, "pause_s": 5.0},
        {"north_m": 200.0, "east_m": 0.0, "speed_mps": 8.0},
        {"lat_deg": 48.002, "lon_deg": 11.504, "height_m": 501.0, "speed_mps": 0.0},
    ]
    driven = read_scenario(small(motion={"segments": None, "waypoints": points}), "x").motion
    there = driven.trajectory(np.array([0.0, driven.end]))
    assert np.degrees(there.lat) == pytest.approx([48.0, 48.002], abs=1e-8)
    assert there.height == pytest.approx([500.0, 501.0], abs=1e-3)
    moves = [{"axis": "z", "angle_deg": 90.0, "duration_s": 4.0, "pause_s": 1.0}]
    table = read_scenario(
        small(motion={"vehicle": "rotating-table", "moves": moves, "segments": None, "rest_s": 2.0}), "x"
    ).motion
    assert table.end == pytest.approx(7.0)
    turned = np.degrees(table.trajectory(np.array([0.0, 7.0])).attitude[:, 2])
    assert turned[1] - turned[0] == pytest.approx(90.0, abs=1e-6)
    still = read_scenario(
        small(motion={"vehicle": "static", "duration_s": 9.0, "pitch_deg": 3.0, "segments": None}), "x"
    ).motion
    assert np.degrees(still.trajectory(np.array([9.0])).attitude[0, 1]) == pytest.approx(3.0, abs=1e-9)


def test_limits_of_the_vehicle_can_be_changed():
    segments = [{"do": "accelerate", "speed_mps": 10.0}, {"do": "turn", "angle_deg": 90.0, "radius_m": 12.0}]
    tight = small(motion={"segments": segments})
    with pytest.raises(
        ConfigError, match=r"x: \[motion\]: segment 2 \(turn\): the turn takes 8.33 m/s\^2 across, a car .* at most 5"
    ):
        assert read_scenario(tight, "x").motion
    tight["motion"]["limits"] = {"lateral_mps2": 9.0}
    assert read_scenario(tight, "x").motion.end > 0.0


def test_segments_repeat():
    inner = [{"do": "hold", "duration_s": 2.0}, {"do": "turn", "angle_deg": 90.0, "radius_m": 30.0}]
    base = [{"do": "accelerate", "speed_mps": 5.0}]
    long = read_scenario(small(motion={"segments": [*base, *inner, *inner, *inner]}), "x").motion
    repeated = read_scenario(
        small(motion={"segments": [*base, {"do": "repeat", "times": 3, "segments": inner}]}), "x"
    ).motion
    assert np.array_equal(long.coefficients, repeated.coefficients)


WRONG = [
    (small(motion=None), "x: motion is missing"),
    (small(imu=None), "x: imu is missing"),
    (small() | {"gns": {}}, "x: unknown key 'gns'; did you mean gnss?"),
    (small() | {"seed": -1}, "x: seed must be a whole number of at least 0, not -1"),
    (small() | {"title": 3}, "x: title must be a text, not 3"),
    (small() | {"duration_s": 0}, "x: duration_s must be more than 0, not 0"),
    (small() | {"motion": 3}, r"x: \[motion\]: must be a table of keys, not 3"),
    (small() | {"project": {"gnss": 3}}, r"x: \[project\] must hold tables"),
    (small() | {"one_table": "a/b.csv"}, "x: one_table must name a .csv file of its own without a folder"),
    (small(motion={"vehicle": "tank"}), r"x: \[motion\]: vehicle = 'tank' is none of car, .*"),
    (small(motion={"segmens": 1}), r"x: \[motion\]: unknown key 'segmens'; did you mean segments\?"),
    (small(motion={"segments": None}), r"x: \[motion\]: a car needs either segments or waypoints"),
    (small(motion={"segments": []}), r"x: \[motion\]: segments must be a list of tables"),
    (small(motion={"segments": [{"do": "jump"}]}), r"segment 1: do = 'jump' is none of"),
    (small(motion={"segments": [{"do": "repeat", "times": 0, "segments": [{}]}]}), r"segment 1 \(repeat\): times"),
    (small(motion={"segments": [{"do": "repeat", "times": 2, "segments": 5}]}), r"segment 1 \(repeat\): segments"),
    (small(motion={"segments": [{"do": "repeat", "time": 2}]}), r"segment 1 \(repeat\): there is no key 'time'"),
    (small(motion={"lat_deg": 91.0}), r"x: \[motion\]: lat_deg must lie in -90 .. 90, not 91.0"),
    (small(motion={"height_m": "high"}), r"x: \[motion\]: height_m must be a finite number, not 'high'"),
    (small(motion={"height_m": True}), r"x: \[motion\]: height_m must be a finite number, not True"),
    (small(motion={"limits": {"lateral": 3.0}}), r"x: \[motion.limits\]: unknown key 'lateral'; did you mean lateral_"),
    (small(motion={"limits": {"pivots": 1}}), r"x: \[motion.limits\]: pivots must be true or false, not 1"),
    (small(motion={"hills_seed": 1.5}), r"x: \[motion\]: hills_seed must be a whole number"),
    (
        small(motion={"segments": None, "waypoints": [{"north_m": 1.0, "east_m": 0.0}]}),
        r"x: \[motion\], waypoint 1: speed_mps is missing",
    ),
    (
        small(motion={"segments": None, "vehicle": "rotating-table", "moves": [{"axis": "w", "angle_deg": 1.0}]}),
        r"x: \[motion\], move 1: axis = 'w' is none of x, y, z",
    ),
    (
        small(motion={"segments": None, "vehicle": "rotating-table", "moves": [{"axis": "x"}], "offset_m": [1, 2]}),
        r"x: \[motion\]: offset_m must be three finite numbers, not \[1, 2\]",
    ),
    (small(imu={"rate_hz": 0}), r"x: \[imu\]: rate_hz must be more than 0, not 0"),
    (small(imu={"rate_hz": 1e6}), r"x: \[imu\]: rate_hz must be at most 10000 Hz, not 1000000.0"),
    (small(imu={"kind": "counts"}), r"x: \[imu\]: kind = 'counts' is none of increments, rates"),
    (small(imu={"grade": "cheap"}), r"x: \[imu\]: unknown IMU grade 'cheap'"),
    (small(imu={"arw_deg_per_h": 1.0}), r"x: \[imu\]: IMU errors: unknown key or unit 'arw_deg_per_h': did you mean"),
    (small(imu={"arw_deg_per_sqrt_h": -1.0}), r"x: \[imu\]: arw_deg_per_sqrt_h = -1.0: arw must"),
    (small(gnss={"rate_hz": 0.0}), r"x: \[gnss\]: rate_hz = 0.0: rate must be more than 0"),
    (small(gnss={"lever_arm_m": 3.0}), r"x: \[gnss\]: lever_arm_m must be three finite numbers, not 3.0"),
    (small(gnss={"position_sd_ft": 3.0}), r"x: \[gnss\]: GNSS errors: unknown key or unit 'position_sd_ft'"),
    (small(start={"sd_position": 3.0}), r"x: \[start\]: unknown key 'sd_position'; did you mean sd_position_m\?"),
    (small(start={"sd_position_m": [0, 1, 1]}), r"x: \[start\]: sd_position_m must be three finite numbers of"),
]  # fmt: skip


@pytest.mark.parametrize(("data", "message"), WRONG, ids=[message[:50] for _, message in WRONG])
def test_what_is_wrong_is_named(data, message):
    with pytest.raises(ConfigError, match=message):
        read_scenario(data, "x")


def test_files_that_are_none(tmp_path):
    with pytest.raises(ConfigError, match=r"missing\.toml: no such scenario file"):
        load_scenario(tmp_path / "missing.toml")
    (tmp_path / "bad.toml").write_text("title =", encoding="utf-8")
    with pytest.raises(ConfigError, match=r"bad\.toml: not valid TOML"):
        load_scenario(tmp_path / "bad.toml")
    (tmp_path / "odd.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match=r"odd\.toml: cannot be read as a scenario"):
        load_scenario(tmp_path / "odd.toml")
    with pytest.raises(ConfigError, match=r"city-car: \[title\] must be a table"):
        load_scenario("city-car", {"title": {"x": 1}})


def test_a_run_that_cannot_be():
    outages = small(gnss={"outages_s": [[0.0, 1e6]]})
    with pytest.raises(InputError, match=r"x: \[gnss\]: the outages hide all"):
        run_scenario(read_scenario(outages, "x"))
    with pytest.raises(ConfigError, match="a seed must be at least 0, not -1"):
        run_scenario(read_scenario(small(), "x"), -1)
    with pytest.raises(ConfigError, match=r"x: the motion lasts .* too short for two IMU samples at 0.01 Hz"):
        run_scenario(read_scenario(small(imu={"rate_hz": 0.01}), "x"))


def test_every_key_of_the_scenarios_is_used():
    """Nothing in the files of the package is a leftover: they parse, and a misspelt key would have been refused."""
    for name in scenario_names():
        assert set(tomllib.loads(scenario_text(name))) >= {"title", "description", "motion", "imu"}
