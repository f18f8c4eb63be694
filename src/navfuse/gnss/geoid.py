"""Height of the geoid above the WGS 84 ellipsoid: EGM96 comes along, EGM2008 through an installed grid of PROJ.

Maps, KML and GPX count heights from the geoid (mean sea level), satellites from the ellipsoid:
``height above the geoid = ellipsoidal height - undulation``.
"""

from __future__ import annotations

import lzma
from functools import cache
from importlib.resources import files

import numpy as np

from navfuse.errors import ConfigError, InputError

Array = np.ndarray

GEOIDS = ("egm96", "egm2008")
_ROWS, _COLUMNS = 721, 1440
_PER_DEGREE = 4.0
_MARGIN = 16
_EGM2008_GRIDS = ("us_nga_egm08_25.tif", "egm08_25.gtx")
"""Names under which PROJ has the 2.5 minute grid of EGM2008, newest first."""


def undulation(lat: Array, lon: Array, geoid: str = "egm96") -> Array:
    """Height of the geoid above the ellipsoid.

    Parameters
    ----------
    lat, lon : (n,) arrays [rad]
        Geodetic; poles included, any longitude.
    geoid : {"egm96", "egm2008"}
        ``"egm96"``: the grid of 15 minutes that comes with navfuse, by bicubic splines. ``"egm2008"``: the grid of
        2.5 minutes of PROJ, which has to be installed (``projsync --file us_nga_egm08_25.tif``), by PROJ's bilinear
        interpolation. The network is never asked.

    Returns
    -------
    (n,) array [m]

    Raises
    ------
    ConfigError
        If there is no such geoid, or its grid is not installed: there is no fallback to a cruder one.
    InputError
        If a latitude is beyond a pole or a coordinate is not a number.

    Notes
    -----
    EGM96 agrees with the six published values of the grid's own interpolation program (``OUTINTPT.DAT`` of
    ``INTPT.F``) to 4 mm and with those of the spherical harmonics (``OUTF477.DAT`` of ``F477.F``) to 5 mm, which is the
    rounding of the grid to centimetres; bilinear interpolation would be off by up to 59 mm there. The model itself is
    good to about half a metre.
    """
    lat, lon = np.asarray(lat, dtype=np.float64), np.asarray(lon, dtype=np.float64)
    if geoid not in GEOIDS:
        raise ConfigError(f'there is no geoid "{geoid}"; known are {", ".join(GEOIDS)}')
    if not (np.isfinite(lon).all() and (np.abs(lat) <= 0.5 * np.pi + 1e-12).all()):
        raise InputError("geoid: latitudes have to be within -90..90 deg, longitudes finite")
    return _egm96(lat, lon) if geoid == "egm96" else _of_proj(lat, lon)


def unpacked(content: bytes) -> Array:
    """Undulations (721, 1440) [m], south to north and from 180 W to the east, of the packed grid."""
    grid = np.frombuffer(lzma.decompress(content), "<i2").reshape(_ROWS, _COLUMNS)
    for axis in (1, 1, 0):
        grid = np.cumsum(grid, axis=axis, dtype=np.int16)
    return grid / 100.0


def _egm96(lat: Array, lon: Array) -> Array:
    from scipy.ndimage import map_coordinates

    row = (np.degrees(lat) + 90.0) * _PER_DEGREE + _MARGIN
    column = np.mod(np.degrees(lon) + 180.0, 360.0) * _PER_DEGREE + _MARGIN
    return map_coordinates(_coefficients(), [row, column], order=3, prefilter=False)


@cache
def _coefficients() -> Array:
    """B-spline coefficients of the grid, continued across the poles and around the parallels.

    The influence of a node falls off by 2 - sqrt(3) per cell, to 1e-9 over the margin.
    """
    from scipy.ndimage import spline_filter

    grid = unpacked(files("navfuse.gnss").joinpath("data", "egm96_15min_cm.xz").read_bytes())
    beyond = np.roll(grid, _COLUMNS // 2, axis=1)
    south, north = beyond[_MARGIN:0:-1], beyond[-2 : -_MARGIN - 2 : -1]
    whole = np.vstack((south, grid, north))
    return spline_filter(np.hstack((whole[:, -_MARGIN:], whole, whole[:, :_MARGIN])), order=3)


def _of_proj(lat: Array, lon: Array) -> Array:
    from pyproj import Transformer, network
    from pyproj.exceptions import ProjError

    online = network.is_network_enabled()  # pyright: ignore[reportPrivateImportUsage]
    network.set_network_enabled(False)  # pyright: ignore[reportPrivateImportUsage]
    try:
        for grid in _EGM2008_GRIDS:
            # A grid named outright is used or is an error; between two reference systems PROJ may do without one.
            pipeline = (
                "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad "
                f"+step +proj=vgridshift +grids={grid} +multiplier=1 "
                "+step +proj=unitconvert +xy_in=rad +xy_out=deg"
            )
            try:
                transformer = Transformer.from_pipeline(pipeline)
                found = transformer.transform(np.degrees(lon), np.degrees(lat), np.zeros_like(lat), errcheck=True)[2]
            except ProjError:
                continue
            if np.isfinite(found).all():
                return np.asarray(found)
    finally:
        network.set_network_enabled(online)  # pyright: ignore[reportPrivateImportUsage]
    raise ConfigError(
        f"geoid egm2008: PROJ has no usable grid {' or '.join(_EGM2008_GRIDS)} here; install it with `projsync --file "
        f"{_EGM2008_GRIDS[0]}` (where the network may be used) or put it into {_data_folder()}, or use egm96, which "
        "comes along"
    )


def _data_folder() -> str:
    from pyproj import datadir

    return datadir.get_user_data_dir()  # pyright: ignore[reportPrivateImportUsage]
