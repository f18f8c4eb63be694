from __future__ import annotations

import inspect
import re
import warnings

import pytest

from navfuse import errors


def raised_classes() -> list[type]:
    return [cls for _, cls in inspect.getmembers(errors, inspect.isclass) if issubclass(cls, Exception)]


def test_every_error_has_the_one_base():
    for cls in raised_classes():
        if not issubclass(cls, Warning):
            assert issubclass(cls, errors.NavfuseError)


def test_the_tree_in_the_docstring_is_the_tree():
    drawn = set(re.findall(r"^ *[├└]── (\w+)", errors.__doc__, flags=re.MULTILINE))
    built = {cls.__name__ for cls in raised_classes() if issubclass(cls, errors.NavfuseError)}
    assert drawn == built - {"NavfuseError"}


@pytest.mark.parametrize(
    ("cls", "builtin"),
    [(errors.InputError, ValueError), (errors.ConfigError, ValueError), (errors.OutputError, OSError)],
)
def test_errors_are_caught_by_people_who_expect_the_usual(cls, builtin):
    with pytest.raises(builtin, match="told"):
        raise cls("told")


def test_warnings_have_their_own_category():
    assert issubclass(errors.NavfuseWarning, UserWarning)
    with pytest.warns(errors.NavfuseWarning, match="odd"):
        warnings.warn("odd", errors.NavfuseWarning, stacklevel=1)
