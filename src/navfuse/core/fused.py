"""The compiler's leave to fuse a product and a sum into one instruction.

``@fused`` stands in for ``@njit`` where kernels are nothing but long sums of products. A fused product is not rounded,
so results can differ in the last digits between processors with and without the instruction, never between two runs on
one. It has no place in arithmetic that lives on rounding errors, as in :mod:`navfuse.core.earth`.
Divisions are numpy's: by zero they give infinity or NaN.
"""

from __future__ import annotations

from functools import partial

from numba import njit

fused = partial(njit, cache=True, error_model="numpy", fastmath={"contract"})
