"""``navfuse run`` with [dead_reckoning]: every source, the result folder, one message for what cannot be."""

import numpy as np
import pytest

from navfuse.cli.app import main
from navfuse.data.aiding_logs import BodyVelocityLog, HeadingLog, OdometerLog, WheelSpeedLog
from navfuse.data.logs import GnssLog
from navfuse.dead_reckoning.odometry import StartPoint, from_velocity, metres_per_radian
from navfuse.errors import NavfuseWarning
from navfuse.io.aiding_tables import write_aiding
from navfuse.io.log_tables import write_gnss
from navfuse.io.result_folder import read_result
from navfuse.io.trajectory_table import write_trajectory
from navfuse.pipeline import process

T = 0.5 * np.arange(241)
PSI = 0.3 + 0.02 * T + 0.3 * np.sin(0.05 * T)
RATE = 0.02 + 0.015 * np.cos(0.05 * T)
SPEED = 8.0 + 2.0 * np.sin(0.07 * T)
TRACK = 1.6
SOURCES = {
    "odometer": 'source = "odometer"\nfile = "odometer.csv"\nheading_file = "heading.csv"',
    "wheels with a heading": 'source = "wheels"\nfile = "wheels.csv"\nheading_file = "heading.csv"\n'
    'wheel_names = ["rear_left", "rear_right"]\nwheel_places_m = [[0.0, -0.8], [0.0, 0.8]]',
    "wheels alone": 'source = "wheels"\nfile = "wheels.csv"\nwheel_names = ["rear_left", "rear_right"]\n'
    "wheel_places_m = [[0.0, -0.8], [0.0, 0.8]]",
    "body velocity": 'source = "body-velocity"\nfile = "radar.csv"\nheading_file = "heading.csv"',
    "trajectory": 'source = "trajectory"\nfile = "track.csv"\nframe = "ecef"\nfeedback = "closed"',
}


@pytest.fixture
def folder(tmp_path):
    """Logs of one drive: perfect but for 3 % on the speeds; fixes with noise of 1 m and 0.05 m/s every second."""
    rng = np.random.default_rng(1)
    velocity = np.column_stack((SPEED * np.cos(PSI), SPEED * np.sin(PSI), np.zeros(T.size)))
    true = from_velocity(T, velocity, StartPoint(0.8, 0.2, 100.0))
    metres = metres_per_radian(true.lat, true.height)
    noise = rng.standard_normal((2, T.size, 3))
    fixes = GnssLog(
        T, true.lat + noise[0, :, 0] / metres[:, 0], true.lon + noise[0, :, 1] / metres[:, 1],
        true.height + noise[0, :, 2], np.ones((T.size, 3)), velocity + 0.05 * noise[1], np.full((T.size, 3), 0.05),
    )  # fmt: skip
    write_gnss(tmp_path / "gnss.csv", fixes.take(slice(0, None, 2)))
    measured = 1.03 * SPEED
    write_aiding(tmp_path / "odometer.csv", OdometerLog(T, measured))
    write_aiding(tmp_path / "heading.csv", HeadingLog(T, PSI % (2 * np.pi)))
    # means over the interval that ends at the stamp
    mean = np.concatenate((measured[:1], 0.5 * (measured[1:] + measured[:-1])))
    turn = np.concatenate((RATE[:1], np.diff(PSI) / 0.5))
    speeds = np.column_stack((mean + 0.5 * TRACK * turn, mean - 0.5 * TRACK * turn))
    write_aiding(tmp_path / "wheels.csv", WheelSpeedLog(T, ("rear_left", "rear_right"), speeds))
    nothing = np.full(T.size, np.nan)
    write_aiding(tmp_path / "radar.csv", BodyVelocityLog(T, np.column_stack((measured, nothing, nothing))))
    write_trajectory(tmp_path / "track.csv", from_velocity(T, 1.03 * velocity, StartPoint(0.8, 0.2, 100.0)))
    return tmp_path, true


