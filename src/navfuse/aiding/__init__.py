"""Aiding sensors: what a filter corrects the inertial navigation with.

:class:`AidingSensor` is the base class with a recipe; :func:`check` tries a sensor of your own before a filter relies
on it.
"""

from navfuse.aiding.base import AidingSensor, numerical_jacobian
from navfuse.aiding.check import CheckReport, check
from navfuse.aiding.gnss_fix import GnssPosition, GnssVelocity

__all__ = ["AidingSensor", "CheckReport", "GnssPosition", "GnssVelocity", "check", "numerical_jacobian"]
