"""What a file is: its format, and which sensor its columns are from.

Native tables say it in their column names. For other tables the names are read generously (``acc_x [m/s^2]`` for
``accel_x_mps2``), so that the rest of an inspection can go on and the renaming that is needed can be told.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from navfuse.errors import InputError
from navfuse.io.columns import Field, fields
from navfuse.io.gnss_table import FIX, N_SATELLITES, SD_POSITION, SD_VELOCITY, VELOCITY
from navfuse.io.imu_table import INCREMENTS, RATES, TIME
from navfuse.io.nineteen_columns import GNSS_PART, IMU_PART, TRUTH_PART, is_nineteen_columns
from navfuse.io.raw_gnss_table import PSEUDORANGE, SAT_POSITION, SATELLITE
from navfuse.io.tables import CsvTable, ParquetTable, open_table
from navfuse.io.trajectory_table import GROUPS
from navfuse.io.units import UNITS
from navfuse.io.vectornav_binary import is_vectornav_binary

Array = np.ndarray

PLACE = (*fields("angle", "deg", "lat", "lon"), Field("height", "length", "m"))
GNSS = (TIME, *PLACE, *SD_POSITION, *VELOCITY, *SD_VELOCITY, FIX, N_SATELLITES)
TRUTH = (TIME, *PLACE, *(one for group in GROUPS.values() for one in group))
IMU = (TIME, *RATES, *INCREMENTS)
SPEED, HEADING = Field("speed", "speed", "mps"), Field("heading", "angle", "deg")
MAGNETOMETER = fields("magnetic field", "ut", "mag_x", "mag_y", "mag_z")
PRESSURE = Field("pressure", "pressure", "hpa")
BODY_VELOCITY = fields("speed", "mps", "v_x", "v_y", "v_z")
ANCHOR, RANGE = Field("anchor", text=True), Field("range", "length", "m")

TABLES, ARRAYS, TEXTS = (".csv", ".parquet"), (".npz", ".mat"), (".txt", ".dat", ".imu", ".asc", ".tsv")
_UNIT_WORDS = {
    "m/s^2": "mps2", "m/s2": "mps2", "m/s/s": "mps2", "mps2": "mps2", "g": "g", "mg": "mg", "rad/s": "radps",
    "deg/s": "degps", "°/s": "degps", "dps": "dps", "deg": "deg", "°": "deg", "rad": "rad", "m": "m", "ft": "ft",
    "m/s": "mps", "km/h": "kmph", "s": "s", "sec": "s", "ms": "ms", "us": "us", "ns": "ns", "degree": "deg",
}  # fmt: skip
_TIME_LIKE = r"(gps_?)?(time|t|stamp|timestamp|tow|gpstow|sec|seconds)(_?of_?week)?"
_ALIKE = {
    "time": _TIME_LIKE,
    "lat": r"lat(itude)?",
    "lon": r"(lon|lng|long)(gitude|itude)?",
    "height": r"(height|alt|altitude|ellipsoid(al)?_?height|h)",
    "pressure": r"(pressure|press|baro)",
    "speed": r"(speed|velocity|odo(meter)?(_?speed)?)",
    "heading": r"(heading|yaw|course|hdg)",
    **{f"gyro_{a}": rf"(imu_?)?(gyr|gyro|gyroscope|ang(ular)?_?(rate|vel|velocity)|omega|w)_?{a}" for a in "xyz"},
    **{f"accel_{a}": rf"(imu_?)?(acc|accel|acceleration|(lin(ear)?_?)acc(el)?|force|f|a)_?{a}" for a in "xyz"},
    **{f"dtheta_{a}": rf"(imu_?)?(d(elta)?_?(theta|ang(le)?))_?{a}" for a in "xyz"},
    **{f"dvel_{a}": rf"(imu_?)?(d(elta)?_?v(el(ocity)?)?)_?{a}" for a in "xyz"},
    **{f"mag_{a}": rf"(imu_?)?mag(netometer)?_?{a}" for a in "xyz"},
    **{f"v{a}": rf"(vel(ocity)?_?{a}\w*|v_?{w}|{w}_?vel(ocity)?|velned_?{a})" for a, w in
       (("n", "north"), ("e", "east"), ("d", "down"))},
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Column:
    """Where a quantity was found.

    Attributes
    ----------
    name : str
        As in the file.
    unit : str
        Suffix of :mod:`navfuse.io.units` that the name carries; "" if it carries none that is known.
    native : bool
        Whether a reader takes it by this name.
    """

    name: str
    unit: str
    native: bool


@dataclass(frozen=True, slots=True)
class Recognised:
    """A file, its format and role.

    Attributes
    ----------
    path : Path
    format : str
        In words.
    role : str
        "imu", "gnss", "truth", "raw gnss", "odometer", "wheel speeds", "heading", "magnetometer", "barometer",
        "body velocity", "uwb", "anchors", "nineteen columns", "static", "rtklib pos"; "unknown" otherwise.
    table : CsvTable, ParquetTable or None
    columns : mapping of str to Column
        Base name -> where it is.
    fault : str
        Why the file cannot be used as a log; "" if it can.
    """

    path: Path
    format: str
    role: str
    table: CsvTable | ParquetTable | None
    columns: Mapping[str, Column]
    fault: str = ""

    def renames(self, wanted: Sequence[Field], units: Mapping[str, str]) -> list[str]:
        """Pairs such as 'acc_x' to 'accel_x_mps2' of each column that no reader takes, by the units given."""
        told = []
        for one in wanted:
            column = self.columns.get(one.base)
            if column is not None and not column.native:
                unit = column.unit or units.get(one.base, one.unit)
                told.append(f"'{column.name}' to '{one.base}_{unit}'" if unit else f"'{column.name}' to '{one.base}'")
        return told


def recognise(path: Path) -> Recognised:
    """Tell what a file is, by its extension, its first bytes, and its column names.

    Never raises for what is in the file: `fault` says why it cannot be used.
    """
    extension = path.suffix.lower()
    if not path.exists():
        return Recognised(path, "missing", "unknown", None, {}, "there is no such file")
    foreign = _foreign(path)
    if foreign == VECTORNAV:
        note = f"this is {foreign}; navfuse.io.vectornav_logs.read_vectornav makes logs of it, a project takes tables"
        return Recognised(path, foreign, "unknown", None, {}, note)
    if foreign:
        return Recognised(path, foreign, "unknown", None, {}, f"this is {foreign}, which navfuse does not read")
    if extension == ".pos":
        return Recognised(path, "RTKLIB solution", "rtklib pos", None, {})
    if extension in ARRAYS:
        return Recognised(path, f"arrays ({extension})", "static", None, {})
    if extension in TEXTS:
        return Recognised(path, "columns of numbers without names", "static", None, {})
    try:
        table = open_table(path)
        whole = is_nineteen_columns(table.names, table.source)
    except InputError as error:
        return Recognised(path, "table", "unknown", None, {}, without_source(str(error), str(path)))
    kind = "CSV table" if extension == ".csv" else "Parquet table"
    if whole:
        return Recognised(path, f"{kind} of 19 columns", "nineteen columns", table, {})
    for generous in (False, True):
        role, columns = _role(table.names, generous, path)
        if role != "unknown":
            return Recognised(path, kind, role, table, columns)
    fault = "this is a table in which no columns of a sensor were recognised; the first are " + ", ".join(
        f"'{name}'" for name in table.names[:8]
    )
    return Recognised(path, kind, "unknown", table, {}, fault)


def part_columns(found: Recognised, part: str) -> Recognised:
    """One part, "imu", "gnss" or "truth", of a table of 19 columns as if it were a table of its own."""
    names = {"imu": IMU_PART, "gnss": GNSS_PART, "truth": TRUTH_PART}[part]
    native = {field.base: field for field in (*IMU, *GNSS, *TRUTH)}
    return replace(
        found, role=part, columns={base: Column(name, native[base].unit, True) for base, name in names.items()}
    )


def without_source(text: str, source: str) -> str:
    """A reader's message less the name of the file in front of it."""
    return text.removeprefix(f"{source}: ")


