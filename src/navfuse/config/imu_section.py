"""The noise keys of ``[imu]`` as text, from an error model."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Collection, Sequence
from pathlib import Path

import numpy as np

from navfuse.config.project import Project
from navfuse.config.toml_text import toml_value
from navfuse.errors import ConfigError
from navfuse.imu.error_model import DATASHEET_UNITS, ImuErrorModel


def imu_section(
    model: ImuErrorModel, comments: Sequence[str] = (), fields: Collection[str] | None = None, digits: int = 4
) -> str:
    """The table ``[imu]`` with the noise of a sensor, ready to be pasted into a project file.

    Parameters
    ----------
    model : ImuErrorModel
    comments : sequence of str
        Remarks that are put before the keys; each line of them becomes a comment.
    fields : collection of str, optional
        Fields of the model to write: those that something is known of. What is not written stays as the grade of the
        project says; a zero that stands for "not known" would override it. All of them by default.
    digits : int
        Of each number, 1 to 17; with 17 the model is read back as it is.

    Returns
    -------
    str
        TOML. Scale factors and cross-coupling are written where they are not zero, a bias
        walk where the correlation time is infinite, everything else always.
    """
    lines = ["[imu]", *(f"# {line}" for comment in comments for line in _comment_lines(comment))]
    seen: set[str] = set()
    for key, (name, factor) in DATASHEET_UNITS.items():
        if name in seen:
            continue
        seen.add(name)
        if fields is not None and name not in fields:
            continue
        value = np.asarray(getattr(model, name), dtype=float) / factor
        size = np.max(np.abs(value))
        if size == 0.0 and ("scale" in name or "cross" in name):
            continue
        if ("scale_tau" in name) or (name.endswith("bias_walk") and np.isfinite(getattr(model, name[:-4] + "tau"))):
            continue
        if value.ndim and np.ptp(value) <= 1e-9 * size:
            value = value[0]
        lines.append(f"{key} = {toml_value(_rounded(value, digits))}")
    return "\n".join(lines) + "\n"


def _comment_lines(text: str) -> list[str]:
    """Lines of a text, with ``?`` for what may not stand in a comment of TOML: control characters, half surrogates."""
    return [re.sub(r"[\x00-\x08\x0b-\x1f\x7f\ud800-\udfff]", "?", line) for line in text.splitlines()]


def _rounded(value: np.ndarray | float, digits: int) -> float | list[float]:
    numbers = [float(f"{x:.{digits}g}") for x in np.atleast_1d(value)]
    return numbers if np.ndim(value) else numbers[0]


def model_of_file(path: str | os.PathLike[str]) -> ImuErrorModel:
    """Error model of a file with a table ``[imu]``: a project file, or what :func:`imu_section` wrote.

    Keys that are missing come from the grade, as in a run; ``file`` may be missing.

    Raises
    ------
    ConfigError
        If the file cannot be read, is not TOML, has no such table, or one that a project would not take.
    """
    path = Path(path)
    try:
        with path.open("rb") as stream:
            data = tomllib.load(stream)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror or error}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: is not TOML: {error}") from error
    table = data.get("imu")
    if not isinstance(table, dict):
        raise ConfigError(f"{path}: has no table [imu]")
    whole = {"imu": {"file": "imu.csv", **table}, "gnss": {"file": "gnss.csv"}}
    return Project.from_dict(whole, source=str(path)).imu_error_model()
