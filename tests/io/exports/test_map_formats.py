"""KML, GPX, GeoJSON and CSV read back by others' readers: numbers to a millimetre, times, names however hostile."""

from __future__ import annotations

import json
import warnings
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from importlib.resources import files

import gpxpy
import numpy as np
import pandas
import pytest
from lxml import etree

from navfuse.data.export_track import ExportTrack
from navfuse.data.gps_epoch import GpsEpoch
from navfuse.data.trajectory import Trajectory
from navfuse.errors import InputError, NavfuseWarning, OutputError
from navfuse.io.exports import EXTENSIONS, known_formats, write_track
from navfuse.io.exports.pieces import cut_at_antimeridian, gapless, quality
from navfuse.io.exports.text import xml_text
from navfuse.io.trajectory_table import read_trajectory

KML = {"k": "http://www.opengis.net/kml/2.2", "gx": "http://www.google.com/kml/ext/2.2"}
MAPS = ("kml", "gpx", "geojson", "csv")
EPOCH = GpsEpoch(2374, 243258.25)
FIRST = datetime(1980, 1, 6, tzinfo=UTC) + timedelta(weeks=2374, seconds=243258.25 - 18.0)
HOSTILE = [
    "<script>alert('x')</script>",
    "]]>",
    "a\nb\tc",
    "Zürich → 東京 😀",
    'say "&" & <b>',
    "nul\0bell\x07",
    "half \ud83d",
]
MILLIMETRE = 1e-3 / 6378137.0


def make(n=60, hz=10.0, lat_deg=47.1, lon_deg=8.5, step=1e-5, whole=True, **more) -> ExportTrack:
    time = np.arange(n) / hz
    lon = np.radians((lon_deg + step * np.arange(n) + 180.0) % 360.0 - 180.0)
    trajectory = Trajectory(time, np.radians(np.full(n, lat_deg) + 0.3e-5 * np.sin(time)), lon, 440.0 + np.cos(time))
    if whole:
        triad = np.arange(3.0 * n).reshape(n, 3) / n
        sd = np.abs(np.sin(np.arange(n) / 9.0))[:, None] * [1.0, 2.0, 3.0]
        trajectory = replace(
            trajectory,
            velocity_n=triad,
            attitude=0.1 * triad,
            sd_position=sd,
            sd_velocity=0.1 * sd,
            sd_attitude=0.01 * sd,
        )
    settings = {
        "epoch": EPOCH,
        "undulation": np.full(n, 47.25) + 1e-3 * time,
        "name": "drive",
        "point": "antenna",
    } | more
    return ExportTrack(trajectory, **settings)


def written(folder, format_, track):
    path = folder / f"track{EXTENSIONS[format_]}"
    with warnings.catch_warnings():
        if track.epoch is None:
            warnings.simplefilter("ignore", NavfuseWarning)
        write_track(format_, path, track)
    return path


@pytest.fixture(scope="module", name="schema")
def _schema():
    """OGC KML 2.2 with Google's extension, as the package pykml carries them."""
    return etree.XMLSchema(etree.parse(str(files("pykml") / "schemas" / "kml22gx.xsd")))


def valid_kml(schema, path):
    document = etree.parse(str(path))
    schema.assertValid(document)
    return document.getroot()


def texts(root, path):
    return [element.text for element in root.iterfind(path, KML)]


def test_kml_track(tmp_path, schema):
    track = make()
    root = valid_kml(schema, written(tmp_path, "kml", track))
    coordinates = np.array([line.split() for line in texts(root, ".//gx:Track/gx:coord")], dtype=float)
    np.testing.assert_allclose(np.radians(coordinates[:, 0]), track.trajectory.lon, atol=MILLIMETRE)
    np.testing.assert_allclose(np.radians(coordinates[:, 1]), track.trajectory.lat, atol=MILLIMETRE)
    np.testing.assert_allclose(coordinates[:, 2], track.trajectory.height - track.undulation, atol=1e-4)
    stamps = [datetime.fromisoformat(text) for text in texts(root, ".//gx:Track/k:when")]
    assert stamps == [FIRST + timedelta(milliseconds=100 * k) for k in range(60)]
    headings = [float(text.split()[0]) for text in texts(root, ".//gx:angles")]
    np.testing.assert_allclose(headings, np.degrees(track.trajectory.attitude[:, 2]), atol=1e-4)
    assert set(texts(root, ".//k:altitudeMode")) == {"absolute"}
    assert "above the geoid" in texts(root, "k:Document/k:description")[0]


