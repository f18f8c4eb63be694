from __future__ import annotations

import inspect
from dataclasses import replace

import pytest

from navfuse.cli.export import export
from navfuse.io.exports import EXTENSIONS
from navfuse.io.result_folder import write_result


@pytest.fixture
def run_folder(tmp_path, result):
    folder = tmp_path / "run"
    folder.mkdir()
    write_result(folder, replace(result, summary={"measurements": {}}))
    return folder


def test_files_are_named(navfuse, run_folder, tmp_path):
    code, out, err = navfuse(
        "export", run_folder, "--format", "kml,gpx", "-f", "csv", "-o", tmp_path / "out", "--point", "0.5,0,-1",
        "--epoch", "2374,243258", "--rate-hz", "1",
    )  # fmt: skip
    assert code == 0
    assert err.startswith("warning: ")
    assert "epochs are 1 s apart" in err
    assert err.count("\n") == 1
    assert out.split() == [str(tmp_path / "out" / f"forward.{name}") for name in ("kml", "gpx", "csv")]
    assert "Point: 0.5 m forward, 0 m right, -1 m down of the IMU" in (tmp_path / "out" / "forward.gpx").read_text()


def test_events_and_a_note_of_missing_dates(navfuse, run_folder, tmp_path):
    events = tmp_path / "events.csv"
    events.write_text("time_s,label\n1.5,one\n99,late\n")
    code, out, err = navfuse("convert", run_folder, "-f", "gpx", "--at", events, "--quiet")
    assert (code, out) == (0, "")
    assert "1 of 2 events" in err
    assert "'late' at 99.000 s" in err
    assert "GPX is written without times" in err
    assert "<name>one</name>" in (run_folder / "exports" / "forward-events.gpx").read_text()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["-f", "kml", "--point", "roof"], "--point roof: has to be imu, antenna, or three numbers F,R,D [m]"),
        (["-f", "kml", "--point", "1,2"], "--point 1,2"),
        (["-f", "kml", "--point", "1,2,nan"], "--point 1,2,nan"),
        (["-f", "kml", "--epoch", "2374"], "--epoch 2374: has to be two numbers WEEK,SECONDS"),
        (["-f", "kml", "--epoch", "nan,0"], "--epoch nan,0"),
        (["-f", "kml", "--epoch", "2374,604801"], "seconds of the week"),
        (["-f", "kmz"], 'no format "kmz"'),
        (["-f", ","], "at least one"),
        (["-f", "pos"], "--epoch WEEK,SECONDS"),
        (["-f", "kml", "--height", "msl"], 'height = "msl"'),
        (["-f", "kml", "--geoid", "egm84"], 'no geoid "egm84"'),
        (["-f", "kml", "--solution", "smoothed"], "no smoothed trajectory"),
        (["-f", "kml", "--rate-hz", "-1"], "rate_hz = -1"),
        (["-f", "kml", "--at", "nowhere.csv"], "no such file"),
    ],
)
def test_one_message_and_exit_code_1(navfuse, run_folder, arguments, message):
    code, out, err = navfuse("export", run_folder, *arguments)
    assert (code, out) == (1, "")
    assert message in err
    assert "Traceback" not in err
    assert not (run_folder / "exports").exists()


def test_antenna_of_a_run_without_settings(navfuse, run_folder):
    code, _, err = navfuse("export", run_folder, "-f", "kml", "--point", "antenna")
    assert code == 1
    assert "three numbers" in err


def test_no_format_is_wrong_usage(navfuse, run_folder):
    assert navfuse("export", run_folder)[0] == 2


def test_the_help_names_every_format():
    assert f"{', '.join(EXTENSIONS)}." in inspect.getsource(export)
