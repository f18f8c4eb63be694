"""What the studies of dead reckoning share: tables of numbers, truth at epochs, differences, cells of tables."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np

from navfuse.analysis.consistency import NisSummary
from navfuse.core.earth import dcm_en, geodetic_to_ecef_batch
from navfuse.data.logs import GnssLog
from navfuse.data.trajectory import Trajectory
from navfuse.errors import InputError
from navfuse.report.study_figures import Curve, Panel, Picture
from navfuse.reproduce.study import Table

Array = np.ndarray


def numbers(path: Path, columns: int) -> Array:
    """A table of numbers with commas and no header.

    Raises
    ------
    InputError
        If it is none, is empty, has another number of columns, or a cell that is not finite.
    """
    try:
        with warnings.catch_warnings():
            # An empty file is an error here, told below.
            warnings.filterwarnings("ignore", "loadtxt: input contained no data", UserWarning)
            table = np.loadtxt(path, delimiter=",", ndmin=2)
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: not a table of numbers with commas: {error}") from error
    if not table.size:
        raise InputError(f"{path}: there is not a single row in it; get the file anew")
    if table.shape[1] != columns:
        raise InputError(f"{path}: needs {columns} columns of numbers; it has {table.shape[1]}")
    bad = np.argwhere(~np.isfinite(table))
    if bad.size:
        row, column = bad[0]
        raise InputError(f"{path}: row {row + 1}, column {column + 1}: {table[row, column]} is no number; get it anew")
    return table


def difference_n(one: Trajectory | GnssLog, other: Trajectory | GnssLog) -> Array:
    """One minus other (n, 3) [m], north, east, down of the other, row by row."""
    r, s = (geodetic_to_ecef_batch(track.lat, track.lon, track.height) for track in (one, other))
    C = np.array([np.reshape(dcm_en(lat, lon), (3, 3)) for lat, lon in zip(other.lat, other.lon, strict=True)])
    return np.einsum("kji,kj->ki", C, r - s)


def plane(track: Trajectory | GnssLog, lat: float, lon: float, height: float) -> tuple[Array, Array]:
    """East and north (n,) [m] of a place."""
    r = geodetic_to_ecef_batch(track.lat, track.lon, track.height)
    origin = geodetic_to_ecef_batch(np.array([lat]), np.array([lon]), np.array([height]))[0]
    north, east, _ = ((r - origin) @ np.reshape(dcm_en(lat, lon), (3, 3))).T
    return east, north


def rms(values: Array) -> float:
    """Root of the mean squared length of rows, or of the mean square of numbers."""
    values = np.asarray(values)
    return float(np.sqrt(np.mean(np.sum(values**2, axis=1) if values.ndim == 2 else values**2)))


def consistency_table(found: dict[str, NisSummary], note: str = "") -> Table:
    """How large innovations are against what is claimed."""
    rows = [
        (
            name,
            str(one.counts.get("used", 0)),
            str(one.counts.get("rejected", 0)),
            f"{one.mean_nis_per_dof:.3f}",
            f"{one.bounds[0]:.3f} .. {one.bounds[1]:.3f}",
            f"{one.lag_one:.2f}",
        )
        for name, one in found.items()
    ]
    return Table(
        "Innovations",
        ("source", "used", "rejected", "mean NIS per component", "99 % bounds", "lag one"),
        tuple(rows),
        note,
    )


def map_panel(tracks: dict[str, tuple[Trajectory | GnssLog, str]], origin: tuple[float, float, float]) -> Panel:
    """Tracks by name, with the kind of their curve, on one plane."""
    curves = []
    for name, (track, kind) in tracks.items():
        east, north = plane(track, *origin)
        curves.append(Curve(name, east, north, kind))
    return Panel("east [m]", "north [m]", tuple(curves), equal=True)


def map_picture(
    title: str, tracks: dict[str, tuple[Trajectory | GnssLog, str]], origin: tuple[float, float, float]
) -> Picture:
    """A map alone."""
    return Picture(title, (map_panel(tracks, origin),), row_in=5.0)
