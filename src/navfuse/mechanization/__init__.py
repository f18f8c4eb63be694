"""Strapdown mechanization and its error dynamics, in the local (NED) and the Earth-fixed (ECEF) frame.

``ned`` and ``ecef`` advance a navigation state by one inertial increment; ``error_dynamics`` states
how the errors of either behave; ``covariance`` carries their covariance, in the layout of ``tiles``; ``propagate`` is
the loop that joins them between two events.
"""
