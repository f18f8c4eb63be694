"""The inertial sensor: rates to increments, error model and grades, alignment."""
