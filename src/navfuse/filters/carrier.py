"""What a filter carries from increment to increment, in two arrays, and views that look into them."""

from __future__ import annotations

from typing import Any

import numpy as np

from navfuse.filters.event import carrier, split

Array = np.ndarray


class Carrier:
    """Base of a filter: ``nav``, ``s``, ``x`` and ``P`` are views of one array, for which kernels take one argument.

    A copy, be it by :mod:`copy` or :mod:`pickle`, would turn views into arrays of their own; so they are left out of it
    and made again by :meth:`_bind`.
    """

    _carried: Array
    _last: Array

    def _carry(self, n: int) -> None:
        """Begin with zeros for n states."""
        self._carried, self._last = carrier(n), np.zeros(6)
        self._bind()

    def _bind(self) -> None:
        """Make the views. What a derived class binds to the two arrays belongs into its own version of this."""
        self._views = split(self._carried)

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name not in _BOUND}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._bind()

    @property
    def nav(self) -> Array:
        """Navigation state (10,), NED or ECEF, a view. Like the next three it can be assigned to, in place."""
        return self._views[0]

    @nav.setter
    def nav(self, value: Array) -> None:
        self._views[0][...] = value

    @property
    def s(self) -> Array:
        """Estimates (n - 9,) of the states after the ninth, a view."""
        return self._views[1]

    @s.setter
    def s(self, value: Array) -> None:
        self._views[1][...] = value

    @property
    def x(self) -> Array:
        """Estimated errors (n,), a view; zero in a closed loop."""
        return self._views[2]

    @x.setter
    def x(self, value: Array) -> None:
        self._views[2][...] = value

    @property
    def P(self) -> Array:
        """Covariance (n, n) of the errors in the order of `layout`, a view."""
        return self._views[3]

    @P.setter
    def P(self, value: Array) -> None:
        self._views[3][...] = value


_BOUND = ("_views", "_take")
