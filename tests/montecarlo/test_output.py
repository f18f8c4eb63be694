from __future__ import annotations

import json

import numpy as np
import pyarrow.parquet
import pytest
from scipy.stats import chi2

from navfuse.errors import ConfigError, OutputError
from navfuse.montecarlo import SimulatedRecipe, describe, montecarlo
from navfuse.montecarlo.output import FILES
from reference.montecarlo_recipes import SHORT, EverySecondBreaks, interrupted_at_five


def read(path):
    return pyarrow.parquet.read_table(path).to_pandas()


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    folder = tmp_path_factory.mktemp("campaign") / "out"
    recipe = SimulatedRecipe("car", duration=20.0, imu_rate=20.0, scale_states=False, smooth=True)
    return folder, *montecarlo(recipe, folder, 6, jobs=1, settle_s=5.0)


def test_everything_promised_is_there(campaign):
    folder = campaign[0]
    assert sorted(entry.name for entry in folder.iterdir()) == sorted(FILES)
    for name in ("nees.png", "nis.png", "rmse.png", "rmse_smoother.png", "nees_smoother.png"):
        assert (folder / name).read_bytes().startswith(b"\x89PNG")


def test_the_table_of_all_runs(campaign):
    folder, runs, _ = campaign
    table = read(folder / "runs.parquet")
    assert len(table) == 6 * 21
    assert sorted(table.seed.unique()) == [0, 1, 2, 3, 4, 5]
    record = runs.runs[2]
    rows = table[table.seed == 2]
    np.testing.assert_allclose(rows.time_s, record.time)
    np.testing.assert_allclose(rows.nees_whole_state, record.nees["whole state"])
    np.testing.assert_allclose(rows.err_heading_deg, np.degrees(record.error[:, 8]))
    np.testing.assert_allclose(rows.sd_gyro_bias_z_dph, np.degrees(record.sd[:, 11]) * 3600.0)
    np.testing.assert_allclose(rows.smoothed_err_north_m, record.smoothed_error[:, 0])


def test_the_averages_can_be_made_again_from_the_runs(campaign):
    folder = campaign[0]
    runs, averages = read(folder / "runs.parquet"), read(folder / "nees.parquet")
    attitude = averages[(averages.kind == "nees") & (averages.name == "attitude")]
    for estimator, column in (("filter", "nees_attitude"), ("smoother", "smoothed_nees_attitude")):
        entry = attitude[attitude.estimator == estimator]
        np.testing.assert_allclose(entry.mean_per_dof, runs.groupby("time_s")[column].mean().to_numpy() / 3.0)
    np.testing.assert_allclose(entry.high_99, chi2.ppf(0.995, 18) / 18)
    nis = read(folder / "nis.parquet")
    nis = nis[nis.source == "gnss_position"].groupby("time_s").nis.mean().to_numpy() / 3.0
    np.testing.assert_allclose(averages[averages.name == "gnss_position"].mean_per_dof, nis)


def test_the_summary(campaign):
    folder, _, assessments = campaign
    found = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert found["recipe"]["name"] == "car"
    assert found["recipe"]["scale_states"] is False
    assert found["runs"] == {"wanted": 6, "finished": 6, "failed": {}, "interrupted": False, "first_seed": 0}
    assert found["untested_states"] == []
    assert found["filter"]["verdict"] == assessments["filter"].verdict
    assert list(found["filter"]["nees"]) == [
        "position",
        "velocity",
        "attitude",
        "gyro_bias",
        "accel_bias",
        "whole state",
    ]
    heading = found["filter"]["components"]["heading"]
    assert heading["unit"] == "deg"
    assert heading["rmse_95"][0] < heading["rmse"] < heading["rmse_95"][1]
    assert heading["ratio"] == pytest.approx(assessments["filter"].rms[8].ratio)
    assert list(found["smoother"]["nees"]) == list(found["filter"]["nees"])
    assert set(found["smoother"]["rmse_over_sigma"]) == {"position", "velocity", "attitude", "gyro_bias", "accel_bias"}


def test_the_account_for_a_person(campaign):
    _, runs, assessments = campaign
    text = "\n".join(describe(runs, assessments))
    assert text.startswith("filter, 6 of 6 runs: ")
    assert "smoother, 6 of 6 runs: " in text
    assert "NEES whole state" in text
    assert "NIS gnss_velocity" in text
    assert "failed" not in text


def test_tables_do_not_depend_on_the_number_of_processes(campaign, tmp_path):
    folder = campaign[0]
    recipe = SimulatedRecipe("car", duration=20.0, imu_rate=20.0, scale_states=False, smooth=True)
    montecarlo(recipe, tmp_path / "two", 6, jobs=2, settle_s=5.0)
    for name in ("runs.parquet", "nis.parquet", "nees.parquet"):
        assert (folder / name).read_bytes() == (tmp_path / "two" / name).read_bytes(), name


def test_an_interrupted_campaign_is_written(tmp_path):
    runs, assessments = montecarlo(interrupted_at_five, tmp_path, 10, jobs=1)
    found = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert found["runs"]["interrupted"]
    assert found["runs"]["finished"] == 5
    assert found["recipe"] == {"callable": "interrupted_at_five"}
    assert read(tmp_path / "runs.parquet").seed.nunique() == 5
    assert describe(runs, assessments)[0].startswith("filter, 5 of 10 runs (interrupted): ")


def test_failed_runs_are_told(tmp_path):
    runs, assessments = montecarlo(EverySecondBreaks(), tmp_path, 4, jobs=1)
    found = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert list(found["runs"]["failed"]) == ["1", "3"]
    assert describe(runs, assessments)[-1].startswith("2 runs failed, which no average shows; seed 1: increments begin")


def test_an_earlier_result_is_replaced_whole(tmp_path):
    (tmp_path / "rmse_smoother.png").write_text("old")
    (tmp_path / "mine.txt").write_text("keep")
    montecarlo(SHORT, tmp_path, 2, jobs=1)
    assert not (tmp_path / "rmse_smoother.png").exists()
    assert (tmp_path / "mine.txt").exists()


@pytest.mark.parametrize("settle", [-1.0, 20.0, float("nan")])
def test_a_beginning_longer_than_the_run_is_refused_before_the_work(settle, tmp_path):
    with pytest.raises(ConfigError, match="shorter than a run \\(20 s\\), not"):
        montecarlo(SHORT, tmp_path / "out", 2, jobs=1, settle_s=settle)
    assert not (tmp_path / "out").exists()


def test_a_folder_that_cannot_be_written_is_found_out_before_the_work(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="is a file, not a folder"):
        montecarlo(lambda seed: pytest.fail("the work began"), tmp_path / "file", 2, jobs=1)
