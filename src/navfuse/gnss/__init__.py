"""Satellite navigation: orbits, signal flight, atmosphere, and the position of a single epoch."""