def test_kml_lines_show_the_quality_and_leave_nothing_out(tmp_path, schema):
    track = make()
    root = valid_kml(schema, written(tmp_path, "kml", track))
    styles = {
        style.get("id"): style.findtext("k:LineStyle/k:color", namespaces=KML)
        for style in root.iter(f"{{{KML['k']}}}Style")
    }
    kind, segments, placemarks = quality(track), 0, root.findall(".//k:Placemark[k:MultiGeometry]", KML)
    for placemark in placemarks:
        index = int(placemark.findtext("k:styleUrl", namespaces=KML).removeprefix("#q"))
        assert f"q{index}" in styles
        for line in texts(placemark, ".//k:coordinates"):
            rows = np.array([row.split(",") for row in line.split()], dtype=float)
            first = int(np.argmin(np.abs(np.degrees(track.trajectory.lon) - rows[0, 0])))
            np.testing.assert_array_equal(kind[first : first + len(rows) - 1], index)
            segments += len(rows) - 1
    assert segments == len(track.trajectory) - 1
    assert len(placemarks) == len(set(kind[:-1].tolist())) >= 3
    assert styles["q4" if 4 in kind else "q3"] in ("ff2730d7", "ff598dfc")


def test_kml_without_sd_or_dates(tmp_path, schema):
    path = tmp_path / "track.kml"
    with pytest.warns(NavfuseWarning, match="KML is written without times.*gnss.epoch_week_s.*--epoch"):
        write_track("kml", path, make(whole=False, epoch=None, undulation=None))
    root = valid_kml(schema, path)
    assert not root.findall(".//gx:Track", KML)
    assert not root.findall(".//k:when", KML)
    assert texts(root, ".//k:Placemark[k:MultiGeometry]/k:name") == ["expected error unknown"]
    assert "above the WGS 84 ellipsoid" in texts(root, "k:Document/k:description")[0]


def test_kml_of_a_long_track_has_few_points(tmp_path, schema):
    root = valid_kml(schema, written(tmp_path, "kml", make(n=3456)))
    assert 500 < len(root.findall(".//k:Point", KML)) <= 1000
    assert len(root.findall(".//gx:coord", KML)) == 3456


@pytest.mark.parametrize("label", HOSTILE)
def test_hostile_names(tmp_path, schema, label):
    n = 3
    shown = label.translate({0: 0xFFFD, 7: 0xFFFD, 0xD83D: 0xFFFD})
    track = make(n=n, name=label, labels=np.array([label, "b", "c"]), fix=np.array([label, "x", "none"]))
    root = valid_kml(schema, written(tmp_path, "kml", track))
    assert texts(root, "k:Document/k:name") == [shown]
    assert texts(root, ".//k:Placemark/k:name") == [shown, "b", "c"]
    gpx = gpxpy.parse(written(tmp_path, "gpx", track).read_text(encoding="utf-8"))
    assert [point.name for point in gpx.waypoints] == [shown.strip(), "b", "c"]
    features = json.loads(written(tmp_path, "geojson", track).read_text(encoding="utf-8"))["features"]
    assert [feature["properties"]["label"] for feature in features] == [label, "b", "c"]
    assert features[0]["properties"]["fix"] == label
    if "half" not in label:
        table = pandas.read_csv(written(tmp_path, "csv", track))
        assert table["label"].tolist() == [label, "b", "c"]


def test_xml_text():
    assert xml_text("a<b>&\"'") == "a&lt;b&gt;&amp;&quot;'"
    assert xml_text("\x00\ufffe\ud800\U0001f600") == "\ufffd\ufffd\ufffd\U0001f600"


