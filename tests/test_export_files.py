"""navfuse.export: from a run's folder, a file or a result to files, all or none."""

from __future__ import annotations

import json

import gpxpy
import numpy as np
import pandas
import pytest

import navfuse
from navfuse.analysis.export_track import export_track
from navfuse.data.gps_epoch import GpsEpoch
from navfuse.data.logs import GnssLog
from navfuse.data.result import Result
from navfuse.data.trajectory import Trajectory
from navfuse.errors import ConfigError, InputError, NavfuseWarning
from navfuse.export_files import export_result
from navfuse.io.exports import EXTENSIONS
from navfuse.io.result_folder import read_result, write_result
from navfuse.io.trajectory_table import write_trajectory

EPOCH = GpsEpoch(2374, 243258.0)


def trajectory(n=50, **more):
    time = np.arange(n) * 0.1
    triad = np.zeros((n, 3))
    return Trajectory(
        time, 0.8 + 1e-7 * time, np.full(n, 0.2), 100.0 + time, triad + 0.6, triad + 0.1, triad + 0.02, triad + 0.01,
        triad + 1e-3, **more,
    )  # fmt: skip


def a_result(epoch=EPOCH, smoothed=True):
    time = np.arange(5.0)
    fixes = GnssLog(
        time, np.full(5, 0.8), np.full(5, 0.2), np.full(5, 100.0), np.ones((5, 3)), fix=np.full(5, "rtk-fixed")
    )
    summary = {
        "epoch_week_s": None if epoch is None else list(epoch),
        "settings": {"gnss": {"lever_arm_m": [1.0, 0.5, -1.5]}},
        "measurements": {},
        "warnings": [],
    }
    return Result(
        forward=trajectory(40), smoothed=trajectory() if smoothed else None, summary=summary, fixes=fixes, epoch=epoch
    )


@pytest.fixture
def run(tmp_path):
    folder = tmp_path / "my run"
    folder.mkdir()
    write_result(folder, a_result())
    return folder


def test_every_format_of_a_run(run):
    files = navfuse.export(run, formats=tuple(EXTENSIONS), point="antenna", rate_hz=5.0)
    assert [file.name for file in files] == [f"smoothed{extension}" for extension in EXTENSIONS.values()]
    assert {file.parent for file in files} == {run / "exports"}
    assert all(file.stat().st_size > 0 for file in files)
    expected = export_track(read_result(run), point="antenna", rate_hz=5.0).trajectory
    found = pandas.read_csv(run / "exports" / "smoothed.csv")
    for name, column in expected.to_columns().items():
        np.testing.assert_allclose(found[name], column, rtol=1e-14, atol=1e-14)
    assert set(found["fix"]) == {"rtk-fixed"}
    gpx = gpxpy.parse((run / "exports" / "smoothed.gpx").read_text())
    assert (gpx.name, gpx.description) == ("my run", "Point: antenna. Heights: above the geoid.")


def test_events_from_a_file_with_the_epoch_of_the_run(run, tmp_path):
    events = tmp_path / "events.csv"
    events.write_text("gps_week,gps_tow_s,label\n2374,243260.5,b\n2374,243259.25,a\n2374,1,never\n")
    with pytest.warns(NavfuseWarning, match="1 of 3 events.*'never'"):
        (file,) = navfuse.export(run, tmp_path / "out", "geojson", at=events, solution="forward")
    assert file == tmp_path / "out" / "forward-events.geojson"
    points = json.loads(file.read_text())["features"]
    assert [(p["properties"]["label"], p["properties"]["time_s"]) for p in points] == [("a", 1.25), ("b", 2.5)]
    navfuse.export(run, tmp_path / "out", "csv", at=[1.0, 2.0], labels=["x", "y"])
    assert pandas.read_csv(tmp_path / "out" / "smoothed-events.csv")["label"].tolist() == ["x", "y"]