def project(folder, source, more=""):
    text = f'[dead_reckoning]\n{source}\nvelocity_psd_m2ps3 = 0.01\n[gnss]\nfile = "gnss.csv"\n'
    text += f"[start]\nheading_deg = {np.degrees(PSI[0])}\n[output]\nrate_hz = 0.0\n{more}"
    (folder / "project.toml").write_text(text)
    return folder / "project.toml"


def run(capsys, path, out, *options):
    """Exit code and what was said."""
    with pytest.raises(SystemExit) as ending:
        main(["run", str(path), "-o", str(out), *options])
    return ending.value.code or 0, " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize("name", SOURCES)
def test_every_source_is_corrected(folder, name, tmp_path):
    home, true = folder
    result = process(project(home, SOURCES[name]))
    for best, bound in ((result.forward, 1.5), (result.smoothed, 0.6)):
        metres = metres_per_radian(true.lat, true.height)
        rows = np.searchsorted(true.time, best.time)
        error = np.column_stack((best.lat - true.lat[rows], best.lon - true.lon[rows])) * metres[rows]
        assert np.sqrt(np.mean(np.sum(error[40:] ** 2, axis=1))) < bound
    assert result.warnings == ()
    assert result.innovations.count("gnss_position", "used") == 121


def test_the_folder_is_that_of_every_run(folder, tmp_path, capsys):
    home, _ = folder
    path = project(home, SOURCES["odometer"], 'formats = ["csv"]\n[smoother]\nmethod = "rts"\n')
    code, said = run(capsys, path, tmp_path / "out")
    assert code == 0, said
    found = read_result(tmp_path / "out")
    names = {file.name for file in (tmp_path / "out").iterdir()}
    assert names == {
        "forward.csv", "smoothed.csv", "innovations.csv", "states.csv", "fixes.csv", "summary.json", "report.html",
    }  # fmt: skip
    assert found.summary["settings"]["dead_reckoning"]["source"] == "odometer"
    assert found.summary["measurements"]["gnss_velocity"]["counts"]["used"] == 121
    assert found.summary["verdict"]["warnings"] == 0
    assert "heading" in (tmp_path / "out" / "report.html").read_text().lower()
    thin = process({**_mapping(home), "output": {"rate_hz": 1.0}})
    assert len(thin.forward) == 121
    assert thin.forward.time[-1] == T[-1]
    assert process({**_mapping(home), "smoother": {"method": "none"}}).smoothed is None


def _mapping(home):
    return {
        "dead_reckoning": {"file": str(home / "odometer.csv"), "heading_file": str(home / "heading.csv")},
        "gnss": {"file": str(home / "gnss.csv")},
    }


@pytest.mark.parametrize(
    ("source", "damage", "message"),
    [
        ("odometer", "radians", "if they are radians; name the column heading_rad"),
        ("odometer", "kmph", "as if they were in km/h"),
        ("odometer", "late", "are both on one time scale"),
        ("wheels alone", "places", "are in one place"),
        ("wheels alone", "no heading", "start.heading_deg: missing; wheels without"),
        ("wheels with a heading", "late", "fewer than two epochs in common"),
        ("wheels alone", "name", "has no wheel 'left'"),
    ],
)
def test_one_message_for_what_cannot_be(folder, source, damage, message, tmp_path, capsys):
    home, _ = folder
    text = SOURCES[source]
    if damage == "radians":
        write_aiding(home / "heading.csv", HeadingLog(T, np.radians(PSI)))
    elif damage == "kmph":
        write_aiding(home / "odometer.csv", OdometerLog(T, 3.6 * SPEED))
    elif damage == "late":
        write_aiding(home / "heading.csv", HeadingLog(T + 1e4, PSI % (2 * np.pi)))
        write_aiding(home / "odometer.csv", OdometerLog(T + 1e4, SPEED))
    elif damage == "places":
        text = text.replace("-0.8", "0.8")
    elif damage == "name":
        text = text.replace("rear_left", "left")
    path = project(home, text)
    if damage == "no heading":
        path.write_text("\n".join(line for line in path.read_text().splitlines() if "heading_deg" not in line))
    code, said = run(capsys, path, tmp_path / "out", "--no-report", "--quiet")
    assert code == 1, said
    assert said.count("error: ") == 1
    assert message in said
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", [name for name in SOURCES if name != "trajectory"])
def test_a_track_before_the_first_fix_is_cut(folder, name):
    home, true = folder
    kept = _without_first_fixes(home, 40)
    with pytest.warns(NavfuseWarning, match="40.0 s before it are cut off; give start.lat_deg"):
        result = process(project(home, SOURCES[name]))
    assert kept == result.forward.time[0] == 40.0
    for best in (result.forward, result.smoothed):
        rows = np.searchsorted(true.time, best.time)
        metres = metres_per_radian(true.lat, true.height)[rows]
        error = np.column_stack((best.lat - true.lat[rows], best.lon - true.lon[rows])) * metres
        assert np.hypot(*error.T).max() < 6.0