def test_gpx_track(tmp_path):
    fix = np.array(["rtk-fixed", "single", "none", "odd one"])[np.arange(60) % 4]
    track = make(fix=fix, n_satellites=np.arange(60))
    gpx = gpxpy.parse(written(tmp_path, "gpx", track).read_text(encoding="utf-8"))
    assert (gpx.version, gpx.name, gpx.tracks[0].name, len(gpx.tracks[0].segments)) == ("1.1", "drive", "drive", 1)
    points = gpx.tracks[0].segments[0].points
    np.testing.assert_allclose(np.radians([p.latitude for p in points]), track.trajectory.lat, atol=MILLIMETRE)
    np.testing.assert_allclose(np.radians([p.longitude for p in points]), track.trajectory.lon, atol=MILLIMETRE)
    np.testing.assert_allclose([p.elevation for p in points], track.trajectory.height - track.undulation, atol=1e-4)
    np.testing.assert_allclose([p.geoid_height for p in points], track.undulation, atol=1e-3)
    assert [p.time for p in points] == [FIRST + timedelta(milliseconds=100 * k) for k in range(60)]
    assert [p.type_of_gpx_fix for p in points[:4]] == ["dgps", "3d", "none", None]
    assert [p.satellites for p in points] == list(range(60))


def test_gpx_without_dates(tmp_path):
    path = tmp_path / "track.gpx"
    with pytest.warns(NavfuseWarning, match="GPX is written without times"):
        write_track("gpx", path, make(epoch=None))
    gpx = gpxpy.parse(path.read_text())
    assert {point.time for point in gpx.walk(only_points=True)} == {None}


def test_order_of_the_children_of_a_gpx_point(tmp_path):
    """The schema wants a sequence (``wptType``): ele, time, geoidheight, name, fix, sat."""
    track = make(n=2, labels=np.array(["a", "b"]), fix=np.array(["single", "single"]), n_satellites=np.array([7, 8]))
    root = ElementTree.parse(written(tmp_path, "gpx", track)).getroot()
    point = root.find("{*}wpt")
    names = [child.tag.rpartition("}")[2] for child in point]
    assert names == ["ele", "time", "geoidheight", "name", "fix", "sat"]


def test_geojson_track(tmp_path):
    track = make(n_satellites=np.arange(60), fix=np.full(60, "ppp"))
    collection = json.loads(written(tmp_path, "geojson", track).read_text())
    line, *points = collection["features"]
    assert line["geometry"]["type"] == "LineString"
    assert line["properties"]["point"] == "antenna"
    for coordinates in (line["geometry"]["coordinates"], [point["geometry"]["coordinates"] for point in points]):
        lon, lat, height = np.array(coordinates).T
        np.testing.assert_allclose(np.radians(lon), track.trajectory.lon, atol=MILLIMETRE)
        np.testing.assert_allclose(np.radians(lat), track.trajectory.lat, atol=MILLIMETRE)
        np.testing.assert_allclose(height, track.trajectory.height, atol=1e-4)
    table = pandas.DataFrame([point["properties"] for point in points])
    for name, column in track.trajectory.to_columns().items():
        if name not in ("lat_deg", "lon_deg", "height_m"):
            np.testing.assert_allclose(table[name], column, atol=6e-5, err_msg=name)
    np.testing.assert_allclose(table["above_geoid_m"], track.trajectory.height - track.undulation, atol=1e-4)
    assert table["fix"].tolist() == ["ppp"] * 60
    assert datetime.fromisoformat(table["utc"][10]) == FIRST + timedelta(seconds=1)
    with pytest.warns(NavfuseWarning, match="GeoJSON is written without times"):
        write_track("geojson", tmp_path / "undated.geojson", make(epoch=None))
    assert "utc" not in (tmp_path / "undated.geojson").read_text()


