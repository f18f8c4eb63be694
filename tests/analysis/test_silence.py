"""The stretch without fixes that a run should speak of."""

from __future__ import annotations

import numpy as np
import pytest

from navfuse.analysis.plausibility import silence
from navfuse.data.result import Innovations, Result
from navfuse.data.trajectory import Trajectory


def result(times: np.ndarray, end: float = 100.0) -> Result:
    time = np.arange(0.0, end, 0.5)
    sd = np.full((time.size, 3), 0.5)
    sd[time > 60.0] = 3.0
    rows = times.size
    z = np.zeros((rows, 3))
    innovations = Innovations(
        times,
        np.full(rows, "gnss_position"),
        np.full(rows, "used"),
        np.full(rows, 3.0),
        np.full(rows, 3),
        z,
        z + 1.0,
        np.arange(rows),
    )
    still = np.zeros((time.size, 3))
    place = np.full(time.size, 0.5)
    return Result(Trajectory(time, place, place, place, still, still, sd, sd, sd), innovations=innovations)


def test_a_hole_in_the_fixes_is_named_with_what_it_costs():
    times = np.arange(0.0, 100.0)
    text = silence(result(times[(times < 40.0) | (times > 70.0)]))
    assert text == [
        "no fix was used from 39.0 s to 71.0 s: inertial navigation alone; the standard deviation grows to 4.24 m"
        " horizontally"
    ]


def test_a_hole_that_was_asked_for_is_not():
    times = np.arange(0.0, 100.0)
    assert silence(result(times[(times < 40.0) | (times > 70.0)]), exclude=[(39.5, 70.5)]) == []


@pytest.mark.parametrize("spacing", [0.2, 1.0, 5.0])
def test_steady_fixes_say_nothing(spacing):
    assert silence(result(np.arange(0.0, 100.0, spacing))) == []


def test_fixes_that_end_early_are_named():
    assert "from 29.0 s to 99.5 s" in silence(result(np.arange(0.0, 30.0)))[0]
