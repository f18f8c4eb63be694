"""EGM96 against published values, across the poles and the date line; EGM2008 only from an installed grid."""

from __future__ import annotations

import numpy as np
import pyproj.datadir
import pyproj.network
import pytest

from navfuse.errors import ConfigError, InputError
from navfuse.gnss import geoid
from navfuse.gnss.geoid import undulation

# Latitude, longitude [deg], undulation [m] by interpolation in the grid (OUTINTPT.DAT) and by the spherical harmonics
# (OUTF477.DAT); both from NIMA's EGM96 distribution, README.TXT and the files named.
PUBLISHED = np.array(
    [
        (38.6281550, 269.7791550, -31.628, -31.629),
        (-14.6212170, 305.0211140, -2.969, -2.966),
        (46.8743190, 102.4487290, -43.575, -43.572),
        (-23.6174460, 133.8747120, 15.871, 15.868),
        (38.6254730, 359.9995000, 50.066, 50.065),
        (-0.4667440, 0.0023000, 17.329, 17.330),
    ]
)
POLES = (-29.534, 13.606)
"""Undulation at the south and the north pole, rows 720 and 0 of WW15MGH.GRD."""


def test_published_values():
    lat, lon, interpolated, harmonics = PUBLISHED.T
    found = undulation(np.radians(lat), np.radians(lon))
    np.testing.assert_allclose(found, interpolated, atol=0.0055)
    np.testing.assert_allclose(found, harmonics, atol=0.0055)


@pytest.mark.parametrize(("lat", "published"), [(-90.0, POLES[0]), (90.0, POLES[1])])
def test_one_value_at_a_pole_whatever_the_longitude(lat, published):
    lon = np.radians([-180.0, -77.3, 0.0, 45.1, 180.0, 359.9])
    np.testing.assert_allclose(undulation(np.full(6, np.radians(lat)), lon), published, atol=0.0055)


def test_straight_over_a_pole():
    """Across the pole the meridian goes on: no kink where the grid ends."""
    along = np.linspace(-0.5, 0.5, 101)
    lat, lon = np.radians(90.0 - np.abs(along)), np.where(along < 0.0, 0.3, 0.3 + np.pi)
    for sign in (1.0, -1.0):
        found = undulation(sign * lat, lon)
        assert np.abs(np.diff(found)).max() > 1e-3  # a kink would stand out of the third differences by as much
        assert np.abs(np.diff(found, 3)).max() < 1e-4


def test_date_line_and_turns():
    lat = np.radians(np.linspace(-80.0, 80.0, 33))
    west, east = undulation(lat, np.full(33, -np.pi)), undulation(lat, np.full(33, np.pi))
    np.testing.assert_allclose(west, east, atol=1e-9)
    np.testing.assert_allclose(
        undulation(lat, np.full(33, 0.4)), undulation(lat, np.full(33, 0.4 - 2 * np.pi)), atol=1e-9
    )
    lon = np.pi + np.radians(np.linspace(-0.5, 0.5, 201))
    assert np.abs(np.diff(undulation(np.full(201, -0.3), lon))).max() < 0.02


def test_nodes_are_met_and_the_grid_is_whole():
    grid = geoid.unpacked(geoid.files("navfuse.gnss").joinpath("data", "egm96_15min_cm.xz").read_bytes())
    assert grid.shape == (721, 1440)
    assert (grid.min(), grid.max()) == (-106.99, 85.39)
    rows, columns = np.meshgrid([0, 3, 360, 719, 720], [0, 1, 719, 1439], indexing="ij")
    found = undulation(np.radians(rows / 4.0 - 90.0), np.radians(columns / 4.0 - 180.0))
    np.testing.assert_allclose(found, grid[rows, columns], atol=1e-6)


def test_refused():
    with pytest.raises(ConfigError, match='no geoid "egm84"; known are egm96, egm2008'):
        undulation(np.zeros(1), np.zeros(1), "egm84")
    with pytest.raises(InputError, match="within -90..90"):
        undulation(np.array([2.0]), np.zeros(1))
    with pytest.raises(InputError, match="finite"):
        undulation(np.zeros(1), np.array([np.nan]))


@pytest.fixture
def proj_folder(tmp_path, monkeypatch):
    """A folder in which PROJ looks for grids, and nowhere else of the user's."""
    before = pyproj.datadir.get_data_dir()
    monkeypatch.setattr(geoid, "_EGM2008_GRIDS", ("navfuse_test_egm08.gtx",))
    pyproj.datadir.append_data_dir(str(tmp_path))
    yield tmp_path
    pyproj.datadir.set_data_dir(before)


def test_no_grid_of_egm2008_is_an_error_not_a_cruder_height(proj_folder):
    pyproj.network.set_network_enabled(True)
    try:
        with pytest.raises(ConfigError, match=r"no usable grid navfuse_test_egm08.gtx.*projsync.*egm96"):
            undulation(np.array([0.5]), np.array([0.2]), "egm2008")
        assert pyproj.network.is_network_enabled()
    finally:
        pyproj.network.set_network_enabled(None)


def test_installed_grid_of_egm2008_is_used_with_its_sign(proj_folder):
    lat, lon = np.meshgrid(np.arange(40.0, 45.0), np.arange(10.0, 15.0), indexing="ij")
    plane = 30.0 + 2.0 * (lat - 40.0) - (lon - 10.0)
    header = np.array([40.0, 10.0, 1.0, 1.0], ">f8").tobytes() + np.array([5, 5], ">i4").tobytes()
    (proj_folder / "navfuse_test_egm08.gtx").write_bytes(header + plane.astype(">f4").tobytes())
    found = undulation(np.radians([41.5, 43.25]), np.radians([12.25, 13.5]), "egm2008")
    np.testing.assert_allclose(found, [30.0 + 3.0 - 2.25, 30.0 + 6.5 - 3.5], atol=1e-5)
    with pytest.raises(ConfigError, match="no usable grid"):
        undulation(np.radians([60.0]), np.radians([12.0]), "egm2008")
