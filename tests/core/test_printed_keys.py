from __future__ import annotations

import numpy as np
import pytest

from navfuse.core.printed_keys import LARGEST, naming_keys, numbers, shown
from navfuse.errors import ConfigError

UNITS = {"noise_degps": ("noise", np.pi / 180.0), "noise_radps": ("noise", 1.0), "gain": ("gain", 1.0)}


@pytest.mark.parametrize(
    "value", [3, 2.5, np.float64(1.5), np.int8(3), [1, 2.0], ((1, 2), (3, 4)), np.arange(3), [], np.inf, range(3)]
)
def test_numbers_are_taken_as_they_are(value):
    found = numbers("x", value)
    assert found.dtype == float
    np.testing.assert_array_equal(found, np.asarray(value))


@pytest.mark.parametrize(
    "value",
    [
        "1.5", b"1", True, None, np.True_, np.str_("1"), 1j, {}, {1.0}, ["1", "2", "3"], [1.0, True], [[1.0], ["2"]],
        [1.0, [2.0]], np.array([True, False]), np.array(["1"]), np.array([1.0, "2"], dtype=object), np.array([1j]),
    ],
)  # fmt: skip
def test_what_is_no_number_is_refused_though_numpy_would_take_it(value):
    with pytest.raises(ConfigError, match="^x must be three numbers, not "):
        numbers("x", value, "three numbers")


@pytest.mark.parametrize("value", [10**400, -(10**400), [1, 10**400], [10**9000], 1e101, [0.0, -1e300], 10**200])
def test_numbers_too_large_to_be_squared_are_refused(value):
    with pytest.raises(ConfigError, match=r"^x must be at most 1e\+100 in size, not ") as raised:
        numbers("x", value)
    assert len(str(raised.value)) < 120
    assert numbers("x", [LARGEST, -LARGEST, np.inf]).size == 3


def test_values_are_shown_as_they_are_written():
    assert shown(np.float64(0.1)) == "0.1"
    assert shown(np.array([1.0, 2.0])) == "[1.0, 2.0]"
    assert shown([np.float32(0.5), (np.int64(2), "a")]) == "[0.5, (2, 'a')]"
    assert shown([1, 10**400]) == "[1, a whole number of some 401 digits]"


@pytest.mark.parametrize(
    ("printed", "message", "expected"),
    [
        ({"noise_degps": -1.0}, "noise must be positive", "noise_degps = -1.0: noise must be positive"),
        ({"noise_degps": [np.float64(2.0)]}, "noise: no", "noise_degps = [2.0]: noise: no"),
        ({"gain": -1.0}, "gain must be positive", "gain must be positive"),
        ({"noise_degps": -1.0}, "noise_degps must be a number", "noise_degps must be a number"),
        ({"noise_degps": -1.0}, "gain must be positive", "gain must be positive"),
        ({"noise_degps": 1.0, "noise_radps": 1.0}, "noise must be", "noise must be"),
        ({"noise_degps": 1.0}, "(without a name)", "(without a name)"),
        ({"odd": 1.0}, "noise must be", "noise must be"),
    ],
)
def test_messages_name_the_one_key_that_sets_their_field(printed, message, expected):
    with pytest.raises(ConfigError) as raised, naming_keys(printed, UNITS):
        raise ConfigError(message)
    assert str(raised.value) == expected
