"""A lecture's exercises and coursework on multisensor navigation, run again."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from navfuse.data.raw_gnss import RawGnssLog
from navfuse.errors import InputError
from navfuse.gnss.orbits import workshop_constellation

Array = np.ndarray


def read_exercise(ranges: Path, rates: Path, sd_range: float, sd_rate: float) -> RawGnssLog:
    """The pseudo-ranges and range rates of an exercise, with its satellites.

    Parameters
    ----------
    ranges, rates : Path
        Tables without names: satellite numbers in the first row, times in the first column.
    sd_range, sd_rate : float [m], [m/s]
        Standard deviations, which the tables do not have.

    Raises
    ------
    InputError
        If a file is not such a table, or the two are not of the same satellites and times.
    """
    one, other = _matrix(ranges), _matrix(rates)
    if one.shape != other.shape or not (np.array_equal(one[0], other[0]) and np.array_equal(one[:, 0], other[:, 0])):
        raise InputError(f"{ranges} and {rates} are not of the same satellites and times")
    names = np.array([f"{number:.0f}" for number in one[0, 1:]])
    time = one[1:, 0]
    sat_r, sat_v = workshop_constellation().take(names.tolist()).at(time)
    k, j = (index.ravel() for index in np.meshgrid(np.arange(time.size), np.arange(names.size), indexing="ij"))
    return RawGnssLog(
        time[k],
        names[j],
        one[1:, 1:][k, j],
        np.full(k.size, float(sd_range)),
        sat_r[k, j],
        other[1:, 1:][k, j],
        np.full(k.size, float(sd_rate)),
        sat_v[k, j],
        source=str(ranges),
    )


def _matrix(path: Path) -> Array:
    try:
        table = np.loadtxt(path, delimiter=",", ndmin=2)
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: not a table of numbers with commas: {error}") from error
    if table.shape[0] < 2 or table.shape[1] < 5 or not np.isfinite(table).all():
        raise InputError(f"{path}: needs a row of at least four satellite numbers and rows of numbers below it")
    return table
