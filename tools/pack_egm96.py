"""Pack the EGM96 grid of PROJ into the file that navfuse ships, and check that nothing but the rounding changed.

    python tools/pack_egm96.py egm96_15.gtx src/navfuse/gnss/data/egm96_15min_cm.xz

``egm96_15.gtx`` comes with PROJ's data, e.g. in Debian's package ``proj-data`` (version 9.1.1 was used):
``apt-get download proj-data && dpkg -x proj-data_*.deb . && ls usr/share/proj/egm96_15.gtx``.
"""

from __future__ import annotations

import argparse
import lzma
import sys
from pathlib import Path

import numpy as np

ROWS, COLUMNS = 721, 1440
HEADER = 40


def read_gtx(path: Path) -> np.ndarray:
    """Undulations (721, 1440) [m] of a GTX file: south to north, from 180 W to the east."""
    content = path.read_bytes()
    south, west, step_lat, step_lon = np.frombuffer(content[:32], ">f8")
    rows, columns = np.frombuffer(content[32:HEADER], ">i4")
    if (rows, columns) != (ROWS, COLUMNS) or (south, west, step_lat, step_lon) != (-90.0, -180.0, 0.25, 0.25):
        raise SystemExit(f"{path}: not the global grid at 15 minutes from 90 S, 180 W")
    return np.frombuffer(content[HEADER:], ">f4").reshape(ROWS, COLUMNS).astype(np.float64)


def packed(undulation: np.ndarray) -> bytes:
    """Whole centimetres, differenced once along the meridians and twice along the parallels, modulo 2^16, as xz."""
    centimetres = np.rint(undulation * 100.0).astype("<i2")
    for axis in (0, 1, 1):
        centimetres = np.diff(centimetres, axis=axis, prepend=np.zeros_like(centimetres).take([0], axis=axis))
    return lzma.compress(centimetres.astype("<i2").tobytes(), preset=9 | lzma.PRESET_EXTREME)


def main() -> None:
    """Pack, write, read back, compare."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("source", type=Path)
    parser.add_argument("target", type=Path)
    arguments = parser.parse_args()
    undulation = read_gtx(arguments.source)
    arguments.target.write_bytes(packed(undulation))
    from navfuse.gnss.geoid import unpacked

    worst = np.abs(unpacked(arguments.target.read_bytes()) - undulation).max()
    size = arguments.target.stat().st_size
    sys.stdout.write(f"{arguments.target}: {size} bytes, worst difference {1e3 * worst:.2f} mm\n")
    if worst > 0.00502:
        raise SystemExit("the packed grid differs by more than the rounding to centimetres")


if __name__ == "__main__":
    main()