def find(names: Sequence[str], wanted: Sequence[Field], generous: bool) -> dict[str, Column]:
    """Columns of fields by the rules of the readers or, if `generous`, by what the names resemble."""
    found: dict[str, Column] = {}
    taken: set[str] = set()
    for one in wanted:
        for name in names:
            if name in taken:
                continue
            column = _native(name, one) or (_resembling(name, one) if generous else None)
            if column is not None:
                found[one.base] = column
                taken.add(name)
                break
    return found


def _native(name: str, wanted: Field) -> Column | None:
    if wanted.quantity is None:
        return Column(name, "", True) if name == wanted.base else None
    unit = name[len(wanted.base) + 1 :]
    if name.startswith(wanted.base + "_") and unit in UNITS[wanted.quantity]:
        return Column(name, unit, True)
    return None


def _resembling(name: str, wanted: Field) -> Column | None:
    """A column of another program's table: its quantity in other words, its unit in brackets or behind."""
    if wanted.quantity is None:
        return None
    if name == wanted.base:
        return Column(name, "", False)
    if wanted.base not in _ALIKE:
        return None
    bare, unit = _without_unit(name)
    known = unit if unit in UNITS[wanted.quantity] else ""
    pattern = rf"(\w+_)?{_ALIKE[wanted.base]}" if len(bare) > 3 else _ALIKE[wanted.base]
    return Column(name, known, False) if re.fullmatch(pattern, bare) else None


