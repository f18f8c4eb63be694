from __future__ import annotations

import pytest
from tests.inspection.damages import read_columns

from navfuse.scenario_files import simulate_scenario


@pytest.fixture(scope="session")
def city(tmp_path_factory):
    """Folder with the logs of a simulated drive: IMU increments at 100 Hz, fixes with velocity at 1 Hz, ten minutes."""
    folder = tmp_path_factory.mktemp("city")
    simulate_scenario("city-car", folder)
    return folder


@pytest.fixture(scope="session")
def city_tables(city):
    """Columns of the inertial log and of the fixes; not to be changed in place."""
    return read_columns(city / "imu.parquet"), read_columns(city / "gnss.csv")
