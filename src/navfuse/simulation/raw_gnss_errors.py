"""The errors of pseudo-ranges and range rates: clocks, orbits, atmosphere, noise, reflections, a sky in part hidden."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from navfuse.core.constants import LIGHT_SPEED
from navfuse.core.printed_keys import naming_keys, shown
from navfuse.errors import ConfigError
from navfuse.gnss.almanac import read_almanac
from navfuse.gnss.orbits import Constellation, gps_constellation, workshop_constellation
from navfuse.simulation.bounds import sampling_rate
from navfuse.simulation.printed_fields import one_number, tables, things, to_fields, windows
from navfuse.simulation.sky import SatelliteOutage, SkySector, outage_of, sector_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike

Array = np.ndarray

RAW_GNSS_UNITS: dict[str, tuple[str, float]] = {
    "rate_hz": ("rate", 1.0),
    "offset_s": ("offset", 1.0),
    "latency_s": ("latency", 1.0),
    "latency_ms": ("latency", 1e-3),
    "constellation_start_s": ("constellation_start", 1.0),
    "clock_offset_m": ("clock_offset", 1.0),
    "clock_offset_us": ("clock_offset", 1e-6 * LIGHT_SPEED),
    "clock_drift_mps": ("clock_drift", 1.0),
    "clock_drift_ppb": ("clock_drift", 1e-9 * LIGHT_SPEED),
    "clock_phase_psd_m2_per_s": ("clock_phase_psd", 1.0),
    "clock_frequency_psd_m2_per_s3": ("clock_frequency_psd", 1.0),
    "signal_sd_m": ("signal_sd", 1.0),
    "signal_tau_s": ("signal_tau", 1.0),
    "ionosphere_sd_m": ("ionosphere_sd", 1.0),
    "ionosphere_tau_s": ("ionosphere_tau", 1.0),
    "ionosphere_zenith_m": ("ionosphere_zenith", 1.0),
    "troposphere_sd_m": ("troposphere_sd", 1.0),
    "troposphere_tau_s": ("troposphere_tau", 1.0),
    "code_sd_m": ("code_sd", 1.0),
    "code_elevation_sd_m": ("code_elevation_sd", 1.0),
    "multipath_sd_m": ("multipath_sd", 1.0),
    "multipath_tau_s": ("multipath_tau", 1.0),
    "range_rate_sd_mps": ("range_rate_sd", 1.0),
    "range_rate_sd_cmps": ("range_rate_sd", 1e-2),
    "range_rate_elevation_sd_mps": ("range_rate_elevation_sd", 1.0),
    "range_rate_elevation_sd_cmps": ("range_rate_elevation_sd", 1e-2),
    "outlier_percent": ("outlier_share", 1e-2),
    "outlier_s": ("outlier_length", 1.0),
    "outlier_from_m": ("outlier_from", 1.0),
    "outlier_to_m": ("outlier_to", 1.0),
    "cn0_zenith_dbhz": ("cn0_zenith", 1.0),
    "cn0_horizon_dbhz": ("cn0_horizon", 1.0),
    "cn0_sd_db": ("cn0_sd", 1.0),
    "elevation_mask_deg": ("elevation_mask", math.pi / 180.0),
    "outages_s": ("outages", 1.0),
    "stated_sigma_factor": ("stated_sigma_factor", 1.0),
    "stated_least_m": ("stated_least_range", 1.0),
    "stated_least_mps": ("stated_least_rate", 1.0),
}
"""Key with its printed unit -> (field of :class:`RawGnssModel`, factor to SI). Beside them stand ``constellation``,
``n_satellites``, ``corrected``, ``sectors`` and ``satellite_outages``."""

_SIZES = (
    "offset", "clock_phase_psd", "clock_frequency_psd", "signal_sd", "ionosphere_sd", "ionosphere_zenith",
    "troposphere_sd", "code_sd", "code_elevation_sd", "multipath_sd", "range_rate_sd", "range_rate_elevation_sd",
    "outlier_length", "cn0_zenith", "cn0_horizon", "cn0_sd",
)  # fmt: skip
_POSITIVE = ("stated_sigma_factor", "stated_least_range", "stated_least_rate")
_SIGNED = ("latency", "constellation_start", "clock_offset", "clock_drift", "outlier_from", "outlier_to")
_CORRELATED = ("signal", "ionosphere", "troposphere", "multipath")
_MOST_OUTLIERS = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class RawGnssModel:
    """Errors of a receiver that gives pseudo-ranges and range rates, SI units; zero means absent.

    Times are those of the motion. A slow error is a stationary first-order Gauss-Markov process with a correlation time
    > 0 (inf: constant). Slow errors of the pseudo-range are not in the range rate.

    Attributes
    ----------
    constellation : Constellation
    constellation_start : float [s]
        Time of the constellation at time zero of the motion: another sky for each.
    rate, offset : float [Hz], [s]
        Epochs per second, and how long after the start of the motion the first one is measured.
    latency : float [s]
        How late the stamps are; negative if early.
    clock_offset, clock_drift : float [m], [m/s]
        Of the receiver clock at the first epoch, times the speed of light; positive where it is ahead and gains.
    clock_phase_psd, clock_frequency_psd : float [m^2/s], [m^2/s^3]
        White noise that drives offset and drift: ``c^2 h0 / 2`` and ``2 pi^2 c^2 h_-2``. Typical of a temperature
        compensated quartz: 0.009 and 0.035, of ``h0`` = 2e-19 s and ``h_-2`` = 2e-20 / s (usual figures).
    signal_sd, signal_tau : float [m], [s]
        What broadcast orbit and clock leave, per satellite.
    ionosphere_sd, ionosphere_tau : float [m], [s]
        What a model of the ionosphere leaves at the zenith: one for all satellites, times their obliquity.
    ionosphere_zenith : float [m]
        Whole delay at the zenith, in the pseudo-ranges where they are not `corrected`. Typical: 2 m at night to 10 m
        and more at noon on L1.
    troposphere_sd, troposphere_tau : float [m], [s]
        What a model of the troposphere leaves at the zenith: one for all satellites, times their mapping.
    corrected : bool
        Whether the delays of ionosphere and troposphere (standard atmosphere) are taken out, so that the two residuals
        alone are left. The satellite clock is always taken out.
    code_sd, code_elevation_sd : float [m]
        White noise of the pseudo-range, of variance ``code_sd^2 + (code_elevation_sd / sin(el))^2`` (the form of
        RTKLIB's carrier noise, 2.4.2 manual, E.6.4).
    multipath_sd, multipath_tau : float [m], [s]
        Slow reflections, per satellite.
    range_rate_sd, range_rate_elevation_sd : float [m/s]
        White noise of the range rate, as for the code.
    outlier_share, outlier_length : float, float [s]
        Chance of a pseudo-range to be an outlier, and how long each lasts (0: one epoch). They begin at random, per
        satellite; a new one takes the place of an old one.
    outlier_from, outlier_to : float [m]
        The size of each is drawn evenly between these; reflections without a direct signal are positive.
    cn0_zenith, cn0_horizon, cn0_sd : float [dB-Hz], [dB-Hz], [dB]
        Carrier power over noise density, in between linear in ``sin(el)``, and its white scatter. For the record only:
        no error depends on it.
    elevation_mask : float [rad]
        Satellites lower than this are not tracked, 0 <= mask < pi / 2.
    sectors : tuple of SkySector
    outages : (m, 2) array [s]
        Windows [from, to) without any satellite.
    satellite_outages : tuple of SatelliteOutage
    stated_sigma_factor : float
        Stated over true standard deviation, where the true one is that of all errors but outliers. 1 is honest.
    stated_least_range, stated_least_rate : float [m], [m/s]
        The stated standard deviations are at least this, which a log without errors needs.

    Raises
    ------
    ConfigError
        On construction, for a value that is negative, not finite or otherwise out of range, a slow error without
        correlation time, outliers without size, or an outage of a satellite that there is not.
    """

    constellation: Constellation = field(default_factory=gps_constellation)
    constellation_start: float = 0.0
    rate: float = 1.0
    offset: float = 0.0
    latency: float = 0.0
    clock_offset: float = 0.0
    clock_drift: float = 0.0
    clock_phase_psd: float = 0.0
    clock_frequency_psd: float = 0.0
    signal_sd: float = 0.0
    signal_tau: float = 0.0
    ionosphere_sd: float = 0.0
    ionosphere_tau: float = 0.0
    ionosphere_zenith: float = 0.0
    troposphere_sd: float = 0.0
    troposphere_tau: float = 0.0
    corrected: bool = True
    code_sd: float = 0.0
    code_elevation_sd: float = 0.0
    multipath_sd: float = 0.0
    multipath_tau: float = 0.0
    range_rate_sd: float = 0.0
    range_rate_elevation_sd: float = 0.0
    outlier_share: float = 0.0
    outlier_length: float = 0.0
    outlier_from: float = 0.0
    outlier_to: float = 0.0
    cn0_zenith: float = 48.0
    cn0_horizon: float = 35.0
    cn0_sd: float = 0.0
    elevation_mask: float = math.radians(5.0)
    sectors: tuple[SkySector, ...] = ()
    outages: ArrayLike = ()
    satellite_outages: tuple[SatelliteOutage, ...] = ()
    stated_sigma_factor: float = 1.0
    stated_least_range: float = 0.01
    stated_least_rate: float = 0.001

    def __post_init__(self) -> None:
        checked: dict[str, Any] = {name: one_number(name, getattr(self, name)) for name in _SIZES}
        checked |= {name: one_number(name, getattr(self, name), above=True) for name in _POSITIVE}
        checked |= {name: one_number(name, getattr(self, name), least=-math.inf) for name in _SIGNED}
        checked["rate"] = sampling_rate("rate", self.rate)
        for name in _CORRELATED:
            checked[f"{name}_tau"] = one_number(f"{name}_tau", getattr(self, f"{name}_tau"), infinite=True)
            if checked[f"{name}_sd"] > 0.0 and not checked[f"{name}_tau"] > 0.0:
                raise ConfigError(f"{name}_sd needs {name}_tau > 0 (inf for a constant)")
        checked["elevation_mask"] = one_number("elevation_mask", self.elevation_mask)
        if not checked["elevation_mask"] < 0.5 * math.pi:
            raise ConfigError("elevation_mask must be below 90 deg, or no satellite is left")
        checked["outlier_share"] = one_number("outlier_share", self.outlier_share)
        if checked["outlier_share"] > _MOST_OUTLIERS:
            raise ConfigError(f"outlier_share must be at most {_MOST_OUTLIERS:g}, not {shown(self.outlier_share)}")
        if checked["outlier_from"] > checked["outlier_to"]:
            raise ConfigError("outlier_from must not be above outlier_to")
        if checked["outlier_share"] > 0.0 and checked["outlier_from"] == checked["outlier_to"] == 0.0:
            raise ConfigError("outliers need a size: give outlier_from and outlier_to")
        if not isinstance(self.corrected, bool):
            raise ConfigError(f"corrected must be true or false, not {shown(self.corrected)}")
        if self.corrected and checked["ionosphere_zenith"] > 0.0:
            raise ConfigError("ionosphere_zenith needs corrected = false: corrected pseudo-ranges do not contain it")
        if not isinstance(self.constellation, Constellation):
            raise ConfigError(f"constellation must be a Constellation, not {self.constellation!r}")
        checked["outages"] = windows("outages", self.outages)
        for name, kind in (("sectors", SkySector), ("satellite_outages", SatelliteOutage)):
            checked[name] = things(name, getattr(self, name), kind)
        for outage in checked["satellite_outages"]:
            self.constellation.index(outage.satellite)
        for name, value in checked.items():
            object.__setattr__(self, name, value)

    @classmethod
    def from_datasheet(
        cls,
        /,
        constellation: str | Constellation = "gps",
        n_satellites: int | None = None,
        corrected: bool = True,
        sectors: Sequence[SkySector | Mapping[str, Any]] = (),
        satellite_outages: Sequence[SatelliteOutage | Mapping[str, Any]] = (),
        **printed: Any,
    ) -> RawGnssModel:
        """A model from keys that end in their unit.

        Parameters
        ----------
        constellation : {"gps", "workshop"}, file name or Constellation
            The nominal GPS, the one of the exercises, or an almanac (YUMA or SEM).
        n_satellites : int, optional
            24 to 32, of "gps" alone; default 24.
        corrected : bool
        sectors : sequence of SkySector, or of mappings with its keys
        satellite_outages : sequence of SatelliteOutage, or of mappings with its fields
        **printed : number or array
            Keys of :data:`RAW_GNSS_UNITS`.

        Raises
        ------
        ConfigError
            For an unknown key or unit (the nearest is named), a field given in two units, or a value the model refuses.
        InputError
            For an almanac that cannot be read.

        Examples
        --------
        >>> model = RawGnssModel.from_datasheet(code_sd_m=2.0, range_rate_sd_cmps=2.0, rate_hz=2.0)
        >>> model.range_rate_sd
        0.02
        """
        hidden = [sector_of(entry) for entry in tables("sectors", sectors, SkySector)]
        lost = [outage_of(entry) for entry in tables("satellite_outages", satellite_outages, SatelliteOutage)]
        fields = to_fields("raw GNSS errors", printed, RAW_GNSS_UNITS)
        with naming_keys(printed, RAW_GNSS_UNITS):
            return cls(
                constellation=_constellation(constellation, n_satellites),
                corrected=corrected,
                sectors=tuple(hidden),
                satellite_outages=tuple(lost),
                **fields,  # pyright: ignore[reportArgumentType]
            )

    def replace_datasheet(self, /, **printed: Any) -> RawGnssModel:
        """A copy with some fields changed, by keys of :data:`RAW_GNSS_UNITS`.

        Raises
        ------
        ConfigError
            As :meth:`from_datasheet`.
        """
        fields = to_fields("raw GNSS errors", printed, RAW_GNSS_UNITS)
        with naming_keys(printed, RAW_GNSS_UNITS):
            return dataclasses.replace(self, **fields)


def _constellation(given: str | Constellation, n_satellites: int | None) -> Constellation:
    if given == "gps":
        return gps_constellation() if n_satellites is None else gps_constellation(n_satellites)
    if n_satellites is not None:
        raise ConfigError("n_satellites goes with the constellation 'gps' alone; the others have those that they have")
    if isinstance(given, Constellation):
        return given
    if given == "workshop":
        return workshop_constellation()
    if not isinstance(given, str) or not Path(given).suffix:
        raise ConfigError(f"constellation must be 'gps', 'workshop' or the name of an almanac file, not {shown(given)}")
    return read_almanac(given)
