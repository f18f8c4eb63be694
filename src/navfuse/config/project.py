"""The project as a whole: from a file or a dictionary, checked across its tables."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from navfuse.config.messages import config_error
from navfuse.config.sections import (
    AidingConfig,
    FilterConfig,
    GnssConfig,
    ImuConfig,
    OutputConfig,
    SmootherConfig,
    StartConfig,
)
from navfuse.config.toml_text import toml_value
from navfuse.errors import ConfigError

if TYPE_CHECKING:
    import os

    from navfuse.imu.error_model import ImuErrorModel


class ProjectFile(BaseModel):
    """What project files of all kinds have in common."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    @classmethod
    def from_dict(
        cls, data: Mapping[str, Any], *, folder: str | os.PathLike[str] | None = None, source: str = "project"
    ) -> Self:
        """Check a nested dictionary with the tables and keys of the project file.

        Parameters
        ----------
        data : mapping
            Tables by name, each a mapping of keys.
        folder : path-like, optional
            What relative file names are relative to; default the working directory.
        source : str
            Name for messages.

        Raises
        ------
        ConfigError
            For an unknown key, a value of the wrong type or out of range, and settings that contradict each other.
        """
        try:
            return cls.model_validate(data, context={"folder": folder})
        except ValidationError as error:
            raise config_error(error, cls, data, source) from None

    def settings(self) -> dict[str, dict[str, Any]]:
        """The settings in force as nested plain dictionaries, defaults included, keys without a value left out."""
        return self.model_dump(exclude_none=True)

    def to_toml(self) -> str:
        """The settings in force as a project file that :func:`load_project` takes."""
        lines: list[str] = []
        for name, table in self.settings().items():
            lines += [f"[{name}]", *(f"{key} = {toml_value(value)}" for key, value in table.items()), ""]
        return "\n".join(lines)


class Project(ProjectFile):
    """Everything a run needs to know, as the project file says it: units as in the key names.

    Notes
    -----
    Make one with :func:`load_project` or :meth:`from_dict`; these turn what is wrong into a :class:`ConfigError`.
    """

    imu: ImuConfig
    gnss: GnssConfig = Field(default_factory=GnssConfig)
    start: StartConfig = Field(default_factory=StartConfig)
    filter: FilterConfig = Field(default_factory=FilterConfig)
    smoother: SmootherConfig = Field(default_factory=SmootherConfig)
    aiding: AidingConfig = Field(default_factory=AidingConfig)
    output: OutputConfig = Field(default_factory=OutputConfig)

    @model_validator(mode="after")
    def _consistent(self) -> Project:
        from navfuse.io.imu_table import body_from_file

        start = self.start
        if self.gnss.file is None and (start.lat_deg is None or start.heading_deg is None):
            raise ValueError(
                "gnss.file: missing; without GNSS, [start] has to give lat_deg, lon_deg, height_m and heading_deg"
            )
        if start.time_s is not None and self.filter.until_s is not None and not start.time_s < self.filter.until_s:
            raise ValueError(f"filter.until_s = {self.filter.until_s:g}: must be after start.time_s = {start.time_s:g}")
        try:
            body_from_file(self.imu.axes, self.imu.rotation)
        except ConfigError as error:
            raise ValueError(f"imu.{error}") from error
        try:
            self.imu_error_model()
        except ConfigError as error:
            raise ValueError(f"imu.grade: {error}") from error
        return self

    def imu_error_model(self) -> ImuErrorModel:
        """The preset of ``imu.grade`` with the keys of ``[imu]`` put in its place, in SI units.

        A bias walk and a finite correlation time exclude each other: a walk given alone makes the correlation
        time infinite, a finite correlation time given alone makes the walk zero, whatever the preset says.

        Raises
        ------
        ConfigError
            For an unknown grade.
        """
        from navfuse.imu.error_model import DATASHEET_UNITS
        from navfuse.imu.grades import grade

        given = {name: getattr(self.imu, name) for name in type(self.imu).model_fields if name in DATASHEET_UNITS}
        given = {name: value for name, value in given.items() if value is not None}
        for sensor, unit in (("gyro", "dph"), ("accel", "mg")):
            tau, walk = f"{sensor}_bias_tau_s", f"{sensor}_bias_walk_{unit}_per_sqrt_h"
            if given.get(tau, float("inf")) < float("inf"):
                given.setdefault(walk, 0.0)
            elif given.get(walk, 0.0) != 0.0:
                given.setdefault(tau, float("inf"))
        return grade(self.imu.grade).replace_datasheet(**given)


def load_project(path: str | os.PathLike[str]) -> Project:
    """Read and check a project file.

    Parameters
    ----------
    path : path-like
        A TOML file. File names in it are relative to its folder.

    Raises
    ------
    ConfigError
        If there is no such file, it is not TOML (the line is named), or :meth:`Project.from_dict` refuses it.
    """
    return Project.from_dict(read_toml(path), folder=Path(path).parent, source=str(Path(path)))


def read_toml(path: str | os.PathLike[str]) -> dict[str, Any]:
    """The tables of a project file, not checked.

    Raises
    ------
    ConfigError
        If there is no such file or it is not TOML (the line is named).
    """
    file = Path(path)
    try:
        text = file.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise ConfigError(f"{file}: no such project file; `navfuse config` prints one to begin with") from None
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(
            f"{file}: cannot be read as a project file: {getattr(error, 'strerror', None) or error}"
        ) from error
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{file}: not valid TOML: {error}") from error
