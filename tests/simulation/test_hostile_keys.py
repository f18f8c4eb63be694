"""Keys and values of scenario files that no model expects: each ends as one message with section, key and value."""

from __future__ import annotations

import re

import numpy as np
import pytest

from navfuse.errors import ConfigError, InputError
from navfuse.imu.error_model import DATASHEET_UNITS
from navfuse.simulation.bounds import FASTEST_HZ, MOST_ROWS, require_rows, sampling_rate
from navfuse.simulation.gnss_errors import RECEIVER_UNITS, FixType, GnssReceiverModel
from navfuse.simulation.heading_sensor import HeadingModel, measure_heading
from navfuse.simulation.imu_errors import SENSOR_UNITS, ImuSensorModel
from navfuse.simulation.measured_imu import measure_imu
from navfuse.simulation.odometer import OdometerModel, measure_odometer
from navfuse.simulation.perfect_imu import perfect_imu, sample_times
from navfuse.simulation.raw_gnss_errors import RAW_GNSS_UNITS, RawGnssModel
from navfuse.simulation.scenario import SENSORS, read_scenario
from navfuse.simulation.scenario_run import run_scenario
from navfuse.simulation.segments import segments_from_tables
from navfuse.simulation.sky import SkySector
from navfuse.simulation.vehicles import car_drive, circle_flight, figure_eight_flight, static

BARE = {
    "imu": {"rate_hz": 10.0},
    "gnss": {"position_sd_m": 1.0},
    "wheel_speeds": {"wheels": [{"name": "left"}]},
    "uwb": {"anchors": [{"name": "a", "lat_deg": 48.0, "lon_deg": 11.5, "height_m": 500.0}]},
} | {name: {} for name in SENSORS if name not in ("wheel_speeds", "uwb")}
HUGE = 10**400


def scenario(section=None, motion=None, **keys):
    """A car that stands for two seconds, with keys added to a section, as nested tables."""
    data = {"imu": {"rate_hz": 10.0}, "motion": motion or {"vehicle": "static", "duration_s": 2.0}}
    if section is not None:
        data[section] = BARE[section] | keys
    return data


def refusal(data):
    with pytest.raises(ConfigError) as raised:
        run_scenario(read_scenario(data, "x"))
    return str(raised.value)


@pytest.mark.parametrize("key", ["cls", "self", "where", "make", "base", "source", "name", "printed"])
@pytest.mark.parametrize("section", sorted(BARE))
def test_a_key_named_like_a_parameter_is_an_unknown_key(section, key):
    assert re.match(rf"x: \[{section}\]: .*unknown key or unit '{key}'", refusal(scenario(section, **{key: 1})))


@pytest.mark.parametrize("key", ["cls", "self", "name"])
@pytest.mark.parametrize("table", ["sectors", "satellite_outages"])
def test_a_key_named_like_a_parameter_is_an_unknown_key_in_a_table_within(table, key):
    message = refusal(scenario("pseudoranges", **{table: [{key: 1}]}))
    assert re.match(rf"x: \[pseudoranges\]: .*unknown key or unit '{key}'", message)


@pytest.mark.parametrize(
    "model", [GnssReceiverModel(position_sd=1.0), RawGnssModel(), HeadingModel(), ImuSensorModel()]
)
def test_a_copy_knows_no_key_named_like_a_parameter_either(model):
    with pytest.raises(ConfigError, match="unknown key or unit 'self'"):
        model.replace_datasheet(self=1)


@pytest.mark.parametrize("value", [3, True, {}, {"name": "a"}, "abc", [1, 2], [[1]], ["abc"], 1.5])
@pytest.mark.parametrize(
    ("section", "key"), [("gnss", "fix_types"), ("pseudoranges", "sectors"), ("pseudoranges", "satellite_outages")]
)
def test_what_is_no_list_of_tables_is_refused(section, key, value):
    assert re.match(rf"x: \[{section}\]: {key} must be a list of tables", refusal(scenario(section, **{key: value})))


@pytest.mark.parametrize("value", [3, {}, "abc"])
def test_models_refuse_what_is_no_list_too(value):
    with pytest.raises(ConfigError, match="^fix_types must be a list of tables"):
        GnssReceiverModel(position_sd=1.0, fix_types=value)
    with pytest.raises(ConfigError, match="^sectors must be a list of tables"):
        RawGnssModel(sectors=value)
    assert GnssReceiverModel(position_sd=1.0, fix_types=[FixType("rtk")]).fix_types == (FixType("rtk"),)


