"""The tables of the project file, one class each. Keys carry their unit in the name where they have one."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Literal

from pydantic import ValidationInfo, field_validator, model_validator

from navfuse.config.keys import Matrix, Number, Section, Vector, Week, key
from navfuse.io.result_folder import EXPORTS, FORMATS

PerAxis = Number | Vector

_POSITION = ("lat_deg", "lon_deg", "height_m")
_STANDARD_DEVIATIONS = {
    "sd_position_m": (_POSITION, (5.0, 5.0, 5.0)),
    "sd_velocity_mps": (("velocity_mps",), (0.5, 0.5, 0.5)),
    "sd_attitude_deg": (("roll_deg", "pitch_deg", "heading_deg"), (2.0, 2.0, 5.0)),
}


def _in_folder(value: Path | None, info: ValidationInfo) -> Path | None:
    """A path of the project file is relative to the folder of that file."""
    if value is None:
        return None
    if str(value) in ("", "."):
        raise ValueError("must name a file")
    folder = (info.context or {}).get("folder")
    path = value.expanduser()
    return path if folder is None else Path(folder) / path


class ImuConfig(Section):
    """The inertial log and the errors of its sensor."""

    file: Path = key(..., "", "Inertial log: a CSV or Parquet table.", example="imu.parquet", shown=True)
    axes: str = key(
        "FRD",
        "",
        "What the file's x, y and z axes point to in the vehicle: forward or back, right or left, down or up.",
        shown=True,
    )
    rotation: Matrix | None = key(
        None,
        "",
        "Instead of axes: the matrix that takes vectors of the file to body forward-right-down.",
        example=((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    )
    time_offset_s: Number = key(0.0, "s", "Added to the IMU time stamps.")
    grade: str = key(
        "industrial-mems",
        "",
        "Preset of the sensor errors: consumer, industrial-mems, tactical, navigation, or the name of a sensor. "
        "The keys below override it.",
        shown=True,
    )
    arw_deg_per_sqrt_h: Number | None = key(
        None, "deg/sqrt(h)", "Angular random walk: white noise of the gyroscopes.", least=0.0, example=0.2
    )
    vrw_mps_per_sqrt_h: Number | None = key(
        None, "m/s/sqrt(h)", "Velocity random walk: white noise of the accelerometers.", least=0.0, example=0.1
    )
    gyro_bias_sd_dph: PerAxis | None = key(
        None,
        "deg/h",
        "Standard deviation of the gyro biases at switch-on, one number or one per axis. 0 leaves them out.",
        least=0.0,
        example=30.0,
    )
    gyro_bias_tau_s: Number | None = key(
        None,
        "s",
        "Correlation time of the gyro biases (first-order Gauss-Markov); inf for constants or random walks.",
        above=0.0,
        endless=True,
        example=3600.0,
    )
    gyro_bias_walk_dph_per_sqrt_h: PerAxis | None = key(
        None,
        "deg/h/sqrt(h)",
        "Random walk of the gyro biases; only with gyro_bias_tau_s = inf.",
        least=0.0,
        example=10.0,
    )
    accel_bias_sd_mg: PerAxis | None = key(
        None,
        "1e-3 g",
        "Standard deviation of the accelerometer biases at switch-on, one number or one per axis. 0 leaves them out.",
        least=0.0,
        example=0.15,
    )
    accel_bias_tau_s: Number | None = key(
        None,
        "s",
        "Correlation time of the accelerometer biases; inf for constants or random walks.",
        above=0.0,
        endless=True,
        example=3600.0,
    )
    accel_bias_walk_mg_per_sqrt_h: PerAxis | None = key(
        None,
        "1e-3 g/sqrt(h)",
        "Random walk of the accelerometer biases; only with accel_bias_tau_s = inf.",
        least=0.0,
        example=0.05,
    )
    gyro_scale_sd_ppm: PerAxis | None = key(
        None,
        "ppm",
        "Standard deviation of the gyro scale factors; > 0 adds them to the filter.",
        least=0.0,
        example=300.0,
    )
    gyro_scale_tau_s: Number | None = key(
        None,
        "s",
        "Correlation time of the gyro scale factors; inf for constants.",
        above=0.0,
        endless=True,
        example=3600.0,
    )
    accel_scale_sd_ppm: PerAxis | None = key(
        None,
        "ppm",
        "Standard deviation of the accelerometer scale factors; > 0 adds them to the filter.",
        least=0.0,
        example=300.0,
    )
    accel_scale_tau_s: Number | None = key(
        None,
        "s",
        "Correlation time of the accelerometer scale factors; inf for constants.",
        above=0.0,
        endless=True,
        example=3600.0,
    )
    gyro_cross_sd_mrad: Number | None = key(
        None,
        "mrad",
        "Standard deviation of each gyro cross-coupling (misalignment); > 0 adds six states.",
        least=0.0,
        example=1.0,
    )
    accel_cross_sd_mrad: Number | None = key(
        None,
        "mrad",
        "Standard deviation of each accelerometer cross-coupling (misalignment); > 0 adds six states.",
        least=0.0,
        example=1.0,
    )
    max_gap_s: Number = key(
        2.0,
        "s",
        "Longest hole in the IMU data that is bridged, with a covariance enlarged by what the vehicle may have done; "
        "at least five usual steps.",
        above=0.0,
    )
    on_gap: Literal["continue", "stop"] = key(
        "continue",
        "",
        "At a longer hole: 'continue' starts the navigation anew behind it, with a warning; 'stop' ends with an error.",
    )

    _resolve = field_validator("file")(_in_folder)

    @model_validator(mode="after")
    def _no_contradiction(self) -> ImuConfig:
        if self.rotation is not None and self.axes != "FRD":
            raise ValueError("imu.rotation: given beside imu.axes, which says the same in another way; leave one out")
        for tau, walk in (
            ("gyro_bias_tau_s", "gyro_bias_walk_dph_per_sqrt_h"),
            ("accel_bias_tau_s", "accel_bias_walk_mg_per_sqrt_h"),
        ):
            seconds, density = getattr(self, tau), getattr(self, walk)
            if seconds is not None and math.isfinite(seconds) and density not in (None, 0.0, (0.0, 0.0, 0.0)):
                raise ValueError(f"imu.{walk}: only with imu.{tau} = inf, which is {seconds:g}; leave one of them out")
        return self


class GnssConfig(Section):
    """The GNSS log, where its antenna is, and which fixes to believe."""

    file: Path | None = key(
        None,
        "",
        "GNSS log: a CSV or Parquet table, or an RTKLIB .pos file. Without it: inertial only.",
        example="gnss.csv",
        shown=True,
    )
    use: tuple[Literal["position", "velocity"], ...] = key(
        ("position", "velocity"), "", "Which parts of a fix to use; velocity is skipped where the log has none."
    )
    lever_arm_m: Vector = key(
        (0.0, 0.0, 0.0),
        "m",
        "From the IMU to the antenna: forward, right, down.",
        least=-1000.0,
        most=1000.0,
        shown=True,
    )
    time_offset_s: Number = key(0.0, "s", "Added to the GNSS time stamps.")
    epoch_week_s: tuple[Week, Number] | None = key(
        None,
        "week, s",
        "GPS week and seconds of week that log times count from: gives dates to exports and the page. A .pos file is "
        "turned to it; left out, its times count from the start of its first week.",
        least=0.0,
        example=(2374, 243258.0),
    )
    outages_s: tuple[tuple[Number, Number], ...] = key(
        (), "s", "Windows [from, to) in log time whose fixes are withheld, to measure the drift without them."
    )
    gate_probability: Number = key(
        0.9999,
        "",
        "Share of good fixes that the chi-square gate lets pass; the others are recorded, not used. 1: no gate. Where "
        "the log's standard deviations prove too small, the gate widens with the scatter that it sees.",
        above=0.0,
        most=1.0,
    )
    sd_position_m: Vector | None = key(
        None,
        "m",
        "Standard deviations north, east, down of a position, used where the file has none. Left out: cautious "
        "defaults by the kind of fix.",
        above=0.0,
        example=(3.0, 3.0, 5.0),
    )
    sd_velocity_mps: Vector | None = key(
        None,
        "m/s",
        "Standard deviations north, east, down of a velocity, used where the file has none. Left out: 0.2, 0.2, 0.4.",
        above=0.0,
        example=(0.1, 0.1, 0.15),
    )
    sd_scale: Number = key(
        1.0,
        "",
        "Factor on the standard deviations of the positions of the log, for a receiver that flatters itself.",
        above=0.0,
    )
    velocity_sd_scale: Number = key(
        1.0, "", "Factor on the standard deviations of the velocities of the log.", above=0.0
    )
    sd_floor_m: Number = key(0.0, "m", "Smallest standard deviation of a position, per axis.", least=0.0)

    _resolve = field_validator("file")(_in_folder)

    @field_validator("use")
    @classmethod
    def _some_use(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        if not value:
            raise ValueError("must name at least one; without GNSS leave gnss.file out")
        return tuple(dict.fromkeys(value))

    @field_validator("outages_s")
    @classmethod
    def _ordered(cls, value: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
        for start, end in value:
            if not start < end:
                raise ValueError(f"window [{start:g}, {end:g}] must end after it starts")
        return value


class StartConfig(Section):
    """Where and how the run starts. Every key is optional: what is missing is found from the data."""

    time_s: Number | None = key(None, "s", "Log time at which to start; earlier data are not used.", example=0.0)
    lat_deg: Number | None = key(None, "deg", "Latitude.", least=-90.0, most=90.0, example=30.5)
    lon_deg: Number | None = key(None, "deg", "Longitude, east positive.", least=-180.0, most=360.0, example=114.3)
    height_m: Number | None = key(
        None, "m", "Height above the WGS 84 ellipsoid.", least=-12000.0, most=1e6, example=25.0
    )
    velocity_mps: Vector | None = key(None, "m/s", "Velocity: north, east, down.", example=(0.0, 0.0, 0.0))
    roll_deg: Number | None = key(None, "deg", "Roll, right side down positive.", least=-180.0, most=180.0, example=0.0)
    pitch_deg: Number | None = key(None, "deg", "Pitch, nose up positive.", least=-90.0, most=90.0, example=0.0)
    heading_deg: Number | None = key(
        None, "deg", "Heading, clockwise from true north.", least=-360.0, most=360.0, example=35.0
    )
    sd_position_m: Vector | None = key(
        None,
        "m",
        "Standard deviations of the given position: north, east, down. 5 each if left out.",
        above=0.0,
        example=(1.0, 1.0, 2.0),
    )
    sd_velocity_mps: Vector | None = key(
        None,
        "m/s",
        "Standard deviations of the given velocity. 0.5 each if left out.",
        above=0.0,
        example=(0.05, 0.05, 0.05),
    )
    sd_attitude_deg: Vector | None = key(
        None,
        "deg",
        "Standard deviations of the given roll, pitch, heading. 2, 2, 5 if left out.",
        above=0.0,
        most=180.0,
        example=(0.5, 0.5, 2.0),
    )

    @model_validator(mode="before")
    @classmethod
    def _sd_of_what_is_given(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        whole = dict(data)
        for sd, (values, default) in _STANDARD_DEVIATIONS.items():
            if any(data.get(value) is not None for value in values):
                whole.setdefault(sd, default)
            elif data.get(sd) is not None:
                raise ValueError(f"start.{sd}: given without {' or '.join(f'start.{value}' for value in values)}")
        return whole

    @model_validator(mode="after")
    def _whole(self) -> StartConfig:
        given = [name for name in _POSITION if getattr(self, name) is not None]
        if given and len(given) < 3:
            absent = next(name for name in _POSITION if name not in given)
            raise ValueError(
                f"start.{absent}: missing beside start.{given[0]}; a position needs {', '.join(_POSITION)}"
            )
        return self


class FilterConfig(Section):
    """The estimator."""

    estimator: Literal["ekf", "ukf", "ckf", "iekf", "ukf-feedback-12", "ukf-feedforward-15"] = key(
        "ekf",
        "",
        "Kind of filter: 'ekf' extended, 'ukf' unscented, 'ckf' cubature, 'iekf' iterated extended Kalman filter; "
        "'ukf-feedback-12' and 'ukf-feedforward-15' are configurations with their own states. `navfuse "
        "compare-filters` runs several.",
    )
    frame: Literal["ned", "ecef"] = key(
        "ned", "", "Where to mechanize: 'ned' (not within 0.05 deg of a pole) or 'ecef' (anywhere)."
    )
    feedback: Literal["closed", "open"] = key(
        "closed",
        "",
        "'closed' corrects the mechanization at every fix; 'open' lets it run free and keeps the errors beside it, "
        "for navigation-grade sensors only.",
    )
    covariance_rate_hz: Number | None = key(
        None,
        "Hz",
        "How often the covariance is propagated, at least at every output and measurement; 0: at every IMU sample. "
        "Left out: 10 Hz, which loses nothing measurable.",
        least=0.0,
        example=20.0,
    )
    until_s: Number | None = key(None, "s", "Log time at which to stop; later data are not used.", example=3600.0)
    ukf_alpha: Number | None = key(
        None,
        "",
        "Estimator 'ukf': scale of the distance of the sigma points, alpha sqrt(n + kappa) standard deviations with n "
        "states. Left out: sqrt(3) standard deviations whatever n is.",
        above=0.0,
        example=1.0,
    )
    ukf_beta: Number | None = key(
        None,
        "",
        "Estimator 'ukf': weight of the centre in the covariance. Left out: 2, for a normal distribution.",
        example=2.0,
    )
    ukf_kappa: Number | None = key(
        None,
        "",
        "Estimator 'ukf': added to the number of states in the distance of the points; without ukf_alpha of no effect "
        "on it. Left out: 0.",
        example=0.0,
    )

    @model_validator(mode="after")
    def _of_the_unscented(self) -> FilterConfig:
        for name in ("ukf_alpha", "ukf_beta", "ukf_kappa"):
            if getattr(self, name) is not None and self.estimator != "ukf":
                raise ValueError(
                    f'filter.{name}: places the sigma points of estimator = "ukf"; with "{self.estimator}" leave it out'
                )
        return self


class SmootherConfig(Section):
    """The second pass, back in time."""

    method: Literal["rts", "none"] = key(
        "rts",
        "",
        "'rts' makes every epoch use the whole log (Rauch-Tung-Striebel); 'none' leaves the filter's solution.",
    )


class AidingConfig(Section):
    """What else is known about the motion."""

    zero_velocity: Literal["auto", "off"] = key(
        "auto", "", "Use of standstills; not built yet, so that both values have no effect."
    )
    nonholonomic: bool = key(False, "", "Whether the vehicle can neither slip sideways nor leave the road.")

    @field_validator("nonholonomic")
    @classmethod
    def _available(cls, value: bool) -> bool:
        if value:
            raise ValueError("the land vehicle constraint is not available yet; leave it false")
        return value


class OutputConfig(Section):
    """What is written."""

    rate_hz: Number = key(
        10.0, "Hz", "Rate of the output trajectories; 0 for every IMU sample.", least=0.0, most=1000.0
    )
    formats: tuple[str, ...] = key(
        ("parquet",),
        "",
        f"Formats of the tables: {', '.join(FORMATS)} (parquet where neither is named); and of the best trajectory for "
        f"other programs: {', '.join(EXPORTS)}.",
        shown=True,
    )
    export_point: Literal["imu", "antenna"] | Vector = key(
        "imu",
        "",
        "Whose trajectory the other programs get: 'imu', 'antenna', or a lever arm from the IMU [m]: forward, right, "
        "down.",
        least=-1000.0,
        most=1000.0,
    )
    export_rate_hz: Number | None = key(
        None,
        "Hz",
        "Rate of the trajectories for other programs. Left out: that of the tables.",
        above=0.0,
        most=1000.0,
        example=1.0,
    )
    export_height: Literal["ellipsoid", "geoid"] = key(
        "ellipsoid", "", "Heights in pos and sbet; kml, gpx and nmea have the geoid, geojson the ellipsoid in any case."
    )
    export_geoid: Literal["egm96", "egm2008"] = key(
        "egm96", "", "Which geoid: 'egm96' comes along, 'egm2008' needs the grid of PROJ."
    )

    @field_validator("formats")
    @classmethod
    def _known(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        for name in value:
            if name not in (*FORMATS, *EXPORTS):
                known = ", ".join((*FORMATS, *EXPORTS))
                raise ValueError(f'"{name}" is not a format that can be written; there are {known}')
        if not value:
            raise ValueError(f"must name at least one of {', '.join(FORMATS)}")
        return tuple(dict.fromkeys(value))

    @property
    def tables(self) -> tuple[str, ...]:
        """Formats of the tables: those named, or Parquet."""
        return tuple(name for name in self.formats if name in FORMATS) or FORMATS[:1]

    @property
    def exports(self) -> tuple[str, ...]:
        """Formats of other programs."""
        return tuple(name for name in self.formats if name in EXPORTS)