def _without_first_fixes(home, number):
    """Time of the first fix left [s]."""
    lines = (home / "gnss.csv").read_text().splitlines()
    (home / "gnss.csv").write_text("\n".join([lines[0], *lines[1 + number :]]) + "\n")
    return float(number)


def test_a_place_to_start_from_keeps_the_whole_track(folder):
    home, _ = folder
    _without_first_fixes(home, 40)
    text = project(home, SOURCES["odometer"]).read_text()
    place = f"[start]\nlat_deg = {np.degrees(0.8)}\nlon_deg = {np.degrees(0.2)}\nheight_m = 100.0\n"
    (home / "project.toml").write_text(text.replace("[start]\n", place))
    with pytest.warns(NavfuseWarning, match="no fix was used from 0.0 s to 40.0 s"):
        result = process(home / "project.toml")
    assert not any("cut off" in warning for warning in result.warnings)
    assert result.forward.time[0] == 0.0
    assert abs(result.forward.lat[0] - 0.8) < 1e-9


def test_the_start_is_no_better_than_its_fix(folder):
    home, _ = folder
    path = project(home, SOURCES["odometer"])
    for sd, at_start in ((1.0, 10.0), (60.0, 60.0)):
        text = path.read_text().replace(
            'file = "gnss.csv"', f'file = "gnss.csv"\nsd_floor_m = {sd}\nuse = ["velocity"]'
        )
        (home / "other.toml").write_text(text)
        result = process(home / "other.toml")
        np.testing.assert_allclose(result.forward.sd_position[0], at_start, rtol=1e-6)


@pytest.mark.parametrize("source", ["wheels alone", "wheels with a heading", "body velocity"])
def test_another_unit_is_refused_from_every_source(folder, source, tmp_path, capsys):
    home, _ = folder
    for name, header in (("wheels.csv", "time"), ("radar.csv", "time")):
        head, *rows = (home / name).read_text().splitlines()
        assert head.startswith(header)
        scaled = []
        for row in rows:
            first, *cells = row.split(",")
            scaled.append(",".join([first, *(str(3.6 * float(cell)) if cell else "" for cell in cells)]))
        (home / name).write_text("\n".join([head, *scaled]) + "\n")
    code, said = run(capsys, project(home, SOURCES[source]), tmp_path / "out", "--no-report", "--quiet")
    assert code == 1, said
    assert said.count("error: ") == 1
    assert "as if they were in km/h" in said


def test_inspect_asks_for_the_logs(folder, capsys):
    home, _ = folder
    path = project(home, SOURCES["odometer"])
    with pytest.raises(SystemExit) as ending:
        main(["inspect", str(path)])
    assert ending.value.code == 1
    said = " ".join(capsys.readouterr().err.split())
    assert said.count("error: ") == 1
    assert "inspect takes its logs one by one: navfuse inspect" in said
    assert "imu" not in said
    assert said.endswith("gnss.csv")
