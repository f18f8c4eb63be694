"""Published systems and studies, run again with navfuse: ``navfuse reproduce --list``.

Each study is a module with a function ``run(wishes) -> Study``.
"""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module
from typing import NamedTuple

from navfuse.core.nearest import nearest
from navfuse.errors import ConfigError
from navfuse.reproduce.study import Study, Table, Wishes

__all__ = ["STUDIES", "Entry", "Study", "Table", "Wishes", "reproduce"]


class Entry(NamedTuple):
    """A study that can be asked for.

    Attributes
    ----------
    module : str
        Below this package, or "module:function"; the function is ``run`` otherwise.
    title : str
    data : str
        Folder of published data that it reads, "" for none.
    heeds : tuple of str
        Of ``runs`` and ``seed``, what it has a use for.
    """

    module: str
    title: str
    data: str = ""
    heeds: tuple[str, ...] = ()


STUDIES = {
    "ins-gps-thesis": Entry(
        "ins_gps_thesis", "Simple EKF and Full EKF on a flight of 300 s (thesis, Brno 2013)", heeds=("runs", "seed")
    ),
    "gyro-magnetometer": Entry(
        "attitude_systems:heading", "Heading from a gyro and a compass, two states (lecture)", heeds=("runs",)
    ),
    "ahrs": Entry("attitude_systems:ahrs", "Attitude and heading reference beside VQF", "broad"),
    "first-ins-gnss": Entry(
        "planar_tutorial", "A first INS/GNSS in the plane (tutorial, NASA 2015)", heeds=("runs", "seed")
    ),
    "gnss-course": Entry(
        "gnss_course", "Positions, velocities and clock of a receiver (lecture, Workshops 1 and 2)", "ucl-comp0130"
    ),
    "dr-gnss": Entry(
        "dr_gnss", "Odometer and compass of a car with GNSS (lecture, Workshop 3)", "ucl-comp0130, groves-profiles"
    ),
    "lawnmower": Entry("lawnmower", "Lawnmower with raw GNSS, wheels, gyro and compass (lecture)", "ucl-comp0130"),
    "robot-mower": Entry("robot_mower", "Robot mower between rare RTK fixes (CMU Plaza 1)", "cmu-plaza"),
}
"""Name -> study."""


def reproduce(name: str, wishes: Wishes | None = None) -> Study:
    """Run a study.

    Parameters
    ----------
    name : str
        Key of :data:`STUDIES`.
    wishes : Wishes, optional
        Runs or a seed that the study has no use for are told in its notes.

    Raises
    ------
    ConfigError
        For an unknown name, or wishes that cannot be.
    InputError
        If the study needs published data that are not there.
    """
    if name not in STUDIES:
        close = nearest(name, list(STUDIES))
        advice = f"is {close!r} meant?" if close else f"there are {', '.join(STUDIES)}"
        raise ConfigError(f"there is no study {name!r}; {advice}")
    module, _, function = STUDIES[name].module.partition(":")
    run = getattr(import_module(f"navfuse.reproduce.{module}"), function or "run")
    wishes = Wishes() if wishes is None else wishes
    study = run(wishes)
    ignored = [
        f"{word} = {getattr(wishes, word)}"
        for word in ("runs", "seed")
        if word not in STUDIES[name].heeds and getattr(wishes, word) != getattr(Wishes, word)
    ]
    if ignored:
        note = f"{' and '.join(ignored)} had no effect: this study draws nothing that depends on it."
        study = replace(study, notes=(*study.notes, note))
    return study