def _without_unit(name: str) -> tuple[str, str]:
    """A name in lower case and underscores without its unit, and the suffix of the unit."""
    unit = ""
    bracket = re.search(r"[\[(]([^\])]*)[\])]", name)
    if bracket:
        unit = _UNIT_WORDS.get(bracket[1].strip().lower(), "")
        name = name.replace(bracket[0], "")
    bare = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")
    head, _, tail = bare.rpartition("_")
    suffixes = {suffix for units in UNITS.values() for suffix in units} - set("nedt")
    if not unit and head and tail in suffixes:
        return head, tail
    return bare, unit


def _role(names: Sequence[str], generous: bool, path: Path) -> tuple[str, dict[str, Column]]:
    for role, needed, wanted in _ROLES:
        found = find(names, wanted, generous)
        if sum(one.base in found for one in needed) >= min(len(needed), 4) and needed[0].base in found:
            if role == "gnss" and _is_truth(names, path):
                return "truth", find(names, TRUTH, generous)
            return role, found
    if any(re.fullmatch(r"wheel_\w+", name) for name in names):
        return "wheel speeds", find(names, (TIME,), generous)
    return "unknown", {}


def _is_truth(names: Sequence[str], path: Path) -> bool:
    """Attitude is nothing a receiver gives; without it the name of the file has to say."""
    attitude = {"roll", "pitch"} <= {name.lower().split("_")[0].split(" ")[0] for name in names}
    return attitude or bool(re.search(r"truth|reference|ground", path.stem.lower()))


_ROLES: tuple[tuple[str, tuple[Field, ...], tuple[Field, ...]], ...] = (
    ("imu", RATES, IMU),
    ("imu", INCREMENTS, IMU),
    ("raw gnss", (PSEUDORANGE, SATELLITE, *SAT_POSITION), (TIME, SATELLITE, PSEUDORANGE, *SAT_POSITION)),
    ("anchors", (ANCHOR, *PLACE), (ANCHOR, *PLACE)),
    ("uwb", (ANCHOR, RANGE), (TIME, ANCHOR, RANGE)),
    ("gnss", (PLACE[0], PLACE[1]), GNSS),
    ("body velocity", BODY_VELOCITY[:1], (TIME, *BODY_VELOCITY)),
    ("odometer", (SPEED,), (TIME, SPEED)),
    ("heading", (HEADING,), (TIME, HEADING)),
    ("magnetometer", MAGNETOMETER, (TIME, *MAGNETOMETER)),
    ("barometer", (PRESSURE,), (TIME, PRESSURE, PLACE[2])),
    ("barometer", (PLACE[2],), (TIME, PRESSURE, PLACE[2])),
)
"""Role, fields of which all (of six: four) tell it, the first among them; fields that it may have."""

VECTORNAV = "a VectorNav recording"

_MAGIC = (
    (rb"\$VN[A-Z0-9]{3},", VECTORNAV),
    (rb"\xb5b", "a u-blox UBX recording"),
    (rb"ULog", "a PX4 ULog"),
    (rb"#ROSBAG", "a ROS bag"),
    (rb"\xa3\x95", "an ArduPilot log"),
    (rb"\$@", "a Septentrio SBF recording"),
    (rb"#[cd][PV]", "an SP3 orbit file"),
    (rb"\$[A-Z]{2}[A-Z]{3},|\$GP|\$GN", "a recording of NMEA sentences"),
    (rb"#?[A-Z]+A,COM", "a NovAtel log"),
    (rb"\xaa\x44\x12", "a NovAtel log"),
)


def _foreign(path: Path) -> str:
    """A format that is known and not read, "" for others."""
    try:
        with path.open("rb") as stream:
            head = stream.read(200)
    except OSError:
        return ""
    if b"RINEX VERSION" in head[:100]:
        return "a RINEX file"
    if path.suffix.lower() in TABLES:
        return ""
    if b"\xfa" in head and is_vectornav_binary(path):
        return VECTORNAV
    return next((words for magic, words in _MAGIC if re.match(magic, head)), "")
