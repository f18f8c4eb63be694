"""The studies of dead reckoning on their published data: the figures they stand for, and what is written."""

import numpy as np
import pytest

from navfuse.cli.app import main
from navfuse.errors import InputError
from navfuse.reproduce import STUDIES, Study, Wishes, attitude_systems, dr_gnss, lawnmower, reproduce, robot_mower
from navfuse.reproduce.drives import numbers

NAMES = ("gnss-course", "dr-gnss", "lawnmower", "robot-mower")


def study(name, shared_data):
    for folder in STUDIES[name].data.split(", "):
        if not (shared_data / folder).is_dir():
            pytest.skip(f"{folder} is not among the shared data")
    return reproduce(name, Wishes(data=shared_data))


def test_workshop_3(shared_data):
    whole = study("dr-gnss", shared_data)
    assert "Forward over the whole drive 0.289 m misses it; forward after 5 s 0.189 m meets it" in whole.notes[0]
    found = whole.numbers
    solutions = found["solutions"]
    np.testing.assert_allclose(found["gnss_offset_m"], (-7.02, 1.15, 9.58), atol=0.01)
    assert solutions["integrated, smoothed"]["horizontal_m"] <= 0.25
    assert solutions["integrated, forward"]["horizontal_settled_m"] <= 0.25
    # the first fix is 3 m off: forward nobody can know
    assert solutions["integrated, forward"]["horizontal_m"] <= solutions["GNSS alone"]["horizontal_m"]
    for name in ("integrated, forward", "integrated, smoothed"):
        assert solutions[name]["velocity_mps"] <= 0.03
    assert solutions["dead reckoning alone"]["end_m"] > 40.0
    assert max(found["largest_difference_m"].values()) < 1e-3


def test_the_robot_mower(shared_data, monkeypatch):
    monkeypatch.setattr(robot_mower, "INTERVALS_S", (10.0,))
    found = study("robot-mower", shared_data).numbers
    ten = found["intervals"]["10 s"]
    assert found["dr_end_m"] == pytest.approx(36.9, abs=0.1)
    assert ten["forward_m"] <= 0.35
    assert ten["smoothed_m"] <= 0.15
    # horizontal NIS of 194 fixes: 99.9 % bounds of 388 degrees of freedom
    assert 0.78 < ten["nis_horizontal"] < 1.25
    assert ten["forward_over_sigma"] < 1.25
    assert ten["smoothed_over_sigma"] < 1.25


def test_the_lawnmower(shared_data):
    found = study("lawnmower", shared_data)
    gross = found.numbers["gross_errors"]
    assert len(gross) == 49
    assert {one["satellite"] for one in gross} == {"7"}
    assert all(60.0 < one["error_m"] < 120.0 for one in gross)
    assert "these are the same: True" in found.tables[0].note
    north, east, _ = found.numbers["extent_m"]["integrated, smoothed"]
    assert 35.0 < north < lawnmower.LAWN_M[0]
    assert 5.0 < east < lawnmower.LAWN_M[1]
    assert 0.85 < found.numbers["nis"]["gnss_position"] < 1.2


def test_the_receiver(shared_data):
    found = study("gnss-course", shared_data).numbers
    assert max(found["largest_difference_m"]) < 1e-3
    # noise of the printed single epochs is 4.5 m
    assert found["off_printed_m"] < 10.0 / np.sqrt(3.0)


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_every_study_is_written_with_its_figures(name, shared_data, tmp_path):
    found = study(name, shared_data)
    files = found.write(tmp_path / "out")
    assert len(files) == 2 + len(found.pictures)
    assert all(path.stat().st_size > 150 for path in files)


@pytest.mark.parametrize("name", NAMES)
def test_without_data_it_says_what_to_give(name, tmp_path):
    with pytest.raises(InputError, match="with --data"):
        reproduce(name)
    with pytest.raises(InputError, match="there is no such file; --data has to name the folder"):
        reproduce(name, Wishes(data=tmp_path))


