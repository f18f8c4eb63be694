"""Figures for papers, one function each: a result in, a matplotlib figure out. See :mod:`navfuse.report.figures`."""

from navfuse.report.figures import *  # noqa: F403
from navfuse.report.figures import __all__ as __all__