@pytest.mark.parametrize("name", [["hold"], 3, {}, True, None])
def test_a_segment_that_is_no_text_is_none_of_those_known(name):
    with pytest.raises(ConfigError, match=r"segment 1: do = .* is none of hold, accelerate"):
        segments_from_tables([{"do": name, "duration_s": 5.0}])


def test_a_segment_that_is_no_table_is_refused():
    with pytest.raises(ConfigError, match="segment 2 must be a table of keys, not 3"):
        segments_from_tables([{"do": "hold", "duration_s": 5.0}, 3])


@pytest.mark.parametrize("rate", [1e12, 1e99, np.nextafter(FASTEST_HZ, np.inf)])
@pytest.mark.parametrize("section", sorted(set(BARE) - {"imu"}))
def test_a_rate_that_no_sensor_has_is_refused(section, rate):
    message = refusal(scenario(section, rate_hz=rate))
    assert message.startswith(f"x: [{section}]: rate_hz = {float(rate)!r}: rate must be at most 10000 Hz")


def test_the_fastest_rate_is_taken():
    assert sampling_rate("rate", FASTEST_HZ) == FASTEST_HZ


MOTIONS = {
    "static": {"vehicle": "static", "duration_s": 1e12},
    "city-car": {"vehicle": "city-car", "duration_s": 1e12},
    "hold": {"vehicle": "car", "segments": [{"do": "hold", "duration_s": 1e15}]},
    "stop": {"vehicle": "boat", "speed_mps": 2.0, "segments": [{"do": "stop", "duration_s": 1e90}]},
    "turn": {"vehicle": "aircraft", "segments": [{"do": "turn", "angle_deg": 1e15}]},
    "walk": {"vehicle": "pedestrian", "segments": [{"do": "hold", "duration_s": 1e15}]},
    "weave": {"vehicle": "car", "speed_mps": 5.0, "segments": [{"do": "s_turns", "angle_deg": 5, "count": 10**9}]},
    "table": {"vehicle": "rotating-table", "rest_s": 1e15, "moves": [{"axis": "x", "angle_deg": 1, "duration_s": 5}]},
}


@pytest.mark.parametrize("motion", MOTIONS.values(), ids=MOTIONS.keys())
def test_a_motion_without_end_is_refused_before_it_fills_the_memory(motion):
    message = refusal(scenario(motion=motion))
    assert re.match(r"x: \[(motion|imu)\]: ", message)
    assert re.search(r"would make \d.*e\+\d+ rows; at most 100,000,000 are made|count of turns must be in 1", message)


@pytest.mark.parametrize("flight", [circle_flight, figure_eight_flight, car_drive])
def test_a_drive_or_a_flight_without_end_is_refused(flight):
    with pytest.raises(ConfigError, match=r"a motion of 1e\+12 s with a knot every 0.1 s would make 1e\+13 rows"):
        flight(1e12)


@pytest.mark.parametrize("hills", [-0.01, 1.01, 1e99, float("nan")])
def test_a_drive_over_walls_is_refused(hills):
    with pytest.raises(ConfigError, match="hills must be a slope in 0 .. 1, not 1.0 and"):
        car_drive(10.0, standing=1.0, hills=hills)


def test_a_day_at_1_khz_is_no_more_than_is_made():
    require_rows(86400.0 * 1000.0 + 1.0, "a day")
    require_rows(MOST_ROWS, "the most")
    with pytest.raises(ConfigError, match=r"the most and one would make 1e\+08 rows"):
        require_rows(MOST_ROWS + 1, "the most and one")
    with pytest.raises(ConfigError, match=r"1e\+06 s at 1000 Hz would make 1e\+09 rows; at most 100,000,000"):
        sample_times(0.0, 1e6, 1000.0)
    with pytest.raises(ConfigError, match="would make inf rows"):
        sample_times(0.0, 1e300, 1e300)


@pytest.mark.parametrize(
    ("section", "keys", "message"),
    [
        ("gnss", {"outages_per_h": 1e20, "outage_s": 1.0}, "outages per hour would make"),
        ("gnss", {"multipath_jumps_per_h": 1e20, "multipath_mean_s": 1.0, "multipath_sd_m": 1.0}, "1e+20 random"),
        ("odometer", {"slips_per_h": 1e20, "slip_mean_s": 1.0, "slip_sd_percent": 1.0}, "1e+20 random events"),
        ("odometer", {"rate_hz": 1e-12, "averaged": True}, "the mean over an interval of 1e+12 s"),
        ("pseudoranges", {"outlier_percent": 1.0, "outlier_s": 1e20, "outlier_to_m": 5.0}, "outliers of 1e+20 s"),
        ("imu", {"dropouts_per_h": 1e20, "dropout_s": 1.0}, "1e+20 dropouts per hour"),
    ],
)
def test_errors_without_number_are_refused_before_they_fill_the_memory(section, keys, message):
    found = refusal(scenario(section, **keys))
    assert found.startswith(f"x: [{section}]: ")
    assert message in found


