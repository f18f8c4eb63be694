"""Output of a filter on its way to the record."""

from __future__ import annotations

import numpy as np

from navfuse.data.nav_state import describe_rows
from navfuse.filters.record import FilterRecord
from navfuse.mechanization.propagate import Propagator

Array = np.ndarray

ROWS = 64


class OutputBuffer:
    """Rows that the hot loop fills, described and recorded by the many.

    Parameters
    ----------
    propagator : Propagator
        Without output (negative period) the buffer has no rows.

    Attributes
    ----------
    arrays : tuple of arrays
        As :meth:`navfuse.mechanization.propagate.Propagator.buffers` makes them.
    filled : int
        Rows not yet recorded.
    """

    def __init__(self, propagator: Propagator):
        self.capacity = ROWS if propagator.output_period >= 0 else 0
        self.arrays = propagator.buffers(self.capacity, transitions=False)
        self.filled = 0
        self._ecef = propagator.ecef

    def added(self, record: FilterRecord) -> None:
        """A row of a buffer that was not full has been filled."""
        self.filled += 1
        if self.filled == self.capacity:
            self.flush(record)

    def flush(self, record: FilterRecord) -> None:
        """Hand all rows to the record."""
        if not self.filled:
            return
        times, navs, errors, covariances, _ = self.arrays
        filled = slice(self.filled)
        rows = np.empty((self.filled, 18))
        describe_rows(navs[filled], errors[filled], covariances[filled], self._ecef, rows)
        record.time.append(times[filled].copy())
        record.rows.append(rows)
        self.filled = 0
