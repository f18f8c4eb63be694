from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from navfuse.core.constants import LIGHT_SPEED
from navfuse.errors import ConfigError, InputError
from navfuse.gnss.orbits import gps_constellation, workshop_constellation
from navfuse.simulation import RawGnssModel, SatelliteOutage, SkySector
from navfuse.simulation.raw_gnss_errors import RAW_GNSS_UNITS

SECTOR = {"azimuth_from_deg": 350.0, "azimuth_to_deg": 10.0, "elevation_below_deg": 40.0}


def test_every_key_sets_its_field_in_si():
    fields = {entry.name for entry in dataclasses.fields(RawGnssModel)}
    assert {name for name, _ in RAW_GNSS_UNITS.values()} == fields - {
        "constellation", "corrected", "sectors", "satellite_outages",
    }  # fmt: skip
    taus = {f"{name}_tau_s": 100.0 for name in ("signal", "ionosphere", "troposphere", "multipath")}
    for key, (name, factor) in RAW_GNSS_UNITS.items():
        value = [[1.0, 2.0]] if key == "outages_s" else 0.5
        needed = {**taus, "outlier_from_m": -1.0, "outlier_to_m": 1.0, "corrected": name != "ionosphere_zenith"}
        model = RawGnssModel.from_datasheet(**(needed | {key: value}))
        np.testing.assert_allclose(getattr(model, name), np.multiply(value, factor), rtol=1e-15)
        if key not in needed:
            assert np.all(getattr(RawGnssModel(), name) != getattr(model, name)) or name == "outages"


def test_units_of_the_clock():
    model = RawGnssModel.from_datasheet(clock_offset_us=2.0, clock_drift_ppb=500.0)
    assert model.clock_offset == pytest.approx(2e-6 * LIGHT_SPEED)
    assert model.clock_drift == pytest.approx(5e-7 * LIGHT_SPEED)


def test_constellations_by_name_and_file(tmp_path):
    assert RawGnssModel().constellation.satellites == gps_constellation(24).satellites
    assert len(RawGnssModel.from_datasheet(n_satellites=31).constellation) == 31
    assert RawGnssModel.from_datasheet("workshop").constellation.satellites == workshop_constellation().satellites
    own = gps_constellation().take(("G03", "G07"))
    assert RawGnssModel.from_datasheet(own).constellation is own
    with pytest.raises(InputError, match="there is no such file"):
        RawGnssModel.from_datasheet(str(tmp_path / "week.alm"))


def test_sectors_and_outages_as_tables():
    model = RawGnssModel.from_datasheet(sectors=[SECTOR], satellite_outages=[{"satellite": "G05", "to_s": 9.0}])
    assert isinstance(model.sectors[0], SkySector)
    assert model.satellite_outages == (SatelliteOutage("G05", -math.inf, 9.0),)
    assert model.replace_datasheet(code_sd_m=3.0).sectors == model.sectors


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"code_sd_cm": 2.0}, "raw GNSS errors: unknown key or unit 'code_sd_cm': did you mean 'code_sd_m'"),
        ({"elevation_mask_dge": 2.0}, "did you mean 'elevation_mask_deg'"),
        ({"clock_offset_m": 1.0, "clock_offset_us": 1.0}, "sets clock_offset a second time"),
        ({"code_sd_m": "much"}, "code_sd_m must be a number"),
        ({"rate_hz": 0.0}, "rate must be more than 0 and finite"),
        ({"rate_hz": -1.0}, "rate must be more than 0 and finite"),
        ({"clock_phase_psd_m2_per_s": -1.0}, "clock_phase_psd must be at least 0 and finite"),
        ({"clock_frequency_psd_m2_per_s3": -1.0}, "clock_frequency_psd must be at least 0 and finite"),
        ({"code_sd_m": math.nan}, "code_sd must be at least 0 and finite"),
        ({"latency_s": math.inf}, "latency must be a number and finite"),
        ({"signal_sd_m": 1.0}, "signal_sd needs signal_tau > 0"),
        ({"multipath_sd_m": 1.0, "multipath_tau_s": -1.0}, "multipath_tau must be at least 0"),
        ({"elevation_mask_deg": 90.0}, "elevation_mask must be below 90 deg"),
        ({"elevation_mask_deg": -1.0}, "elevation_mask must be at least 0"),
        ({"outlier_percent": 60.0, "outlier_to_m": 1.0}, "outlier_share must be at most 0.5"),
        ({"outlier_percent": -1.0}, "outlier_share must be at least 0"),
        ({"outlier_percent": 1.0}, "outliers need a size: give outlier_from and outlier_to"),
        ({"outlier_from_m": 2.0, "outlier_to_m": 1.0}, "outlier_from must not be above outlier_to"),
        ({"ionosphere_zenith_m": 4.0}, "ionosphere_zenith needs corrected = false"),
        ({"corrected": "no"}, "corrected must be true or false, not 'no'"),
        ({"outages_s": [[2.0, 1.0]]}, r"outages must be windows \[from, to\]"),
        ({"stated_sigma_factor": 0.0}, "stated_sigma_factor must be more than 0"),
        ({"stated_least_m": 0.0}, "stated_least_range must be more than 0"),
        ({"constellation": "galileo"}, "constellation must be 'gps', 'workshop' or the name of an almanac file"),
        ({"constellation": 3}, "constellation must be 'gps', 'workshop' or the name of an almanac file, not 3"),
        ({"constellation": "workshop", "n_satellites": 30}, "n_satellites goes with the constellation 'gps' alone"),
        ({"n_satellites": 40}, "24 to 32 satellites, not 40"),
        ({"satellite_outages": [{"satellite": "R01"}]}, "there is no satellite 'R01'"),
        ({"sectors": [SECTOR | {"colour": 1}]}, "sky sector: unknown key or unit 'colour'"),
    ],
)
def test_what_is_refused(keys, message):
    with pytest.raises(ConfigError, match=message):
        RawGnssModel.from_datasheet(**keys)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"constellation": "gps"}, "constellation must be a Constellation, not 'gps'"),
        ({"sectors": (SECTOR,)}, "sectors must hold SkySector, not dict"),
        ({"satellite_outages": ("G01",)}, "satellite_outages must hold SatelliteOutage, not str"),
        ({"outlier_share": 0.1, "outlier_to": math.inf}, "outlier_to must be a number and finite"),
    ],
)
def test_what_the_class_itself_refuses(fields, message):
    with pytest.raises(ConfigError, match=message):
        RawGnssModel(**fields)