@pytest.mark.parametrize("format_", MAPS)
def test_blocks_join_without_seam(tmp_path, format_, monkeypatch):
    """A file made of many blocks of rows is that made of one."""
    track = make(n=60)
    whole = written(tmp_path, format_, track).read_bytes()
    monkeypatch.setattr("navfuse.io.exports.text.ROWS", 7)
    assert written(tmp_path, format_, track).read_bytes() == whole


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_date_line(tmp_path, schema, direction):
    track = make(n=40, lon_deg=180.0 * direction - 20.5e-5 * direction, step=1e-5 * direction)
    collection = json.loads(written(tmp_path, "geojson", track).read_text())
    geometry = collection["features"][0]["geometry"]
    assert geometry["type"] == "MultiLineString"
    first, second = (np.array(line) for line in geometry["coordinates"])
    assert (first[-1, 0], second[0, 0]) == (180.0 * direction, -180.0 * direction)
    np.testing.assert_array_equal(first[-1, 1:], second[0, 1:])
    assert len(first) + len(second) == 42
    assert max(np.abs(np.diff(line[:, 0])).max() for line in (first, second)) < 2e-5
    root = valid_kml(schema, written(tmp_path, "kml", track))
    for line in texts(root, ".//k:LineString/k:coordinates"):
        lon = np.array([float(row.split(",")[0]) for row in line.split()])
        assert np.abs(np.diff(lon)).max() < 2e-5
    longitudes = [p.longitude for p in gpxpy.parse(written(tmp_path, "gpx", track).read_text()).walk(only_points=True)]
    assert -180.0 <= min(longitudes) < max(longitudes) < 180.0


def test_half_a_turn_exactly_is_written_as_gpx_wants_it(tmp_path):
    track = make(n=1, lon_deg=0.0)
    for lon in (np.pi, np.pi - 1e-13, -np.pi):
        placed = replace(track, trajectory=replace(track.trajectory, lon=np.array([lon])))
        gpx = gpxpy.parse(written(tmp_path, "gpx", placed).read_text())
        assert [p.longitude for p in gpx.walk(only_points=True)] == [-180.0]


def test_cutting():
    lines = cut_at_antimeridian(np.array([179.0, -178.0, -177.0, 179.0]), np.zeros(4), np.array([0.0, 3.0, 4.0, 8.0]))
    expected = [
        [(179.0, 0.0, 0.0), (180.0, 0.0, 1.0)],
        [(-180.0, 0.0, 1.0), (-178.0, 0.0, 3.0), (-177.0, 0.0, 4.0), (-180.0, 0.0, 7.0)],
        [(180.0, 0.0, 7.0), (179.0, 0.0, 8.0)],
    ]
    for line, points in zip(lines, expected, strict=True):
        np.testing.assert_allclose(line, points, atol=1e-12)
    np.testing.assert_array_equal(cut_at_antimeridian(np.array([5.0]), np.zeros(1), np.zeros(1))[0], [[5.0, 0.0, 0.0]])
    over_pole = cut_at_antimeridian(np.array([10.0, -170.0]), np.array([89.9, 89.9]), np.zeros(2))
    assert len(over_pole) == 1
    to_the_line = cut_at_antimeridian(np.array([180.0, -179.0]), np.zeros(2), np.zeros(2))
    np.testing.assert_allclose(to_the_line[-1][:, 0], [-180.0, -179.0])


@pytest.mark.parametrize("format_", MAPS)
@pytest.mark.parametrize("lat_deg", [-90.0, 89.9999999])
def test_poles(tmp_path, schema, format_, lat_deg):
    track = make(n=4)
    track = replace(track, trajectory=replace(track.trajectory, lat=np.full(4, np.radians(lat_deg))))
    path = written(tmp_path, format_, track)
    if format_ == "kml":
        valid_kml(schema, path)
    if format_ == "gpx":
        assert abs(next(gpxpy.parse(path.read_text()).walk(only_points=True)).latitude) == pytest.approx(abs(lat_deg))


@pytest.mark.parametrize("format_", MAPS)
@pytest.mark.parametrize("whole", [True, False])
def test_one_epoch(tmp_path, schema, format_, whole):
    path = written(tmp_path, format_, make(n=1, whole=whole))
    if format_ == "kml":
        valid_kml(schema, path)
    if format_ == "gpx":
        assert len(list(gpxpy.parse(path.read_text()).walk())) == 1
    if format_ == "geojson":
        assert [f["geometry"]["type"] for f in json.loads(path.read_text())["features"]] == ["Point"]
    if format_ == "csv":
        assert len(pandas.read_csv(path)) == 1


