from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from navfuse.errors import OutputError
from navfuse.io.json_file import to_plain, write_json


@dataclass
class Counts:
    used: int
    rejected: int


def test_everything_becomes_plain(tmp_path):
    content = {
        "text": "Zürich",
        "flag": True,
        "nothing": None,
        "integer": np.int64(3),
        "single": np.float32(0.5),
        "nan": np.nan,
        "infinite": [np.inf, -np.inf, np.float64("nan")],
        "array": np.array([[1.0, np.nan], [3.0, 4.0]]),
        "tuple": (1, 2.5),
        "set": {"a"},
        "path": Path("a/b"),
        "record": Counts(3, 4),
        5: "number as key",
    }
    write_json(tmp_path / "s.json", content)
    text = (tmp_path / "s.json").read_text(encoding="utf-8")
    assert "Zürich" in text
    assert json.loads(text, parse_constant=lambda name: pytest.fail(name)) == {
        "text": "Zürich",
        "flag": True,
        "nothing": None,
        "integer": 3,
        "single": 0.5,
        "nan": None,
        "infinite": [None, None, None],
        "array": [[1.0, None], [3.0, 4.0]],
        "tuple": [1, 2.5],
        "set": ["a"],
        "path": "a/b",
        "record": {"used": 3, "rejected": 4},
        "5": "number as key",
    }


def test_type_without_a_json_form(tmp_path):
    with pytest.raises(TypeError, match="a complex cannot be written as JSON"):
        write_json(tmp_path / "s.json", {"z": 1j})
    with pytest.raises(TypeError, match="a type cannot be written as JSON"):
        to_plain(Counts)
    assert list(tmp_path.iterdir()) == []


def test_folder_that_is_missing(tmp_path):
    with pytest.raises(OutputError, match="cannot be written"):
        write_json(tmp_path / "no" / "s.json", {})
