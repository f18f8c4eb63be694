"""Trajectories in the formats of other programs, one module each: ``write_NAME(path, track)``."""
