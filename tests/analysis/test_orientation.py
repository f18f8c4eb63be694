from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from navfuse.analysis.orientation import orientation_errors
from navfuse.errors import InputError


def quats(rotation):
    return rotation.as_quat()[:, [3, 0, 1, 2]]


def test_a_known_error_is_split_as_the_benchmark_does():
    rng = np.random.default_rng(0)
    truth = Rotation.random(50, random_state=1)
    heading, tilt = 0.05 * rng.standard_normal(50) + 0.4, 0.03
    axis = rng.uniform(0.0, 6.0, 50)
    error = Rotation.from_rotvec(heading[:, None] * [0.0, 0.0, 1.0]) * Rotation.from_rotvec(
        tilt * np.column_stack([np.cos(axis), np.sin(axis), np.zeros(50)])
    )
    q, reference = quats(error * truth), quats(truth)
    reference[7] = np.nan
    counted = np.arange(50) > 3
    kept = counted & (np.arange(50) != 7)
    plain = orientation_errors(q, -reference, counted)
    assert plain.inclination == pytest.approx(tilt, rel=1e-9)
    assert plain.heading == pytest.approx(np.sqrt(np.mean(heading[kept] ** 2)), rel=1e-9)
    assert plain.total == pytest.approx(np.sqrt(np.mean((error[kept]).magnitude() ** 2)), rel=1e-9)
    assert (plain.offset, plain.count) == (0.0, kept.sum())
    centred = orientation_errors(q, reference, counted, remove_offset=True)
    assert centred.offset == pytest.approx(heading[kept].mean(), abs=1e-3)
    assert centred.heading == pytest.approx(heading[kept].std(), rel=1e-2)
    assert centred.inclination == pytest.approx(tilt, rel=1e-9)


def test_nothing_to_compare_is_said():
    with pytest.raises(InputError, match="no sample has a reference"):
        orientation_errors(np.ones((3, 4)), np.full((3, 4), np.nan))
