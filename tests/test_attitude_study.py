from __future__ import annotations

import numpy as np
import pytest

from navfuse.attitude_study import ahrs_study, gyro_heading_study
from navfuse.errors import InputError


@pytest.fixture(scope="module")
def study(shared_data):
    pytest.importorskip("vqf", reason="vqf, an extra of the developers, is not installed")
    return ahrs_study(shared_data / "broad")


@pytest.mark.slow
def test_broad_beside_vqf(study):
    found = {trial.name[:2]: trial.errors for trial in study.trials}
    assert sorted(found) == ["01", "21", "30"]
    for name, errors in found.items():
        assert errors["navfuse"].total <= errors["VQF"].total
        assert errors["navfuse"].inclination <= errors["VQF"].inclination
        assert errors["navfuse 6-D"].inclination <= errors["VQF 6-D"].inclination, name
    for name in ("21", "30"):
        assert found[name]["navfuse smoothed"].total <= found[name]["VQF offline"].total
    # On the slow trial VQF offline is better, 0.85 against 1.00 deg (docs/ahrs.md).
    assert np.degrees(found["01"]["navfuse smoothed"].total) < 1.02


@pytest.mark.slow
def test_the_figure_of_the_trials_is_drawn(study, tmp_path):
    study.figure().savefig(tmp_path / "ahrs.png")
    assert (tmp_path / "ahrs.png").stat().st_size > 10_000


def test_heading_study_and_its_figure(tmp_path):
    study = gyro_heading_study(("lawnmower",), seeds=2)
    rmse = study.rmse["lawnmower"]
    assert rmse["smoothed"] < rmse["forward"] < rmse["compass"] < rmse["gyro"]
    study.figure().savefig(tmp_path / "heading.png")
    assert (tmp_path / "heading.png").stat().st_size > 10_000


def test_nothing_to_study_is_said(tmp_path):
    with pytest.raises(InputError, match="no trial of BROAD"):
        ahrs_study(tmp_path)
    with pytest.raises(InputError, match="at least one scenario"):
        gyro_heading_study(())
