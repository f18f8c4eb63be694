from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from navfuse.report.packing import Steps, pack, unpack


def there_and_back(leaf):
    text, block = pack({"deep": [{"leaf": leaf}]})
    return unpack(json.loads(text)["deep"][0]["leaf"], block), block


@given(hnp.arrays(np.float64, st.integers(0, 50), elements=st.floats(-1e30, 1e30)))
def test_values_keep_sixteen_bits(values):
    found, block = there_and_back(values)
    assert len(block) == 3 * values.size
    np.testing.assert_allclose(found, values, rtol=2.0**-16, atol=1e-37)


def test_what_is_no_number_stays_what_it_is():
    values = np.array([np.nan, np.inf, -np.inf, 0.0, -0.0, 3.4e38])
    found, _ = there_and_back(values)
    np.testing.assert_array_equal(found[:5], values[:5])
    assert found[5] == pytest.approx(3.4e38, rel=1e-4)


@given(
    hnp.arrays(np.float64, st.integers(1, 50), elements=st.floats(-1e6, 1e6)),
    st.sampled_from([1e-4, 1e-3, 0.5]),
)
def test_steps_are_kept_to_half_of_one(values, step):
    found, _ = there_and_back(Steps(values, step))
    reach = np.abs(values - values[0]).max()
    np.testing.assert_allclose(found, values, atol=0.51 * max(step, 2.1 * reach / 2**31) + 1e-9)


def test_times_of_a_long_log_are_exact_to_the_tenth_of_a_millisecond():
    time = 456_000.0 + 0.005 * np.arange(36_000.0 * 200.0, step=397)
    found, block = there_and_back(Steps(time, 1e-4))
    np.testing.assert_allclose(found, time, atol=0.51e-4)
    assert len(block) == 4 * time.size


def test_steps_with_breaks_become_single_precision():
    values = np.array([1.0, np.nan, 1234567.0])
    found, block = there_and_back(Steps(values, 1e-3))
    np.testing.assert_array_equal(found, values)
    assert len(block) == 12
    assert there_and_back(Steps(np.empty(0), 1.0))[0].size == 0


def test_numbers_and_texts_stay_and_infinite_ones_become_null():
    text, block = pack({"a": [1, 2.5, None, True, "</script>"], "b": (float("nan"), float("-inf"))})
    assert json.loads(text) == {"a": [1, 2.5, None, True, "</script>"], "b": [None, None]}
    assert block == b""
