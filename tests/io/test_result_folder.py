"""A run that is written and read back is the same run."""

import json
from dataclasses import fields, replace

import numpy as np
import pytest

import navfuse
from navfuse.data.gps_epoch import GpsEpoch
from navfuse.data.result import Innovations, Result, StateHistory
from navfuse.errors import ConfigError, InputError
from navfuse.imu.grades import grade
from navfuse.io.log_tables import write_gnss, write_imu
from navfuse.io.result_folder import read_result, write_result
from navfuse.simulation import car_drive, simulate


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    folder = tmp_path_factory.mktemp("logs")
    logs = simulate(car_drive(40.0, seed=2), grade("industrial-mems"), 3, imu_rate=50.0, gnss_rate=1.0)
    write_imu(folder / "imu.parquet", logs.imu)
    fixes = replace(logs.gnss, fix=np.resize(["dgps", "single"], logs.gnss.time.size))
    write_gnss(folder / "gnss.csv", fixes)
    gnss = {"file": str(folder / "gnss.csv"), "epoch_week_s": [2374, 243258.0]}
    return navfuse.process({"imu": {"file": str(folder / "imu.parquet"), "grade": "industrial-mems"}, "gnss": gnss})


def _assert_same(one, other, rtol=1e-12):
    for entry in fields(one):
        a, b = getattr(one, entry.name), getattr(other, entry.name)
        if isinstance(a, np.ndarray) and a.dtype.kind in "fi":
            np.testing.assert_allclose(a, b, rtol=rtol, atol=1e-15, err_msg=entry.name)
        elif isinstance(a, np.ndarray):
            np.testing.assert_array_equal(a, b, err_msg=entry.name)


@pytest.mark.parametrize("format_", ["parquet", "csv"])
def test_everything_of_a_run_comes_back(result, tmp_path, format_):
    write_result(tmp_path, result, (format_,))
    back = read_result(tmp_path)
    assert result.imu is not None
    assert result.fixes is not None
    assert result.smoothed is not None
    for name in ("forward", "smoothed", "innovations", "fixes", "imu"):
        _assert_same(getattr(result, name), getattr(back, name))
    assert list(back.states) == list(result.states)
    for name, history in result.states.items():
        for a, b in zip(history, back.states[name], strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-18)
    assert back.epoch == result.epoch == GpsEpoch(2374, 243258.0)
    assert back.warnings == result.warnings
    assert back.summary == json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert navfuse.read_result is read_result


def test_blocks_with_times_of_their_own(result, tmp_path):
    own = StateHistory(np.array([1.0, 2.0]), np.array([[1.0], [2.0]]), np.array([[0.1], [0.2]]))
    other = StateHistory(np.array([2.0, 3.0]), np.ones((2, 3)), np.full((2, 3), 0.5))
    write_result(tmp_path, replace(result, states={"odometer.scale": own, "gyro_bias": other}))
    back = read_result(tmp_path).states
    for name, history in (("odometer.scale", own), ("gyro_bias", other)):
        for a, b in zip(history, back[name], strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-12)


def test_a_run_without_measurements(result, tmp_path):
    bare = Result(result.forward, innovations=Innovations.empty(), summary={"measurements": {}})
    write_result(tmp_path, bare)
    back = read_result(tmp_path)
    assert len(back.innovations) == 0
    assert back.smoothed is None
    assert back.fixes is None
    assert back.imu is None
    assert back.epoch is None
    _assert_same(back.forward, result.forward)


def test_what_is_no_folder_of_a_run(result, tmp_path):
    with pytest.raises(InputError, match=r"is not there; give the folder"):
        read_result(tmp_path / "nowhere")
    (tmp_path / "file").write_text("x")
    with pytest.raises(InputError, match=r"is a file; give the folder"):
        read_result(tmp_path / "file")
    with pytest.raises(InputError, match=r"no forward\.parquet or forward\.csv"):
        read_result(tmp_path)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("summary.json", "{", "cannot be read as JSON"),
        ("summary.json", "[]", "holds no object"),
        ("imu.json", '{"time_s": [1]}', "lacks rate_hz"),
        ("innovations.csv", "time_s,source,status\n1,a,used\n", "lacks nis"),
        ("innovations.csv", "time_s,other\n1,2\n", "lacks source, status"),
        (
            "innovations.csv",
            "time_s,source,status,nis,dof,z_1,z_2,z_3,sd_1,sd_2,sd_3,row\n1,a,used,1,nan,1,1,1,1,1,1,0\n",
            "'dof'",
        ),
        ("summary.json", '{"epoch_week_s": "soon"}', "epoch_week_s has to be"),
        ("summary.json", '{"epoch_week_s": [1, 2, 3]}', "epoch_week_s has to be"),
        ("summary.json", '{"warnings": 3}', "list of texts"),
        ("summary.json", '{"settings": []}', "settings is no object"),
        ("imu.json", '{"time_s": ["a"], "rate_hz": [1]}', "time_s has to hold numbers"),
        ("imu.json", '{"time_s": [1], "rate_hz": [1], "usual_rate_hz": [1, 2]}', "usual_rate_hz has the wrong shape"),
        ("states.csv", "other\n1\n", "lacks time_s"),
        ("states.csv", "time_s,gyro_bias_x_dph,sd_gyro_bias_x_dph\n1,a,b\n", "gyro_bias_x_dph"),
        ("states.csv", "time_s,gyro_bias_x_dph\n1,2\n", "no 'sd_gyro_bias_x_dph' beside it"),
    ],
)
def test_damaged_files_are_named(result, tmp_path, name, content, message):
    write_result(tmp_path, result, ("csv",))
    (tmp_path / name).write_text(content)
    with pytest.raises(InputError, match=message) as caught:
        read_result(tmp_path)
    assert name in str(caught.value)


@pytest.mark.parametrize("epoch", [(2374.5, 0.0), (-1, 0.0), (2374, -1.0), (2374, 604800.0)])
def test_no_such_epoch(epoch):
    with pytest.raises(ConfigError, match="GPS week number"):
        GpsEpoch.of(*epoch)


def test_seconds_of_an_epoch():
    assert GpsEpoch.of(1, 10.0).seconds == 604810.0
