"""Strapdown mechanization and its error dynamics, in the local (NED) and the Earth-fixed (ECEF) frame.

``ned`` and ``ecef`` advance a navigation state by one inertial increment; ``error_dynamics`` carries the covariance
of the errors of either; ``propagate`` is the loop that joins them between two events.
"""
