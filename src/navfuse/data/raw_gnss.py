"""Raw GNSS measurements in internal form: one row per satellite and epoch."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

Array = np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class RawGnssLog:
    """Pseudo-ranges and range rates of one antenna, with the satellites they came from.

    Rows of one epoch stand together and have the same stamp to the bit; within it each satellite is there once. An
    epoch without satellites has no rows.

    **Whose axes.** `sat_r_e` and `sat_v_e` are position and velocity at the time of *transmission*, in the Earth-fixed
    axes of that same time, the velocity relative to the rotating Earth, as broadcast messages give them. The Earth
    turns during the flight: the Sagnac rotation is *not* in them. :func:`navfuse.gnss.ranging.range_and_rate` takes
    them as they are, together with the antenna in the axes of reception, and gives range, range rate and line of sight.

    **What a row measures.** ``pseudorange = rho + b + errors`` and ``range_rate = d(rho)/dt + db/dt + errors`` with the
    clock offset `b` [m], positive where the receiver clock is ahead. Both grow as the satellite recedes (a Doppler
    shift times the wavelength is the negative of a range rate). The satellite clock is always taken out.

    Attributes
    ----------
    time : (n,) array [s]
        Stamps of reception, not decreasing, on the scale of the other logs: without the receiver's clock offset.
    satellite : (n,) array of str
    pseudorange, sd_pseudorange : (n,) arrays [m]
        `sd` is the stated standard deviation, > 0.
    sat_r_e : (n, 3) array [m]
    range_rate, sd_range_rate : (n,) arrays [m/s] or None
        Rows may be NaN where a range rate is missing.
    sat_v_e : (n, 3) array [m/s] or None
    elevation, azimuth : (n,) arrays [rad] or None
        Of the satellite from the antenna; azimuth clockwise from north, 0 <= azimuth < 2 pi.
    cn0 : (n,) array [dB-Hz] or None
        Carrier power over noise density.
    corrected : bool
        Whether the delays of ionosphere and troposphere are taken out of the pseudo-ranges as far as models can.
    source : str
    notes : tuple of str
        As in :class:`~navfuse.data.logs.GnssLog`.
    """

    time: Array
    satellite: Array
    pseudorange: Array
    sd_pseudorange: Array
    sat_r_e: Array
    range_rate: Array | None = None
    sd_range_rate: Array | None = None
    sat_v_e: Array | None = None
    elevation: Array | None = None
    azimuth: Array | None = None
    cn0: Array | None = None
    corrected: bool = True
    source: str = "raw gnss"
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return self.time.size

    def take(self, index: Array | slice) -> RawGnssLog:
        """Rows picked by a mask, an index array or a slice."""
        rows = {
            entry.name: values[index]
            for entry in fields(self)
            if isinstance(values := getattr(self, entry.name), np.ndarray)
        }
        return replace(self, **rows)

    def epochs(self) -> tuple[Array, Array]:
        """Where the epochs begin.

        Returns
        -------
        time : (m,) array [s]
            Stamp of each epoch.
        first : (m + 1,) int array
            Epoch k has the rows ``first[k]:first[k + 1]``.
        """
        begin = np.flatnonzero(np.diff(self.time, prepend=-np.inf) != 0.0)
        return self.time[begin], np.append(begin, self.time.size)

    def columns(self) -> dict[str, Array]:
        """Native columns in their order; those that the log lacks are left out.

        Returns
        -------
        dict of str to (n,) array
            As the table of :mod:`navfuse.io.raw_gnss_table`.
        """
        triads = (("sat_{}_m", self.sat_r_e), ("sat_v{}_mps", self.sat_v_e))
        optional: dict[str, Array | None] = {
            "range_rate_mps": self.range_rate,
            "sd_range_rate_mps": self.sd_range_rate,
            **{
                name.format(axis): None if triad is None else triad[:, column].copy()
                for name, triad in triads
                for column, axis in enumerate("xyz")
            },
            "elevation_deg": None if self.elevation is None else np.degrees(self.elevation),
            "azimuth_deg": None if self.azimuth is None else np.degrees(self.azimuth),
            "cn0_dbhz": self.cn0,
        }
        return {
            "time_s": self.time,
            "satellite": self.satellite,
            "pseudorange_m": self.pseudorange,
            "sd_pseudorange_m": self.sd_pseudorange,
            **{name: values for name, values in optional.items() if values is not None},
            "corrected": np.full(self.time.size, int(self.corrected)),
        }