def test_damaged_data(tmp_path):
    table = tmp_path / "table.csv"
    table.write_text("1,2,3\n4,five,6\n")
    with pytest.raises(InputError, match="not a table of numbers with commas"):
        numbers(table, 3)
    table.write_text("1,2,3\n4,5,6\n")
    with pytest.raises(InputError, match="needs 7 columns of numbers; it has 3"):
        numbers(table, 7)
    for text, message in (("", "not a single row"), ("1,2,3\n4,nan,6\n", "row 2, column 2: nan is no number")):
        table.write_text(text)
        with pytest.raises(InputError, match=message):
            numbers(table, 3)
    with pytest.raises(InputError, match="not the file of the data set, with GT, DR and DRp"):
        robot_mower.read(table)
    from scipy.io import savemat

    savemat(tmp_path / "p.mat", {"GT": np.zeros((3, 4)), "DR": np.zeros((2, 3)), "DRp": np.zeros((5, 4))})
    with pytest.raises(InputError, match="do not belong together"):
        robot_mower.read(tmp_path / "p.mat")


def copied(shared_data, tmp_path):
    """Folder of the exercise in a copy of its data that may be damaged."""
    source = shared_data / "ucl-comp0130" / "workshops"
    if not source.is_dir():
        pytest.skip("the exercises are not among the shared data")
    folder = tmp_path / "ucl-comp0130" / "workshops"
    folder.mkdir(parents=True)
    (tmp_path / "groves-profiles").mkdir()
    for path in (source / "Workshop3_GNSS_Pos_Vel_NED.csv", shared_data / "groves-profiles" / "Profile_2.csv"):
        home = folder if path.parent == source else tmp_path / "groves-profiles"
        (home / path.name).write_bytes(path.read_bytes())
    return folder


def test_a_compass_in_radians_is_refused(shared_data, tmp_path):
    folder = copied(shared_data, tmp_path)
    source = shared_data / "ucl-comp0130" / "workshops"
    table = np.loadtxt(source / "Workshop3_Speed_Heading.csv", delimiter=",")
    for factors, message in (((1.0, 1.0, np.pi / 180.0), "if they are radians"), ((1.0, 3.6, 1.0), "in km/h")):
        np.savetxt(folder / "Workshop3_Speed_Heading.csv", table * factors, delimiter=",")
        with pytest.raises(InputError, match=message):
            dr_gnss.read(Wishes(data=tmp_path))


def test_a_truth_cut_short_is_refused(shared_data, tmp_path):
    source = shared_data / "ucl-comp0130" / "workshops" / "Workshop3_Speed_Heading.csv"
    folder = copied(shared_data, tmp_path)
    (folder / source.name).write_bytes(source.read_bytes())
    truth = tmp_path / "groves-profiles" / "Profile_2.csv"
    whole = truth.read_text().splitlines()
    for part in (whole[: len(whole) // 2], whole[len(whole) // 2 :]):
        truth.write_text("\n".join(part) + "\n")
        with pytest.raises(InputError, match="the truth has to cover them"):
            dr_gnss.read(Wishes(data=tmp_path))


def test_an_output_that_cannot_be_is_told_before_the_study(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("navfuse.reproduce.reproduce", lambda *given: pytest.fail("the study was run"))
    (tmp_path / "file").write_text("x")
    with pytest.raises(SystemExit) as ending:
        main(["reproduce", "gyro-magnetometer", "-o", str(tmp_path / "file")])
    assert ending.value.code == 1
    assert "is a file, not a folder" in capsys.readouterr().err


def test_runs_and_seeds_without_a_use_are_told(monkeypatch):
    plain = Study("x", "x", "x", ())
    monkeypatch.setattr(dr_gnss, "run", lambda wishes: plain)
    monkeypatch.setattr(attitude_systems, "heading", lambda wishes: plain)
    assert reproduce("dr-gnss", Wishes()).notes == ()
    (note,) = reproduce("dr-gnss", Wishes(runs=3, seed=7)).notes
    assert note.startswith("runs = 3 and seed = 7 had no effect")
    (note,) = reproduce("gyro-magnetometer", Wishes(runs=3, seed=7)).notes
    assert note.startswith("seed = 7 had no effect")
