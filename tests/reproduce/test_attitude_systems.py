"""The studies of heading and attitude as tables."""

import pytest

from navfuse.errors import InputError
from navfuse.reproduce import Wishes, reproduce


def test_heading(tmp_path):
    study = reproduce("gyro-magnetometer", Wishes(runs=2))
    for scenario, rmse in study.numbers["rmse_deg"].items():
        assert rmse["smoothed"] < rmse["forward"] < 1.0 < rmse["compass"], scenario
    files = study.write(tmp_path / "out", ("png", "svg"))
    assert [path.suffix for path in files] == [".md", ".json", ".png", ".svg"]


def test_attitude_needs_data(tmp_path):
    with pytest.raises(InputError, match="--data"):
        reproduce("ahrs")
    with pytest.raises(InputError, match="no trial of BROAD"):
        reproduce("ahrs", Wishes(data=tmp_path))


@pytest.mark.slow
def test_attitude(shared_data):
    if not (shared_data / "broad").is_dir():
        pytest.skip("the BROAD trials are not among the shared data")
    table = reproduce("ahrs", Wishes(data=shared_data)).tables[0]
    totals = {row[0]: float(row[1]) for row in table.rows}
    for trial in {name.split(":")[0] for name in totals}:
        assert totals[f"{trial}: navfuse"] < 2.0
        if f"{trial}: VQF" in totals:
            assert totals[f"{trial}: navfuse"] <= totals[f"{trial}: VQF"]
