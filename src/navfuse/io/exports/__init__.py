"""Trajectories in the formats of other programs: one module and one function ``write_NAME(path, track)`` per format."""
