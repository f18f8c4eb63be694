"""A run that writes for other programs too: what can be written is there, what cannot costs a warning."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from itertools import pairwise

import gpxpy
import numpy as np

from navfuse.io.trajectory_table import read_trajectory

EPOCH = (2374, 243258.0)


def test_a_run_writes_for_other_programs(job):
    job.set("output", formats=["csv", "kml", "gpx", "pos"], export_point="antenna", export_rate_hz=2.0)
    job.set("gnss", epoch_week_s=EPOCH)
    finished = job.done()
    assert not [warning for warning in finished.outcome.warnings if "output.formats" in warning]
    names = {path.name for path in job.output.iterdir()}
    assert {"smoothed.csv", "forward.csv", "smoothed.kml", "smoothed.gpx", "smoothed.pos"} <= names
    assert "smoothed.parquet" not in names
    points = list(gpxpy.parse((job.output / "smoothed.gpx").read_text()).walk(only_points=True))
    assert {(b.time - a.time).total_seconds() for a, b in pairwise(points)} == {0.5}
    imu = read_trajectory(job.output / "smoothed.csv")
    start = datetime(1980, 1, 6, tzinfo=UTC) + timedelta(weeks=EPOCH[0], seconds=EPOCH[1] - 18.0)
    at = [(point.time - start).total_seconds() for point in points]
    assert imu.time[0] <= at[0] < imu.time[0] + 0.5
    above_imu = [point.elevation + point.geoid_height for point in points] - np.interp(at, imu.time, imu.height)
    np.testing.assert_allclose(above_imu, 1.3, atol=0.1)  # the antenna is 1.3 m above a nearly level IMU


def test_a_format_that_needs_a_date_costs_a_warning_and_old_exports_do_not_survive(job):
    job.set("output", formats=["kml", "sbet"])
    job.output.mkdir()
    for name in ("smoothed.sbet", "smoothed.gpx", "forward.kml", "notes.txt"):
        (job.output / name).write_text("of an earlier run")
    job.done('output.formats: "sbet" is not written', "KML is written without times")
    names = {path.name for path in job.output.iterdir()}
    assert {"smoothed.parquet", "smoothed.kml", "notes.txt"} <= names
    assert not {"smoothed.sbet", "smoothed.gpx", "forward.kml"} & names