@pytest.mark.parametrize(
    ("section", "keys"),
    [
        ("gnss", {"position_sd_m": HUGE}),
        ("gnss", {"position_sd_m": [1, 2, HUGE]}),
        ("gnss", {"fix_types": [{"name": "a", "mean_s": HUGE}]}),
        ("imu", {"arw_deg_per_sqrt_h": HUGE}),
        ("imu", {"gyro_bias_floor_dph": [0, 0, HUGE]}),
        ("imu", {"rate_hz": HUGE}),
        ("pseudoranges", {"satellite_outages": [{"satellite": "G01", "from_s": HUGE}]}),
        ("pseudoranges", {"sectors": [{"azimuth_from_deg": HUGE}]}),
        ("pseudoranges", {"lever_arm_m": [0, 0, HUGE]}),
        ("uwb", {"anchors": [{"name": "a", "lat_deg": 0, "lon_deg": 0, "height_m": HUGE}]}),
        ("magnetometer", {"year": HUGE}),
        ("odometer", {"speed_sd_mps": 1e300}),
        ("heading", {"heading_sd_deg": 1e300}),
        ("barometer", {"pressure_sd_hpa": 1e300}),
    ],
)
def test_numbers_too_large_are_refused(section, keys):
    message = refusal(scenario(section, **keys))
    assert message.startswith(f"x: [{section}]: ")
    assert "at most 1e+100 in size, not " in message


@pytest.mark.parametrize(
    "motion",
    [
        {"vehicle": "static", "duration_s": HUGE},
        {"vehicle": "car", "segments": [{"do": "hold", "duration_s": HUGE}]},
        {"vehicle": "car", "segments": [{"do": "hold", "duration_s": float("inf")}]},
        {"vehicle": "rotating-table", "offset_m": [0, 0, HUGE], "moves": []},
    ],
)
def test_a_motion_of_numbers_too_large_is_refused(motion):
    assert re.search(r"at most 1e\+100 in size, not |finite", refusal(scenario(motion=motion)))


@pytest.mark.parametrize(
    ("section", "keys", "message"),
    [
        ("gnss", {"position_sd_m": "1.5"}, "position_sd_m must be a number or an array of numbers, not '1.5'"),
        ("gnss", {"position_sd_m": ["1", "2", "3"]}, "position_sd_m must be a number or an array of numbers, not ['"),
        ("heading", {"rate_hz": True}, "rate_hz must be a number or an array of numbers, not True"),
        ("imu", {"arw_deg_per_sqrt_h": "0.1"}, "arw_deg_per_sqrt_h must be a number or three numbers, not '0.1'"),
        ("imu", {"gyro_range_degps": True}, "gyro_range_degps must be a number"),
        ("pseudoranges", {"sectors": [{"azimuth_from_deg": "0"}]}, "azimuth_from_deg must be a number"),
        ("uwb", {"anchors": [{"name": "a", "lat_deg": "48", "lon_deg": 0, "height_m": 0}]}, "lat_deg of anchor 'a'"),
        ("wheel_speeds", {"wheels": [{"name": "a", "forward_m": "1"}]}, "forward_m of wheel 'a' must be a number"),
        ("magnetometer", {"soft_iron": [[True, 0, 0], [0, 1, 0], [0, 0, 1]]}, "soft_iron must be a number"),
    ],
)
def test_texts_and_truth_values_are_no_numbers(section, keys, message):
    assert refusal(scenario(section, **keys)).startswith(f"x: [{section}]: {message}")


@pytest.mark.parametrize(
    ("section", "keys", "message"),
    [
        ("imu", {"gyro_noise_degps_per_sqrt_hz": -1.0}, "gyro_noise_degps_per_sqrt_hz = -1.0: arw must be finite"),
        ("imu", {"gyro_range_degps": 0}, "gyro_range_degps = 0: gyro_range must be more than 0"),
        ("pseudoranges", {"outlier_percent": 60}, "outlier_percent = 60: outlier_share must be at most 0.5, not 0.6"),
        ("gnss", {"position_sd_m": None, "position_sd_cm": [-1, 1, 1]}, "position_sd_cm = [-1, 1, 1]: position_sd"),
        ("heading", {"bias_deg": float("nan")}, "bias_deg = nan: bias must be a number and finite, not nan"),
        ("barometer", {"bias_sd_hpa": -1.0}, "bias_sd_hpa = -1.0: bias_sd must be at least 0 and finite, not -100.0"),
        ("pseudoranges", {"sectors": [{"azimuth_from_deg": 0, "azimuth_to_deg": 400, "elevation_below_deg": 9}]},
         "azimuth_to_deg = 400: azimuth_to of a sky sector must lie in -360 .. 360 deg, not 400 deg"),
    ],
)  # fmt: skip
def test_messages_name_the_key_and_the_value_that_were_given(section, keys, message):
    data = scenario(section, **keys)
    data[section] = {key: value for key, value in data[section].items() if value is not None}
    found = refusal(data)
    assert found.startswith(f"x: [{section}]: {message}")
    assert "float64" not in found
    assert "array(" not in found