def test_gaps_end_lines(tmp_path, schema):
    track = make()
    time = track.trajectory.time + np.where(np.arange(60) >= 30, 20.0, 0.0) + np.where(np.arange(60) >= 59, 20.0, 0.0)
    track = replace(track, trajectory=replace(track.trajectory, time=time))
    assert gapless(track) == [slice(0, 30), slice(30, 59), slice(59, 60)]
    root = valid_kml(schema, written(tmp_path, "kml", track))
    assert [len(one.findall("gx:coord", KML)) for one in root.iterfind(".//gx:Track", KML)] == [30, 29, 1]
    segments = gpxpy.parse(written(tmp_path, "gpx", track).read_text()).tracks[0].segments
    assert [len(segment.points) for segment in segments] == [30, 29, 1]
    geometry = json.loads(written(tmp_path, "geojson", track).read_text())["features"][0]["geometry"]
    assert [len(line) for line in geometry["coordinates"]] == [30, 29]


def test_csv_is_the_native_table_with_more(tmp_path):
    track = make(labels=np.array([f"p{k}" for k in range(60)]), fix=np.full(60, "ppp"), n_satellites=np.arange(60))
    path = written(tmp_path, "csv", track)
    again = read_trajectory(path)
    for name, column in track.trajectory.to_columns().items():
        np.testing.assert_allclose(again.to_columns()[name], column, rtol=1e-15, atol=1e-15, err_msg=name)
    table = pandas.read_csv(path)
    assert list(table.columns[-6:]) == ["undulation_m", "above_geoid_m", "label", "utc", "fix", "n_satellites"]
    np.testing.assert_allclose(table["above_geoid_m"], track.trajectory.height - track.undulation)
    assert pandas.to_datetime(table["utc"])[10] == pandas.Timestamp(FIRST + timedelta(seconds=1))
    undated = pandas.read_csv(written(tmp_path, "csv", make(epoch=None, undulation=None)))
    assert list(undated.columns) == list(track.trajectory.to_columns())


def test_events_between_milliseconds_keep_their_microseconds(tmp_path):
    track = make(n=2, labels=np.array(["a", "b"]))
    track = replace(track, trajectory=replace(track.trajectory, time=np.array([0.1234561, 1.5])))
    stamps = [p.time for p in gpxpy.parse(written(tmp_path, "gpx", track).read_text()).waypoints]
    assert stamps == [FIRST + timedelta(microseconds=123456), FIRST + timedelta(seconds=1.5)]


def test_leap_second_is_a_valid_time(tmp_path, schema):
    """The last second of 2016 was 23:59:60; no dateTime of XML is that."""
    before = GpsEpoch(1930, 0.0)  # 2017-01-01 00:00:00 GPS time
    time = np.array([16.5, 17.5, 18.5])
    track = make(n=3, epoch=before)
    track = replace(track, trajectory=replace(track.trajectory, time=time))
    root = valid_kml(schema, written(tmp_path, "kml", track))
    stamps = texts(root, ".//gx:Track/k:when")
    assert stamps == ["2016-12-31T23:59:59.500Z", "2017-01-01T00:00:00.500Z", "2017-01-01T00:00:00.500Z"]


@pytest.mark.parametrize("format_", MAPS)
def test_no_number_no_file(tmp_path, format_):
    track = make()
    track.trajectory.height[7] = np.nan
    path = tmp_path / f"track{EXTENSIONS[format_]}"
    with pytest.raises(InputError, match=r"epoch 8 .*height is not a number"):
        write_track(format_, path, track)
    with pytest.raises(InputError, match="no epoch to write"):
        write_track(format_, path, make(n=0))
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(OutputError):
        write_track(format_, tmp_path / "nowhere" / f"track{EXTENSIONS[format_]}", make())


def test_known_formats():
    assert known_formats(("kml", "gpx", "kml")) == ("kml", "gpx")
