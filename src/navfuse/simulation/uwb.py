"""Ranges to fixed radio anchors, polled one after the other, with bias, noise and detours of the signal."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from navfuse.core.earth import geodetic_to_ecef_batch
from navfuse.core.printed_keys import shown
from navfuse.data.aiding_logs import UwbAnchors, UwbLog
from navfuse.errors import ConfigError, InputError
from navfuse.simulation.printed_fields import any_number, one_number, one_or_several, three_numbers, unknown_key
from navfuse.simulation.sampled_sensor import (
    SAMPLING_UNITS,
    SampledSensor,
    need_each_other,
    rounded,
    stated_sd,
)
from navfuse.simulation.sensors import antenna_state
from navfuse.simulation.streams import Streams

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from navfuse.simulation.motion import Motion

Array = np.ndarray


@dataclass(frozen=True, slots=True)
class UwbAnchor:
    """A radio anchor.

    Attributes
    ----------
    name : str
    lat_deg, lon_deg, height_m : float [deg], [deg], [m]
        On WGS 84, ellipsoidal height.

    Raises
    ------
    ConfigError
        For an empty name, or a position that is missing, not finite or not on Earth.
    """

    name: str
    lat_deg: float
    lon_deg: float
    height_m: float

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name.strip():
            raise ConfigError(f"an anchor needs a name, not {self.name!r}")
        for key, limit in (("lat_deg", 90.0), ("lon_deg", 360.0), ("height_m", math.inf)):
            value = any_number(f"{key} of anchor {self.name!r}", getattr(self, key))
            if abs(value) > limit:
                raise ConfigError(f"{key} of anchor {self.name!r} must be within +-{limit:g}, not {value:g}")
            object.__setattr__(self, key, value)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class UwbModel(SampledSensor):
    """Errors of ranges to radio anchors, SI units; zero means absent.

    Attributes
    ----------
    rate, offset, latency : see :class:`~navfuse.simulation.sampled_sensor.SampledSensor`.
        `rate` counts single ranges: each anchor is polled at the rate over their number, in their order.
    anchors : tuple of UwbAnchor, or of mappings with its fields
        At least one.
    lever_arm : (3,) array [m]
        IMU to the antenna, body forward-right-down.
    bias, bias_sd : number or one per anchor [m]
        Given part of the offset, and standard deviation of the part drawn once per run and anchor. Typical: 0.1 m from
        antenna delays that were not calibrated (our estimate).
    range_sd : float [m]
        White noise. Typical: 0.1 m (our estimate).
    nlos_fraction, nlos_mean : float [1], [m]
        Chance that a signal does not come straight (no line of sight), and the mean of the detour, which is
        exponentially distributed. Typical indoors: 10 %, 0.5 m (our estimate).
    max_range : float [m]
        Beyond it a poll stays without answer; inf: never. Typical: 50 to 300 m (our estimate).
    range_lsb : float [m]
        Step of rounding. Typical: 0.01 m (our estimate).
    stated_sigma_factor : float
        Stated sigma over the true one of noise and rounding together; 0 leaves the column out. Bias and detours are not
        in it.

    Raises
    ------
    ConfigError
        On construction, for no anchor, two of one name, or a value that is negative, not finite or of the wrong shape.
    """

    WHAT: ClassVar[str] = "uwb ranges"
    UNITS: ClassVar[dict[str, tuple[str, float]]] = SAMPLING_UNITS | {
        "lever_arm_m": ("lever_arm", 1.0),
        "bias_m": ("bias", 1.0),
        "bias_sd_m": ("bias_sd", 1.0),
        "range_sd_m": ("range_sd", 1.0),
        "range_sd_cm": ("range_sd", 1e-2),
        "nlos_percent": ("nlos_fraction", 1e-2),
        "nlos_mean_m": ("nlos_mean", 1.0),
        "max_range_m": ("max_range", 1.0),
        "range_lsb_m": ("range_lsb", 1.0),
        "range_lsb_cm": ("range_lsb", 1e-2),
        "stated_sigma_factor": ("stated_sigma_factor", 1.0),
    }
    WORDS: ClassVar[tuple[str, ...]] = ("anchors",)

    rate: float = 10.0
    anchors: tuple[UwbAnchor, ...] = ()
    lever_arm: ArrayLike = (0.0, 0.0, 0.0)
    bias: ArrayLike = 0.0
    bias_sd: ArrayLike = 0.0
    range_sd: float = 0.0
    nlos_fraction: float = 0.0
    nlos_mean: float = 0.0
    max_range: float = math.inf
    range_lsb: float = 0.0
    stated_sigma_factor: float = 1.0

    def __post_init__(self) -> None:
        self._settle(anchors=_anchors)
        per_anchor = partial(one_or_several, count=len(self.anchors), what="anchors")
        sizes = ("range_sd", "nlos_fraction", "nlos_mean", "range_lsb", "stated_sigma_factor")
        self._settle(
            lever_arm=three_numbers,
            bias=per_anchor,
            bias_sd=partial(per_anchor, least=0.0),
            **dict.fromkeys(sizes, one_number),
        )
        self._settle(max_range=partial(one_number, above=True, infinite=True))
        if self.nlos_fraction > 1.0:
            raise ConfigError(f"nlos_fraction must be a chance of at most 1 (100 %), not {self.nlos_fraction:g}")
        need_each_other("detours", nlos_fraction=self.nlos_fraction, nlos_mean=self.nlos_mean)

    def anchor_table(self) -> UwbAnchors:
        """The anchors as a table to be written beside the log."""
        lat, lon, height = (
            np.array([getattr(anchor, key) for anchor in self.anchors]) for key in ("lat_deg", "lon_deg", "height_m")
        )
        names = np.array([anchor.name for anchor in self.anchors])
        return UwbAnchors(names, np.radians(lat), np.radians(lon), height, source="simulation")


@dataclass(frozen=True, slots=True, eq=False)
class UwbTruth:
    """What was added: before rounding, the log is ``range + bias[anchor] + nlos + noise``, and never negative.

    Attributes
    ----------
    true_time : (n,) array [s]
        When each row was measured; its stamp is later by the latency.
    anchor : (n,) int array
        Row of the table of anchors.
    range : (n,) array [m]
        Without errors.
    bias : (m,) array [m]
        Of every anchor.
    nlos, noise : (n,) arrays [m]
    """

    true_time: Array
    anchor: Array
    range: Array
    bias: Array
    nlos: Array
    noise: Array


def measure_uwb(motion: Motion, model: UwbModel, rng: np.random.Generator) -> tuple[UwbLog, UwbTruth]:
    """Ranges as a real radio would have written them.

    Parameters
    ----------
    motion : Motion
        Of the IMU.
    model : UwbModel
    rng : numpy Generator
        Advanced only by spawning children, one per error.

    Returns
    -------
    log : UwbLog
        Polls without answer have no row.
    truth : UwbTruth

    Raises
    ------
    InputError
        When the motion ends before the first poll, or all anchors are out of reach all the time.
    """
    draws = Streams(rng, ("bias", "noise", "nlos_times", "nlos"))
    time = model.sample_times(motion)
    table = model.anchor_table()
    anchor = np.arange(time.size) % table.name.size
    places = geodetic_to_ecef_batch(table.lat, table.lon, table.height)
    distance = np.linalg.norm(antenna_state(motion, time, model.lever_arm)[0] - places[anchor], axis=1)
    drawn = np.array([stream.standard_normal() for stream in draws["bias"].spawn(len(places))])
    bias = model.values("bias") + model.values("bias_sd") * drawn
    noise = model.range_sd * draws["noise"].standard_normal(time.size)
    detour = draws["nlos_times"].uniform(size=time.size) < model.nlos_fraction
    nlos = detour * model.nlos_mean * draws["nlos"].standard_exponential(time.size)
    heard = distance <= model.max_range
    if not heard.any():
        raise InputError(
            f"no anchor is within {model.max_range:g} m, the nearest one is {distance.min():.4g} m away; give anchors "
            "near the motion"
        )
    time, anchor, distance, nlos, noise = time[heard], anchor[heard], distance[heard], nlos[heard], noise[heard]
    measured = rounded(np.maximum(distance + bias[anchor] + nlos + noise, 0.0), model.range_lsb)
    total = math.hypot(model.range_sd, model.range_lsb / math.sqrt(12.0))
    sd = stated_sd(model.stated_sigma_factor, total, time.shape)
    log = UwbLog(time + model.latency, table.name[anchor], measured, sd, source="simulation")
    return log, UwbTruth(time, anchor, distance, bias, nlos, noise)


def _anchors(name: str, value: Any) -> tuple[UwbAnchor, ...]:
    known = [field.name for field in dataclasses.fields(UwbAnchor)]
    anchors = []
    if isinstance(value, (str, Mapping)) or not isinstance(value, Iterable):
        raise ConfigError(f"{name} must be a list, not {shown(value)}")
    for given in value:
        if isinstance(given, Mapping):
            for key in given:
                if key not in known:
                    raise unknown_key(name, key, known)
            if missing := [key for key in known if key not in given]:
                raise ConfigError(f"{name}: {dict(given)!r} lacks {', '.join(missing)}")
            anchors.append(UwbAnchor(**given))
        elif isinstance(given, UwbAnchor):
            anchors.append(given)
        else:
            raise ConfigError(f"{name} must hold UwbAnchor or tables of its fields, not {type(given).__name__}")
    names = [anchor.name for anchor in anchors]
    if not names:
        raise ConfigError("anchors must name at least one anchor")
    for anchor in names:
        if names.count(anchor) > 1:
            raise ConfigError(f"the anchor {anchor!r} is there twice; give it another name")
    return tuple(anchors)
