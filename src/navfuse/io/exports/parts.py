"""The parts of a track that a format cannot do without."""

from __future__ import annotations

import numpy as np

from navfuse.data.export_track import ExportTrack
from navfuse.errors import InputError

Array = np.ndarray

_WORDS = {
    "velocity_n": "a velocity",
    "attitude": "an attitude",
    "sd_position": "standard deviations of the position",
    "sd_velocity": "standard deviations of the velocity",
    "sd_attitude": "standard deviations of the attitude",
}


def check_parts(track: ExportTrack, format_name: str, needed: tuple[str, ...] = ()) -> None:
    """Refuse a track that lacks what a format has to hold, or would write "nan".

    Parameters
    ----------
    track : ExportTrack
    format_name : str
        For the message.
    needed : tuple of str
        Attributes of the trajectory that must not be None.

    Raises
    ------
    InputError
        Naming what is missing, or the epoch that holds a value which is no number.
    """
    trajectory = track.trajectory
    if len(trajectory) == 0:
        raise InputError(f"{trajectory.source}: there is no epoch to write as {format_name}")
    missing = [_WORDS[name] for name in needed if getattr(trajectory, name) is None]
    if missing:
        raise InputError(f"{trajectory.source}: {format_name} needs {' and '.join(missing)}, the trajectory has none")
    extra = {"undulation": track.undulation, "a_eb_b": track.a_eb_b, "w_nb_b": track.w_nb_b}
    values = {name: getattr(trajectory, name) for name in ("time", "lat", "lon", "height", *_WORDS)} | extra
    for name, column in values.items():
        if column is None:
            continue
        flawed = ~np.isfinite(column).reshape(len(trajectory), -1).all(axis=1)
        if flawed.any():
            row = int(np.argmax(flawed))
            raise InputError(
                f"{trajectory.source}: epoch {row + 1} (at {trajectory.time[row]:g} s): {name} is not a number;"
                f" {np.count_nonzero(flawed)} epochs are such, leave them out"
            )


def fix_codes(track: ExportTrack, codes: dict[str, int], unknown: int) -> Array:
    """Code (n,) of the fix type at each epoch; `unknown` where nobody said, or for a type not in `codes`."""
    if track.fix is None:
        return np.full(len(track.trajectory), unknown)
    kinds, index = np.unique(np.char.lower(np.asarray(track.fix).astype(str)), return_inverse=True)
    return np.array([codes.get(str(kind), unknown) for kind in kinds])[index]
