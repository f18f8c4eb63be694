"""The project file of a run without an inertial sensor: ``[dead_reckoning]`` in the place of ``[imu]``."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, field_validator, model_validator

from navfuse.config.keys import Number, Section, Vector, key
from navfuse.config.project import Project, ProjectFile, load_project, read_toml
from navfuse.config.sections import (
    _STANDARD_DEVIATIONS,
    GnssConfig,
    OutputConfig,
    SmootherConfig,
    StartConfig,
    _in_folder,
)

Place = tuple[Number, Number]

_WHEELS = ("wheel_names", "wheel_places_m", "steered_wheels", "sd_wheel_mps")
_UNREAD = {
    "odometer": _WHEELS,
    "wheels": (),
    "body-velocity": _WHEELS,
    "trajectory": ("heading_file", "heading_offset_deg", *_WHEELS),
}
"""Keys that a source has no use for: given, they would promise what is not done."""
_INERTIAL_START = {
    "time_s": "cut the log to begin there",
    "velocity_mps": "velocities come from the log",
    "roll_deg": "no attitude but the heading counts",
    "pitch_deg": "no attitude but the heading counts",
}


class DeadReckoningConfig(Section):
    """The dead-reckoned track: what it is made of, and its errors."""

    source: Literal["odometer", "wheels", "body-velocity", "trajectory"] = key(
        "odometer",
        "",
        "What the file holds: 'odometer' speeds, 'wheels' speeds of wheels, 'body-velocity' of a Doppler "
        "radar or sonar, 'trajectory' positions and velocities of any solution.",
        shown=True,
    )
    file: Path = key(..., "", "The log: a CSV or Parquet table of that kind.", example="odometer.csv", shown=True)
    heading_file: Path | None = key(
        None,
        "",
        "Headings from north: a CSV or Parquet table. Needed but for a trajectory and for wheels, which turn the "
        "heading of [start] on without it.",
        example="heading.csv",
        shown=True,
    )
    time_offset_s: Number = key(0.0, "s", "Added to the time stamps of both files.")
    heading_offset_deg: Number = key(
        0.0, "deg", "Added to the headings, such as the magnetic declination, east positive.", least=-360.0, most=360.0
    )
    wheel_names: tuple[str, ...] = key(
        (), "", "Wheels used, as their columns wheel_<name>_mps name them.", example=("rear_left", "rear_right")
    )
    wheel_places_m: tuple[Place, ...] = key(
        (), "m", "Where each of them is from the antenna: forward, right.", example=((-0.2, -0.2), (-0.2, 0.2))
    )
    steered_wheels: tuple[str, ...] = key((), "", "Which of them steer.", example=("front_left", "front_right"))
    sd_wheel_mps: Number = key(0.05, "m/s", "Standard deviation of the speed of a wheel.", above=0.0)
    frame: Literal["ned", "ecef"] = key("ned", "", "Frame of the six error states.")
    feedback: Literal["open", "closed"] = key(
        "open", "", "Whether the errors are kept beside the track ('open') or fed back into it ('closed')."
    )
    velocity_psd_m2ps3: Number = key(
        0.2, "m^2/s^3", "Power spectral density of the random walk of the horizontal velocity error.", least=0.0
    )
    vertical_psd_m2ps3: Number | None = key(
        None, "m^2/s^3", "The same of the vertical one; left out, that of the horizontal.", least=0.0, example=0.01
    )
    heading_noise_deg: Number = key(
        0.0, "deg", "White noise of the headings; adds to the random walk with the speed.", least=0.0, most=90.0
    )
    speed_noise_mps: Number = key(0.0, "m/s", "White noise of the speeds; adds to the random walk.", least=0.0)
    fix_error_sd_m: Vector | None = key(
        None,
        "m",
        "Standard deviation of the slow part of the errors of the fixes, north, east, down; adds three states.",
        above=0.0,
        example=(0.5, 0.5, 1.0),
    )
    fix_error_tau_s: Number = key(60.0, "s", "Its correlation time.", above=0.0)
    patience_s: Number = key(
        10.0, "s", "When fixes were rejected for so long, five at least, the filter gives in to them.", least=0.0
    )

    _resolve = field_validator("file", "heading_file")(_in_folder)

    @model_validator(mode="after")
    def _whole(self) -> DeadReckoningConfig:
        if self.source in ("odometer", "body-velocity") and self.heading_file is None:
            raise ValueError(f'dead_reckoning.heading_file: missing; source = "{self.source}" needs headings')
        unread = _UNREAD[self.source]
        if self.source == "wheels" and self.heading_file is None:
            unread = ("heading_offset_deg",)
        for name in unread:
            if getattr(self, name) != type(self).model_fields[name].default:
                why = "without heading_file" if self.source == "wheels" else f'by source = "{self.source}"'
                raise ValueError(f"dead_reckoning.{name}: not read {why}; remove it, or choose another source")
        if self.source != "wheels":
            return self
        twice = [name for k, name in enumerate(self.wheel_names) if name in self.wheel_names[:k]]
        if twice:
            raise ValueError(f'dead_reckoning.wheel_names: "{twice[0]}" is there twice; name every wheel once')
        if not self.wheel_names or len(self.wheel_names) != len(self.wheel_places_m):
            raise ValueError(
                f"dead_reckoning.wheel_places_m: {len(self.wheel_names)} wheel_names need as many places, at least "
                f"one; there are {len(self.wheel_places_m)}"
            )
        unknown = [name for name in self.steered_wheels if name not in self.wheel_names]
        if unknown:
            raise ValueError(f'dead_reckoning.steered_wheels: "{unknown[0]}" is not in wheel_names')
        return self


class DeadReckoningProject(ProjectFile):
    """Everything a run without an inertial sensor needs to know; see :class:`~navfuse.config.project.Project`."""

    dead_reckoning: DeadReckoningConfig
    gnss: GnssConfig = Field(default_factory=GnssConfig)
    start: StartConfig = Field(default_factory=StartConfig)
    smoother: SmootherConfig = Field(default_factory=SmootherConfig)
    output: OutputConfig = Field(default_factory=OutputConfig)

    @model_validator(mode="before")
    @classmethod
    def _no_inertial_sensor(cls, data: Any) -> Any:
        if isinstance(data, Mapping) and "imu" in data:
            raise ValueError(
                "imu: beside [dead_reckoning]; give one or the other: [imu] for inertial navigation, [dead_reckoning] "
                "for a track corrected by GNSS"
            )
        return data

    @model_validator(mode="after")
    def _consistent(self) -> DeadReckoningProject:
        if self.gnss.file is None:
            raise ValueError("gnss.file: missing; dead reckoning is corrected by GNSS")
        for name, instead in _INERTIAL_START.items():
            if getattr(self.start, name) is not None:
                raise ValueError(f"start.{name}: not with [dead_reckoning]: {instead}; remove it")
        # The default comes with a heading, and with it back from a project that was written.
        if self.start.sd_attitude_deg not in (None, _STANDARD_DEVIATIONS["sd_attitude_deg"][1]):
            raise ValueError(
                "start.sd_attitude_deg: not with [dead_reckoning]: headings have dead_reckoning.heading_noise_deg; "
                "remove it"
            )
        if any(self.gnss.lever_arm_m):
            raise ValueError(
                "gnss.lever_arm_m: not with [dead_reckoning]: the track is that of the antenna; wheel_places_m counts "
                "from it"
            )
        return self


def any_project(
    config: ProjectFile | Mapping[str, Any] | str | os.PathLike[str],
) -> Project | DeadReckoningProject:
    """A project of either kind: given as one, as nested dictionaries, or as the path of its file.

    Raises
    ------
    ConfigError
        As :func:`~navfuse.config.project.load_project`.
    """
    if isinstance(config, Project | DeadReckoningProject):
        return config
    if isinstance(config, ProjectFile):
        raise TypeError(f"{type(config).__name__} is not a project")
    if isinstance(config, Mapping):
        kind = DeadReckoningProject if "dead_reckoning" in config else Project
        return kind.from_dict(config)
    data = read_toml(config)
    if "dead_reckoning" not in data:
        return load_project(config)
    return DeadReckoningProject.from_dict(data, folder=Path(config).parent, source=str(config))
