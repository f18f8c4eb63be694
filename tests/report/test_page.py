from __future__ import annotations

import gzip
import json
import re
from base64 import b64decode
from dataclasses import replace
from html import unescape
from html.parser import HTMLParser

import numpy as np
import pytest

from navfuse.data.result import Innovations, Result, StateHistory
from navfuse.data.trajectory import Trajectory
from navfuse.errors import InputError, OutputError
from navfuse.report.page import render, write_report

HOSTILE = "<script>alert(1)</script>\"'&<img src=x onerror=alert(2)>"
ELEMENTS_WITHOUT_END = {"meta", "input", "br", "img", "link"}


class Page(HTMLParser):
    """Elements, attributes and texts of a page, with a check that what opens also closes."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.elements, self.texts, self.open = [], [], []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag not in ELEMENTS_WITHOUT_END:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] not in ("script", "style"):
            self.texts.append(data)

    def all(self, tag):
        return [attributes for name, attributes in self.elements if name == tag]


def packed(text, identity):
    """What the page unpacks in the browser."""
    content = re.search(rf'<script id="{identity}" type="application/gzip">([^<]*)</script>', text)
    return gzip.decompress(b64decode(content[1])).decode()


def floats(text):
    return np.frombuffer(b64decode(text), dtype="<f4")


def panels(text):
    return {panel["title"]: panel for panel in json.loads(packed(text, "data"))["panels"]}


def curve(text, title, row, name):
    return next(found for found in panels(text)[title]["rows"][row]["curves"] if found["name"] == name)


@pytest.fixture(scope="module")
def page(drive):
    return render(*drive, title="A drive", skip_s=20.0)


def test_nothing_is_loaded_from_elsewhere(page):
    found = Page(page)
    for _, attributes in found.elements:
        assert not {"src", "srcset", "action", "formaction", "data"} & set(attributes)
    assert all(attributes["href"].startswith("#") for attributes in found.all("a"))
    assert found.all("link") == []
    style = re.search(r"<style>(.*?)</style>", page, re.S)[1]
    assert "url(" not in style
    assert "@import" not in style
    policy = next(a["content"] for a in found.all("meta") if a.get("http-equiv") == "Content-Security-Policy")
    assert policy.startswith("default-src 'none';")
    assert "http" not in policy


def test_the_plotting_library_is_inside_once(page):
    assert "plotly.js v" in packed(page, "plotly")[:200]
    assert page.count('id="plotly"') == 1
    assert len(page) < 4_000_000


def test_head_is_readable_without_scripts(page):
    texts = " ".join(Page(page).texts)
    for expected in (
        "A drive",
        "Usable, but look at the points below",
        "3 rejected, 20 withheld",
        "the first 20 s left out",
    ):
        assert expected in texts
    for expected in ("position horizontal [m]", "consistent", "filter.frame", "GNSS log: 3 rows have no sigma"):
        assert expected in texts


def test_every_panel_has_a_place_and_every_link_a_target(page):
    found = Page(page)
    places = [int(attributes["data-panel"]) for attributes in found.all("div") if "data-panel" in attributes]
    assert places == list(range(len(panels(page))))
    identities = {attributes["id"] for _, attributes in found.elements if "id" in attributes}
    assert {attributes["href"][1:] for attributes in found.all("a")} <= identities
    script = re.findall(r'getElementById\("(\w+)"\)', page)
    assert set(script) <= identities
    labels = [attributes["aria-label"] for attributes in found.all("div") if attributes.get("role") == "img"]
    assert len(labels) == len(places) + 1
    assert all(labels)


def test_every_axis_has_a_unit(page):
    for panel in panels(page).values():
        for row in panel["rows"]:
            assert row["label"]
            assert row["unit"] in ("m", "m/s", "deg", "deg/h", "mg", "ppm", "1")
            assert row["curves"]


def test_errors_and_envelopes_are_those_of_the_result(page, drive):
    result, truth = drive
    title = "Position errors against truth"
    error = curve(page, title, 2, "filter")
    expected = truth.height - result.forward.height
    np.testing.assert_allclose(floats(error["y"]), expected, atol=1e-4)
    np.testing.assert_allclose(floats(error["x"]), truth.time - 1000.0, atol=1e-4)
    band = curve(page, title, 2, "filter ±3σ")
    np.testing.assert_allclose(floats(band["y2"]), 3.0 * result.forward.sd_position[:, 2], rtol=1e-6)
    np.testing.assert_array_equal(floats(band["y"]), -floats(band["y2"]))
    names = [found["name"] for found in panels(page)[title]["rows"][0]["curves"]]
    assert names == ["filter ±3σ", "smoother ±3σ", "filter", "smoother"]


def test_units_are_converted_for_people(page, drive):
    states = drive[0].states
    bias = floats(curve(page, "Estimated gyro bias", 0, "filter")["y"])[-1]
    assert bias == pytest.approx(np.degrees(states["gyro_bias"].values[-1, 0]) * 3600.0, rel=1e-6)
    accel = floats(curve(page, "Estimated accel bias", 2, "filter")["y"])[-1]
    assert accel == pytest.approx(states["accel_bias"].values[-1, 2] / 9.80665e-3, rel=1e-6)
    sigma = floats(curve(page, "Expected attitude error", 2, "smoother")["y"])
    np.testing.assert_allclose(sigma, 0.3, rtol=1e-5)


def test_measurements_are_drawn_by_status(page):
    drawn = {found["name"]: floats(found["y"]).size for found in panels(page)["Consistency (NIS)"]["rows"][0]["curves"]}
    assert drawn == {"used": 96, "rejected": 3, "withheld": 20, "99 % lie below": 2}
    rejected = floats(curve(page, "Innovations: gnss position", 0, "rejected")["y"])
    assert (np.abs(rejected) > 5.0).all()
    data = json.loads(packed(page, "data"))
    assert {cloud["name"]: floats(cloud["e"]).size for cloud in data["map"]["clouds"]} == {
        "fixes used": 96,
        "fixes rejected": 3,
        "fixes withheld": 20,
    }
    assert [track["role"] for track in data["map"]["tracks"]] == ["forward", "smoothed", "truth"]
    assert data["shading"] == [[59.0, 80.0]]


def test_spikes_survive_the_thinning(make_drive):
    result, truth = make_drive(900.0, 10.0)
    height = result.forward.height.copy()
    height[4321] += 55.0
    page = render(replace(result, forward=replace(result.forward, height=height)), truth)
    error = floats(curve(page, "Position errors against truth", 2, "filter")["y"])
    assert error.size <= 2000
    assert error.min() == pytest.approx(truth.height[4321] - height[4321], abs=1e-3)
    for panel in panels(page).values():
        for row in panel["rows"]:
            assert all(floats(found["y"]).size <= 2000 for found in row["curves"])


def test_nothing_from_outside_becomes_markup(drive):
    result, truth = drive
    records = replace(result.innovations, source=np.full(len(result.innovations), HOSTILE))
    hostile = replace(
        result,
        innovations=records,
        states={HOSTILE: result.states["gyro_bias"]},
        summary={HOSTILE: [HOSTILE, {"key": HOSTILE}]},
        warnings=(HOSTILE,),
    )
    page = render(hostile, truth, title=HOSTILE)
    plain = render(result, truth)
    count = {tag: len(Page(page).all(tag)) for tag in ("script", "img")}
    assert count == {"script": len(Page(plain).all("script")), "img": 0}
    assert not any(name.startswith("on") for _, attributes in Page(page).elements for name in attributes)
    texts = " ".join(Page(page).texts)
    assert texts.count(HOSTILE) >= 5
    assert unescape(re.search(r"<title>(.*?)</title>", page)[1]) == HOSTILE
    assert f"Innovations: {HOSTILE}" in panels(page)


def test_without_truth_there_are_no_errors(drive):
    page = render(drive[0])
    assert "Errors against truth" not in page
    assert not any("against truth" in title for title in panels(page))


def bare_trajectory(n=2):
    return Trajectory(np.arange(float(n)), np.full(n, 0.8), np.full(n, 0.2), np.zeros(n))


def late_only():
    nothing = np.full((1, 3), np.nan)
    text, number = np.array(["late"]), np.array([0])
    return Innovations(np.zeros(1), np.array(["odometer"]), text, np.array([np.nan]), number, nothing, nothing, number)


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"smoothed": bare_trajectory()},
        {"innovations": late_only()},
        {"states": {"clock": StateHistory(np.arange(2.0), np.zeros((2, 2)), np.ones((2, 2)))}},
    ],
)
def test_a_result_with_little_in_it_still_has_a_page(changes):
    result = Result(bare_trajectory(), **changes)
    page = render(result)
    assert "No GNSS position was used" in page
    assert next(iter(panels(page))) == "Height, speed and attitude"
    assert all(panel["rows"] for panel in panels(page).values())
    assert json.loads(packed(page, "data"))["shading"] == []
    Page(render(result, bare_trajectory()))


def test_all_fixes_rejected(drive):
    records = drive[0].innovations
    page = render(replace(drive[0], innovations=replace(records, status=np.full(119, "rejected"))))
    assert "Do not rely on this run" in page
    assert json.loads(packed(page, "data"))["shading"] == [[0.0, 120.0]]


def test_a_single_fix(drive):
    records = drive[0].innovations.select(np.array([40]))
    page = render(replace(drive[0], innovations=records, warnings=()))
    assert "nothing to test" not in page
    assert json.loads(packed(page, "data"))["shading"] == [[41.0, 120.0], [0.0, 41.0]]


def test_other_sensors_have_their_own_panels(drive):
    result = drive[0]
    single = result.innovations.select(np.arange(10))
    padded = np.full((10, 3), np.nan)
    z, sd = padded.copy(), padded.copy()
    z[:, 0], sd[:, 0] = 0.1, 0.2
    odometer = replace(
        single, source=np.full(10, "odometer"), dof=np.ones(10, dtype=int), z=z, sd=sd, nis=np.full(10, 0.25)
    )
    found = panels(render(replace(result, innovations=odometer)))["Innovations: odometer"]
    assert [(row["label"], row["unit"]) for row in found["rows"]] == [("z1", "sensor unit")]


def test_the_file_appears_whole(drive, tmp_path):
    path = write_report(tmp_path / "report.html", *drive, title="A drive")
    assert path == tmp_path / "report.html"
    assert path.read_text(encoding="utf-8").endswith("</html>\n")
    assert [entry.name for entry in tmp_path.iterdir()] == ["report.html"]


def test_a_folder_that_is_not_there(drive, tmp_path):
    with pytest.raises(OutputError, match=r"no-such-folder"):
        write_report(tmp_path / "no-such-folder" / "report.html", *drive)


def test_a_truth_of_another_time(drive):
    result, truth = drive
    with pytest.raises(InputError, match="have no time in common"):
        render(result, replace(truth, time=truth.time + 1e6))


def test_the_same_result_gives_the_same_page(drive):
    assert render(*drive) == render(*drive)
