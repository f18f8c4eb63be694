"""A magnetometer fixed to the body: the field of the Earth, the iron about it, and the errors of the sensor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from navfuse.core.printed_keys import shown
from navfuse.core.rotation import dcm_from_quat_batch
from navfuse.data.aiding_logs import MagnetometerLog
from navfuse.errors import ConfigError
from navfuse.io.earth_magnetism import magnetic_field_along
from navfuse.simulation.printed_fields import (
    any_number,
    frozen,
    numbers,
    one_number,
    tau,
    three_numbers,
    three_sizes,
    windows,
)
from navfuse.simulation.sampled_sensor import (
    SAMPLING_UNITS,
    SampledSensor,
    boxes,
    level_to_body,
    need_each_other,
    need_tau,
    random_boxes,
    rounded,
)
from navfuse.simulation.sensors import gauss_markov
from navfuse.simulation.streams import Streams

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from navfuse.simulation.motion import Motion

Array = np.ndarray

_MICROTESLA, _NANOTESLA, _DEGREE = 1e-6, 1e-9, np.pi / 180.0


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MagnetometerModel(SampledSensor):
    """Errors of a three-axis magnetometer, SI units; zero means absent.

    Fields marked *axes* take a number or three: body x, y, z.

    Attributes
    ----------
    rate, offset, latency : see :class:`~navfuse.simulation.sampled_sensor.SampledSensor`.
    field : (3,) array [T] or None
        Field of the Earth, north, east and down, the same everywhere; None for the World Magnetic Model, which needs
        the package pygeomag.
    year : float
        Decimal year of the World Magnetic Model, 2010 <= year < 2030.
    hard_iron, hard_iron_sd : (3,) array [T], axes [T]
        Given offset of magnetised parts, which turn with the body, and standard deviation of the part drawn once per
        run. Typical: 5 to 50 uT uncalibrated in a car, 0.5 uT left by a calibration (our estimate).
    soft_iron, soft_iron_sd : (3, 3) array [1], float [1]
        Matrix by which parts that are magnetised by the field change it, and standard deviation of what is drawn on
        each of its nine elements. Typical: 0.02 to 0.1, a hundredth left by a calibration (our estimate).
    scale_sd, misalignment_sd : axes [1], float [rad]
        Scale factors, and small angles between the sensor's axes and those of the body (six elements, so that the axes
        are not square to one another either), drawn once per run. Typical: 0.5 %, 0.5 deg (our estimate).
    field_sd : axes [T]
        White noise. Typical: 15 nT (PNI RM3100 at 200 cycle counts) to 0.3 uT (Bosch BMM150).
    correlated_sd, correlated_tau : axes [T], float [s]
        Stationary first-order Gauss-Markov disturbance in body axes: currents, the surroundings passing by. Typical: 1
        uT over 10 s in a car (our estimate).
    disturbances, disturbance, disturbance_frame : (m, 2) array [s], (m, 3) array [T], "body" or "level"
        Windows [from, to) of motion time in which an offset is added, in body axes or north, east, down.
    disturbance_frequency, disturbance_mean, disturbance_sd : float [1/s], [s], axes [T]
        Random offsets besides, in the same axes: mean number per time (Poisson), mean length (exponential), standard
        deviation. Typical of a city (our estimate): 60 per hour, 5 s, 10 uT.
    field_lsb : float [T]
        Step of rounding. Typical: 13 nT (PNI RM3100 at 200 cycle counts), 0.3 uT (Bosch BMM150).

    Raises
    ------
    ConfigError
        On construction, for a value that is negative, not finite or of the wrong shape, or one that lacks another.
    """

    WHAT: ClassVar[str] = "magnetometer"
    UNITS: ClassVar[dict[str, tuple[str, float]]] = SAMPLING_UNITS | {
        "field_ut": ("field", _MICROTESLA),
        "field_nt": ("field", _NANOTESLA),
        "hard_iron_ut": ("hard_iron", _MICROTESLA),
        "hard_iron_sd_ut": ("hard_iron_sd", _MICROTESLA),
        "soft_iron_sd_percent": ("soft_iron_sd", 1e-2),
        "scale_sd_percent": ("scale_sd", 1e-2),
        "scale_sd_ppm": ("scale_sd", 1e-6),
        "misalignment_sd_deg": ("misalignment_sd", _DEGREE),
        "field_sd_ut": ("field_sd", _MICROTESLA),
        "field_sd_nt": ("field_sd", _NANOTESLA),
        "correlated_sd_ut": ("correlated_sd", _MICROTESLA),
        "correlated_sd_nt": ("correlated_sd", _NANOTESLA),
        "correlated_tau_s": ("correlated_tau", 1.0),
        "disturbances_s": ("disturbances", 1.0),
        "disturbance_ut": ("disturbance", _MICROTESLA),
        "disturbances_per_h": ("disturbance_frequency", 1.0 / 3600.0),
        "disturbance_mean_s": ("disturbance_mean", 1.0),
        "disturbance_sd_ut": ("disturbance_sd", _MICROTESLA),
        "field_lsb_ut": ("field_lsb", _MICROTESLA),
        "field_lsb_nt": ("field_lsb", _NANOTESLA),
    }
    WORDS: ClassVar[tuple[str, ...]] = ("year", "soft_iron", "disturbance_frame")

    rate: float = 10.0
    field: ArrayLike | None = None
    year: float = 2026.0
    hard_iron: ArrayLike = (0.0, 0.0, 0.0)
    hard_iron_sd: ArrayLike = 0.0
    soft_iron: ArrayLike = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    soft_iron_sd: float = 0.0
    scale_sd: ArrayLike = 0.0
    misalignment_sd: float = 0.0
    field_sd: ArrayLike = 0.0
    correlated_sd: ArrayLike = 0.0
    correlated_tau: float = 0.0
    disturbances: ArrayLike = ()
    disturbance: ArrayLike = ()
    disturbance_frame: str = "body"
    disturbance_frequency: float = 0.0
    disturbance_mean: float = 0.0
    disturbance_sd: ArrayLike = 0.0
    field_lsb: float = 0.0

    def __post_init__(self) -> None:
        self._settle(field=_field, year=any_number, hard_iron=three_numbers, soft_iron=_matrix, disturbances=windows)
        self._settle(
            **dict.fromkeys(("hard_iron_sd", "scale_sd", "field_sd", "correlated_sd", "disturbance_sd"), three_sizes)
        )
        sizes = ("soft_iron_sd", "misalignment_sd", "disturbance_frequency", "disturbance_mean", "field_lsb")
        self._settle(**dict.fromkeys(sizes, one_number), correlated_tau=tau)
        need_tau("correlated_sd", self.correlated_sd, "correlated_tau", self.correlated_tau)
        offsets = numbers("disturbance", self.disturbance)
        offsets = offsets.reshape(0, 3) if offsets.size == 0 else np.atleast_2d(offsets)
        count = len(self.values("disturbances"))
        if offsets.shape != (count, 3) or not np.all(np.isfinite(offsets)):
            raise ConfigError(
                f"disturbance must give three finite numbers for each of the {count} windows of disturbances, not "
                f"{shown(self.disturbance)}"
            )
        object.__setattr__(self, "disturbance", frozen(offsets))
        if self.disturbance_frame not in ("body", "level"):
            raise ConfigError(f"disturbance_frame must be 'body' or 'level', not {shown(self.disturbance_frame)}")
        need_each_other(
            "random disturbances",
            disturbance_frequency=self.disturbance_frequency,
            disturbance_mean=self.disturbance_mean,
            disturbance_sd=float(np.max(self.disturbance_sd)),
        )


@dataclass(frozen=True, slots=True, eq=False)
class MagnetometerTruth:
    """What was added: before rounding, the log is ``M (S (field + disturbance) + hard_iron) + noise``.

    Attributes
    ----------
    true_time : (n,) array [s]
        When each row was measured; its stamp is later by the latency.
    field_b : (n, 3) array [T]
        Of the Earth alone, in body axes.
    field_n : (n, 3) array [T]
        The same north, east, down; ``atan2(east, north)`` is the declination.
    disturbance_b : (n, 3) array [T]
        Gauss-Markov disturbance, listed and random ones.
    hard_iron : (3,) array [T]
    soft_iron : (3, 3) array [1]
        S.
    sensor : (3, 3) array [1]
        M: one plus scale factors and misalignment.
    noise : (n, 3) array [T]
    """

    true_time: Array
    field_b: Array
    field_n: Array
    disturbance_b: Array
    hard_iron: Array
    soft_iron: Array
    sensor: Array
    noise: Array


def measure_magnetometer(
    motion: Motion, model: MagnetometerModel, rng: np.random.Generator
) -> tuple[MagnetometerLog, MagnetometerTruth]:
    """Magnetic field in body axes as a real magnetometer would have written it.

    Parameters
    ----------
    motion : Motion
        Of the IMU, in whose place the magnetometer is.
    model : MagnetometerModel
    rng : numpy Generator
        Advanced only by spawning children, one per error.

    Returns
    -------
    log : MagnetometerLog
    truth : MagnetometerTruth

    Raises
    ------
    InputError
        When the motion ends before the first sample, or leaves the heights of the World Magnetic Model.
    ConfigError
        When the World Magnetic Model is asked for a year it does not cover, or pygeomag is not installed.
    """
    names = (
        "hard_iron", "soft_iron", "scale", "misalignment", "noise", "correlated", "disturbance_times", "disturbance",
    )  # fmt: skip
    draws = Streams(rng, names)
    time = model.sample_times(motion)
    field_b, field_n = _earth_field(motion, time, model)
    offsets = boxes(time, model.values("disturbances"), model.values("disturbance"))
    offsets += random_boxes(
        time,
        model.disturbance_frequency,
        model.disturbance_mean,
        model.values("disturbance_sd"),
        draws["disturbance_times"],
        draws["disturbance"],
    )
    if model.disturbance_frame == "level" and offsets.any():
        offsets = level_to_body(motion, time, offsets)
    disturbance = offsets + gauss_markov(time, model.correlated_sd, model.correlated_tau, 0.0, draws["correlated"])
    hard_iron = model.values("hard_iron") + model.values("hard_iron_sd") * draws["hard_iron"].standard_normal(3)
    soft_iron = model.values("soft_iron") + model.soft_iron_sd * draws["soft_iron"].standard_normal((3, 3))
    sensor = model.misalignment_sd * draws["misalignment"].standard_normal((3, 3))
    np.fill_diagonal(sensor, 1.0 + model.values("scale_sd") * draws["scale"].standard_normal(3))
    noise = model.values("field_sd") * draws["noise"].standard_normal((time.size, 3))
    measured = ((field_b + disturbance) @ soft_iron.T + hard_iron) @ sensor.T + noise
    log = MagnetometerLog(time + model.latency, rounded(measured, model.field_lsb), source="simulation")
    return log, MagnetometerTruth(time, field_b, field_n, disturbance, hard_iron, soft_iron, sensor, noise)


def _earth_field(motion: Motion, time: Array, model: MagnetometerModel) -> tuple[Array, Array]:
    """In body axes and north-east-down."""
    if model.field is not None:
        return level_to_body(motion, time, model.field), np.tile(np.asarray(model.field), (time.size, 1))
    state = motion.at(time)
    field_b = np.einsum("kji,kj->ki", dcm_from_quat_batch(state.q_eb), magnetic_field_along(state.r_e, model.year))
    return field_b, np.einsum("kij,kj->ki", motion.C_nb(time), field_b)


def _field(name: str, value: Any) -> Array | None:
    return None if value is None else three_numbers(name, value)


def _matrix(name: str, value: Any) -> Array:
    matrix = numbers(name, value)
    if matrix.shape != (3, 3) or not np.all(np.isfinite(matrix)):
        raise ConfigError(f"{name} must be a 3 x 3 matrix of finite numbers, not {shown(value)}")
    if not np.linalg.det(matrix) > 0.0:
        raise ConfigError(f"{name} must have a positive determinant, or the field could not be told from it")
    return frozen(matrix)