def test_copies_name_the_key_too():
    for model, keys in (
        (GnssReceiverModel(position_sd=1.0), {"position_sd_cm": -1.0}),
        (RawGnssModel(), {"outlier_percent": 60.0}),
        (HeadingModel(), {"bias_sd_deg": -1.0}),
        (ImuSensorModel(), {"accel_range_g": -1.0}),
    ):
        with pytest.raises(ConfigError, match=rf"^{next(iter(keys))} = {next(iter(keys.values()))!r}: "):
            model.replace_datasheet(**keys)
    with pytest.raises(ConfigError, match=r"^azimuth_to_deg = 400: "):
        SkySector.from_datasheet(azimuth_from_deg=0, azimuth_to_deg=400, elevation_below_deg=5)


def test_a_receiver_without_errors_is_told_which_keys_to_give():
    with pytest.raises(ConfigError, match="both zero on some axis, .*: give position_sd_m or position_correlated_sd_m"):
        GnssReceiverModel.from_datasheet(rate_hz=1.0)


@pytest.mark.parametrize("lsb", [0.0, 0.1, 0.3, 1.0, 7.5])
def test_headings_on_the_turn_from_360_to_0_are_never_360(lsb):
    model = HeadingModel.from_datasheet(rate_hz=100.0, heading_sd_deg=1e-13, heading_lsb_deg=lsb)
    log, truth = measure_heading(static(20.0, heading=-1e-17), model, np.random.default_rng(1))
    columns = log.columns()["heading_deg"]
    for heading, turn in ((truth.heading, 2.0 * np.pi), (log.heading, 2.0 * np.pi), (columns, 360.0)):
        assert np.all((heading >= 0.0) & (heading < turn))
    true = static(20.0, heading=-1e-17).trajectory(np.linspace(0.0, 20.0, 50)).to_columns()["heading_deg"]
    assert np.all((true >= 0.0) & (true < 360.0))


KEYS = {
    "imu": [*SENSOR_UNITS, *DATASHEET_UNITS, "kind", "grade", "rate_hz"],
    "gnss": [*RECEIVER_UNITS, "fix_types", "lever_arm_m"],
    "pseudoranges": [*RAW_GNSS_UNITS, "constellation", "n_satellites", "corrected", "sectors", "satellite_outages"],
} | {
    name: [*kind.make.__self__.UNITS, *kind.make.__self__.WORDS]
    for name, kind in SENSORS.items()
    if not kind.at_antenna
}
HOSTILE = (
    -1, 1e99, 1e300, HUGE, float("nan"), float("-inf"), "1", True, None, {}, [], [[1, 2], [3]], [True, 1, 2], [{}],
    [1e99] * 3, [[float("nan"), 1.0]],
)  # fmt: skip


@pytest.mark.parametrize("section", sorted(BARE))
def test_every_value_of_every_key_is_taken_or_refused_by_one_message(section):
    messages = []
    for key in KEYS[section]:
        for value in HOSTILE:
            try:
                run_scenario(read_scenario(scenario(section, **{key: value}), "x"))
            except (ConfigError, InputError) as error:
                messages.append(str(error))
    assert 0.5 < len(messages) / (len(KEYS[section]) * len(HOSTILE)) < 1.0
    for message in messages:
        assert message.startswith("x: ")
        assert len(message) < 400
        assert not re.search(r"float64|array\(", message)


def test_the_usual_is_still_measured():
    motion = static(5.0)
    odometer = OdometerModel.from_datasheet(averaged=True, slips_per_h=600.0, slip_mean_s=1.0, slip_sd_percent=1.0)
    assert measure_odometer(motion, odometer, np.random.default_rng(1))[0].time.size == 51
    imu = ImuSensorModel.from_datasheet("tactical", dropouts_per_h=600.0, dropout_s=0.1)
    ideal = perfect_imu(motion, sample_times(0.0, 5.0, 100.0))
    assert measure_imu(ideal, imu, np.random.default_rng(1))[0].time.size > 400
