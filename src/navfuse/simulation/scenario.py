"""Scenarios: a motion and the sensors along it, as a TOML file says.

::

    scenario_names()             -> names of those in the package
    load_scenario(name or path)  -> Scenario       everything that can be checked is checked
    Scenario, seed               -> ScenarioLogs   (scenario_run.run_scenario)
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

from navfuse.errors import ConfigError
from navfuse.simulation.barometer import BarometerModel, measure_barometer
from navfuse.simulation.body_velocity import BodyVelocityModel, measure_body_velocity
from navfuse.simulation.bounds import FASTEST_HZ
from navfuse.simulation.gnss_errors import GnssReceiverModel
from navfuse.simulation.heading_sensor import HeadingModel, measure_heading
from navfuse.simulation.imu_errors import ImuSensorModel
from navfuse.simulation.magnetometer import MagnetometerModel, measure_magnetometer
from navfuse.simulation.measured_raw_gnss import measure_raw_gnss
from navfuse.simulation.motion import Motion
from navfuse.simulation.odometer import OdometerModel, measure_odometer
from navfuse.simulation.raw_gnss_errors import RawGnssModel
from navfuse.simulation.scenario_motion import read_motion
from navfuse.simulation.scenario_table import ScenarioTable, nearest
from navfuse.simulation.uwb import UwbModel, measure_uwb
from navfuse.simulation.wheel_speeds import WheelSpeedModel, measure_wheel_speeds


@dataclass(frozen=True, slots=True)
class SensorKind:
    """An aiding sensor that a scenario can have.

    Attributes
    ----------
    make : callable
        Makes the model from the keys of the section.
    measure : callable
        Takes motion, model and random generator; gives log and truth.
    file : str
        Name of the table it is written to.
    at_antenna : bool
        It measures at a lever arm that `measure` takes as a fourth argument: ``lever_arm_m`` of its section, or else
        that of ``[gnss]``. Otherwise the lever arm, if it has one, belongs to the model.
    """

    make: Callable[..., Any]
    measure: Callable[..., tuple[Any, Any]]
    file: str
    at_antenna: bool = False


SENSORS: Mapping[str, SensorKind] = MappingProxyType(
    {
        "pseudoranges": SensorKind(RawGnssModel.from_datasheet, measure_raw_gnss, "pseudoranges.csv", True),
        "odometer": SensorKind(OdometerModel.from_datasheet, measure_odometer, "odometer.csv"),
        "wheel_speeds": SensorKind(WheelSpeedModel.from_datasheet, measure_wheel_speeds, "wheel_speeds.csv"),
        "magnetometer": SensorKind(MagnetometerModel.from_datasheet, measure_magnetometer, "magnetometer.csv"),
        "heading": SensorKind(HeadingModel.from_datasheet, measure_heading, "heading.csv"),
        "barometer": SensorKind(BarometerModel.from_datasheet, measure_barometer, "barometer.csv"),
        "body_velocity": SensorKind(BodyVelocityModel.from_datasheet, measure_body_velocity, "body_velocity.csv"),
        "uwb": SensorKind(UwbModel.from_datasheet, measure_uwb, "uwb.csv"),
    }
)
"""Aiding sensors beside GNSS fixes, by the section of the scenario."""

_ALMANAC_KEY, _OWN_CONSTELLATIONS = "constellation", ("gps", "workshop")


@dataclass(frozen=True, slots=True)
class StartErrors:
    """How well the filter is told its start.

    Attributes
    ----------
    sd_position, sd_velocity, sd_attitude : 3 numbers [m], [m/s], [rad]
        North, east, down; the last of roll, pitch, heading.
    """

    sd_position: tuple[float, float, float] = (1.0, 1.0, 2.0)
    sd_velocity: tuple[float, float, float] = (0.05, 0.05, 0.05)
    sd_attitude: tuple[float, float, float] = (math.radians(0.3), math.radians(0.3), math.radians(1.0))


@dataclass(frozen=True, slots=True, eq=False)
class Scenario:
    """A motion and the sensors along it; made by :func:`load_scenario` or :func:`read_scenario`.

    Attributes
    ----------
    name, title, description : str
    make_motion : callable
        Gives the :class:`~navfuse.simulation.motion.Motion`; see :attr:`motion`.
    seed : int
        Of the errors, if no other is asked for. Motions have seeds of their own.
    duration : float [s]
        Motions are cut there; inf for the whole.
    imu_rate : float [Hz]
    imu_kind : {"rates", "increments"}
    imu : ImuSensorModel
    imu_keys : mapping
        ``grade`` and the keys that change it, as the file gives them.
    gnss : GnssReceiverModel or None
    gnss_lever_arm_b : 3 numbers [m]
    sensors : mapping of str to (model, lever arm)
        The other aiding sensors, by section; keys of :data:`SENSORS`. The lever arm [m] is empty where the model
        has it.
    start : StartErrors or None
        None: the filter is told nothing.
    truth_rate : float [Hz]
    one_table : str
        Name of a CSV file that holds truth, IMU and GNSS together in 19 columns; empty for none.
    project : mapping of mappings
        What the project file shall say beyond the obvious.
    inputs : tuple of Path
        Files that it is made of: its own, a track, an almanac.
    """

    name: str
    title: str
    description: str
    make_motion: Callable[[], Motion]
    seed: int
    duration: float
    imu_rate: float
    imu_kind: Literal["rates", "increments"]
    imu: ImuSensorModel
    imu_keys: Mapping[str, Any]
    gnss: GnssReceiverModel | None
    gnss_lever_arm_b: tuple[float, float, float]
    sensors: Mapping[str, tuple[Any, tuple[float, ...]]]
    start: StartErrors | None
    truth_rate: float
    one_table: str
    project: Mapping[str, Mapping[str, Any]]
    inputs: tuple[Path, ...] = ()

    @property
    def motion(self) -> Motion:
        """The motion, made anew.

        Raises
        ------
        ConfigError
            For what the vehicle cannot do.
        InputError
            For a track that cannot be followed.
        """
        return self.make_motion().until(self.duration)


def scenario_names() -> list[str]:
    """Names of the scenarios in the package, in alphabetical order."""
    return sorted(entry.name[: -len(".toml")] for entry in _shelf().iterdir() if entry.name.endswith(".toml"))


def scenario_text(name: str) -> str:
    """The file of a scenario of the package.

    Raises
    ------
    ConfigError
        For an unknown name (the nearest is told).
    """
    known = scenario_names()
    if name not in known:
        hint = nearest(name, known) or f"; there are {', '.join(known)}"
        raise ConfigError(f"there is no scenario {name!r}{hint}")
    return _shelf().joinpath(f"{name}.toml").read_text(encoding="utf-8")


def load_scenario(name: str | Path, changes: Mapping[str, Mapping[str, Any]] | None = None) -> Scenario:
    """A scenario of the package by its name, or one of your own by its path.

    Parameters
    ----------
    name : str or Path
        What has the extension ``.toml`` or a folder in front is a path.
    changes : mapping of mappings, optional
        Keys to put in the place of the file's, section by section; those of the section "" stand above all tables.

    Raises
    ------
    ConfigError
        For an unknown name (the nearest is told), a file that is missing or no TOML, and as :func:`read_scenario`.
    """
    path = Path(name)
    if path.suffix.lower() == ".toml" or len(path.parts) > 1:
        try:
            text = path.expanduser().read_text(encoding="utf-8-sig")
        except FileNotFoundError:
            raise ConfigError(
                f"{path}: no such scenario file; `navfuse scenarios` lists those that come along"
            ) from None
        except (OSError, UnicodeDecodeError) as error:
            raise ConfigError(
                f"{path}: cannot be read as a scenario: {getattr(error, 'strerror', None) or error}"
            ) from error
        folder, source, own = path.expanduser().parent, str(path), (path.expanduser(),)
    else:
        text, folder, source, own = scenario_text(str(name)), Path(), str(name), ()
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{source}: not valid TOML: {error}") from error
    for section, keys in (changes or {}).items():
        table = data.setdefault(section, {}) if section else data
        if not isinstance(table, dict):
            raise ConfigError(f"{source}: [{section}] must be a table")
        table.update(keys)
    scenario = read_scenario(data, path.stem, folder=folder, source=source)
    return replace(scenario, inputs=(*own, *scenario.inputs))


def read_scenario(data: Mapping[str, Any], name: str, *, folder: Path = Path(), source: str = "") -> Scenario:
    """A scenario from nested tables.

    Parameters
    ----------
    data : mapping
        ``title, description, seed, duration_s, truth_rate_hz, one_table`` and the tables ``motion``, ``imu`` (
        ``rate_hz, kind, grade`` and the keys of :class:`~navfuse.simulation.imu_errors.ImuSensorModel`), ``gnss``
        (``lever_arm_m`` and the keys of :class:`~navfuse.simulation.gnss_errors.GnssReceiverModel`), those of
        :data:`SENSORS`, ``start`` (``sd_position_m, sd_velocity_mps, sd_attitude_deg``) and ``project`` (tables
        and keys of the project file).
    name : str
    folder : Path
        What file names are relative to.
    source : str
        For messages; default the name.

    Raises
    ------
    ConfigError
        Naming table and key: whatever is unknown, missing, of another type, or refused by the model it belongs to.
    """
    source = source or name
    top = ScenarioTable(source, data)
    title, description = top.text("title", name), top.text("description", "")
    seed, one_table = top.whole("seed", 1), top.text("one_table", "")
    duration = top.number("duration_s", above=0.0) if "duration_s" in top else math.inf
    truth_rate = _rate(top, "truth_rate_hz", 10.0)
    make_motion = read_motion(top.need("motion"), folder, source)
    track = top.get("motion").get("file")
    inputs = [folder / Path(track).expanduser()] if isinstance(track, str) else []

    imu = ScenarioTable(f"{source}: [imu]", top.need("imu"))
    imu_rate, kind = _rate(imu, "rate_hz"), imu.text("kind", "increments", ("increments", "rates"))
    grade, printed = imu.text("grade", ""), imu.rest()
    model = _model(imu.where, ImuSensorModel.from_datasheet, grade, **printed)

    receiver: GnssReceiverModel | None = None
    lever: tuple[float, float, float] = (0.0, 0.0, 0.0)
    if "gnss" in top:
        gnss = ScenarioTable(f"{source}: [gnss]", top.get("gnss"))
        lever = gnss.three("lever_arm_m", (0.0, 0.0, 0.0))
        receiver = _model(gnss.where, GnssReceiverModel.from_datasheet, **gnss.rest())
    sensors = {}
    for section, sensor in SENSORS.items():
        if section in top:
            keys = ScenarioTable(f"{source}: [{section}]", top.get(section))
            at = keys.three("lever_arm_m", lever) if sensor.at_antenna else ()
            printed_keys = keys.rest()
            almanac = printed_keys.get(_ALMANAC_KEY)
            if isinstance(almanac, str) and almanac not in _OWN_CONSTELLATIONS:
                inputs.append(folder / Path(almanac).expanduser())
                printed_keys[_ALMANAC_KEY] = str(inputs[-1])
            sensors[section] = _model(keys.where, sensor.make, **printed_keys), at
        top.get(section)
    start = _start(source, top.get("start")) if "start" in top else None
    project = top.get("project", {})
    if not isinstance(project, Mapping) or not all(isinstance(table, Mapping) for table in project.values()):
        raise ConfigError(f"{source}: [project] must hold tables of the project file, e.g. [project.filter]")
    top.finish()
    taken = {"gnss.csv", "anchors.csv", ".csv", *(sensor.file for sensor in SENSORS.values())}
    plain = Path(one_table).name == one_table and one_table.endswith(".csv") and len(one_table.split()) == 1
    if one_table and (not plain or one_table in taken or receiver is None):
        raise ConfigError(
            f"{source}: one_table must name a .csv file of its own without a folder, and needs [gnss]; not "
            f"{one_table!r}"
        )
    return Scenario(
        name=name,
        title=title,
        description=description,
        make_motion=make_motion,
        seed=seed,
        duration=duration,
        imu_rate=imu_rate,
        imu_kind="rates" if kind == "rates" else "increments",
        imu=model,
        imu_keys={"grade": grade} | printed,
        gnss=receiver,
        gnss_lever_arm_b=lever,
        sensors=sensors,
        start=start,
        truth_rate=truth_rate,
        one_table=one_table,
        project=project,
        inputs=tuple(inputs),
    )


def _rate(keys: ScenarioTable, key: str, default: float | None = None) -> float:
    rate = keys.number(key, default, above=0.0)
    if rate > FASTEST_HZ:
        raise ConfigError(f"{keys.where}: {key} must be at most {FASTEST_HZ:g} Hz, not {rate!r}")
    return rate


def _model(where: str, make: Callable[..., Any], /, *base: Any, **printed: Any) -> Any:
    try:
        return make(*base, **printed)
    except ConfigError as error:
        raise ConfigError(f"{where}: {error}") from error


def _start(source: str, table: Any) -> StartErrors:
    keys, usual = ScenarioTable(f"{source}: [start]", table), StartErrors()
    attitude = keys.three("sd_attitude_deg", tuple(map(math.degrees, usual.sd_attitude)), least=1e-9)  # pyright: ignore[reportArgumentType]
    found = StartErrors(
        keys.three("sd_position_m", usual.sd_position, least=1e-9),
        keys.three("sd_velocity_mps", usual.sd_velocity, least=1e-9),
        tuple(map(math.radians, attitude)),  # pyright: ignore[reportArgumentType]
    )
    keys.finish()
    return found


@lru_cache(maxsize=1)
def _shelf() -> Any:
    return files("navfuse.simulation").joinpath("scenarios")
