"""Attitude and heading without position: gyro-magnetometer heading, and the attitude and heading reference."""