def test_a_file_and_what_is_no_file(tmp_path):
    write_trajectory(tmp_path / "drive.parquet", trajectory())
    files = navfuse.export(tmp_path / "drive.parquet", formats=["kml", "csv"], epoch=(2374, 243258.0), name="<mine>")
    assert files == [tmp_path / "exports" / "drive.kml", tmp_path / "exports" / "drive.csv"]
    assert "<name>&lt;mine&gt;</name>" in files[0].read_text()
    assert navfuse.export(trajectory(), tmp_path / "other", "csv")[0].name == "trajectory.csv"
    assert navfuse.export(a_result(smoothed=False), tmp_path / "other", "kml")[0].name == "forward.kml"
    with pytest.raises(ConfigError, match="say where to write"):
        navfuse.export(trajectory(), formats="csv")


def test_a_solution_of_rtklib_brings_its_dates(tmp_path):
    path = tmp_path / "rover.pos"
    rows = [f"2024/06/24 08:20:0{k}.000 35.1 136.{k + 1} 104.5 1 9 0.01 0.01 0.02 0 0 0 0 0" for k in range(3)]
    path.write_text(
        "% GPST latitude(deg) longitude(deg) height(m) Q ns sdn(m) sde(m) sdu(m) sdne sdeu sdun age ratio\n"
    )
    path.write_text(path.read_text() + "\n".join(rows) + "\n")
    (gpx,) = navfuse.export(path, tmp_path / "out", "gpx")
    times = [point.time.isoformat() for point in gpxpy.parse(gpx.read_text()).walk(only_points=True)]
    assert times == [f"2024-06-24T08:19:4{k}+00:00" for k in (2, 3, 4)]


def test_all_files_or_none(tmp_path):
    with pytest.raises(ConfigError, match="--epoch WEEK,SECONDS"):
        navfuse.export(trajectory(), tmp_path / "out", ["csv", "pos"])
    assert not (tmp_path / "out").exists()


def test_inputs_are_not_replaced(run, tmp_path):
    events = tmp_path / "smoothed-events.csv"
    events.write_text("time_s\n1\n")
    with pytest.raises(ConfigError, match="would be replaced"):
        navfuse.export(run, tmp_path, "csv", at=events)
    write_trajectory(tmp_path / "drive.csv", trajectory())
    with pytest.raises(ConfigError, match="would be replaced"):
        navfuse.export(tmp_path / "drive.csv", tmp_path, "csv")
    assert len(pandas.read_csv(tmp_path / "drive.csv")) == 50
    for _ in range(2):  # its own exports may be replaced
        assert navfuse.export(run, run, "kml") == [run / "smoothed.kml"]
    write_result(run, a_result(), ("csv",))
    with pytest.raises(ConfigError, match="would be replaced"):
        navfuse.export(run, run, "csv")


@pytest.mark.parametrize(
    ("formats", "message"),
    [("kmz", r'no format "kmz" \(is "kml" meant\?\)'), ("shapefile", "known are kml, gpx"), ([], "at least one")],
)
def test_formats_that_there_are_not(tmp_path, formats, message):
    with pytest.raises(ConfigError, match=message):
        navfuse.export(trajectory(), tmp_path, formats)


@pytest.mark.parametrize("epoch", [(2374, -1.0), (np.nan, 0.0), (1e9, 0.0), (2374.5, 0.0)])
def test_epochs_that_are_none(tmp_path, epoch):
    with pytest.raises(ConfigError, match="GPS week number"):
        navfuse.export(trajectory(), tmp_path, "kml", epoch=epoch)


def test_sources_that_are_none(tmp_path):
    with pytest.raises(InputError, match="no forward.parquet"):
        navfuse.export(tmp_path, formats="kml")
    with pytest.raises(InputError, match="no such file"):
        navfuse.export(tmp_path / "drive.csv", formats="kml")


def test_a_run_keeps_what_can_be_written(tmp_path):
    settings = {"point": "imu", "height": "ellipsoid", "geoid": "egm96", "rate_hz": None, "name": "drive"}
    with pytest.warns(NavfuseWarning, match="KML is written without times"):
        refused = export_result(tmp_path, a_result(epoch=None), ("kml", "sbet", "tum"), **settings)
    assert list(refused) == ["sbet"]
    assert "epoch" in refused["sbet"]
    assert sorted(file.name for file in tmp_path.iterdir()) == ["smoothed.kml", "smoothed.tum"]
    refused = export_result(tmp_path, a_result(), ("kml", "gpx"), **settings | {"rate_hz": 1e-4, "point": [1.0, 0.0]})
    assert list(refused) == ["kml", "gpx"]
