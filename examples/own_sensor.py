"""A sensor of your own: the speed over ground of a radar with an unknown scale factor.

Run it with ``python examples/own_sensor.py``. It simulates a drive whose GNSS is lost for 30 s, and shows what the
radar is worth then.
"""

from __future__ import annotations

import numpy as np

import navfuse
from navfuse.aiding import AidingSensor, check
from navfuse.data.layout import Block
from navfuse.data.start import Start
from navfuse.filters.ekf import ErrorStateFilter, FilterSettings
from navfuse.imu.grades import grade
from navfuse.imu.increments import to_increments
from navfuse.simulation import car_drive, simulate


class RadarSpeed(AidingSensor):
    """Forward speed, measured with a constant scale error."""

    name = "radar"
    states = (Block("scale", 1, sd=0.05),)

    def __init__(self, times, speed, sd):
        self.times, self.speed, self.sd = times, speed, sd

    def value(self, k):
        return self.speed[k]

    def predict(self, nav, k):
        scale = nav.state("radar.scale")[0]
        return (1.0 + scale) * (nav.C_nb.T @ nav.v_n)[0]

    def noise(self, k):
        return self.sd


def run(with_radar: bool, seed: int = 3) -> tuple[navfuse.Trajectory, float]:
    """Worst position error in the outage, with or without the radar: (trajectory, metres)."""
    from navfuse.aiding import GnssPosition

    model = grade("industrial-mems")
    logs = simulate(car_drive(duration=150.0, seed=seed), model, seed)
    truth, rng = logs.truth, np.random.default_rng(seed)
    speed = 1.03 * np.linalg.norm(truth.velocity_n, axis=1) + rng.normal(0.0, 0.1, len(truth))
    radar = RadarSpeed(truth.time[1:], speed[1:], 0.1)
    gnss = GnssPosition(logs.gnss, outages=((110.0, 140.0),))
    first = [truth.lat[0], truth.lon[0], truth.height[0]]
    start = Start.from_parts(
        truth.time[0],
        first,
        truth.velocity_n[0],
        truth.attitude[0],
        np.full(3, 2.0),
        np.full(3, 0.1),
        np.radians([0.5, 0.5, 3.0]),
    )
    estimator = ErrorStateFilter(start, model, [gnss, radar] if with_radar else [gnss], FilterSettings())
    if with_radar:
        print(check(radar, estimator.nav_state()))
    estimator.feed(to_increments(logs.imu))
    solution = estimator.record.trajectory()
    errors = navfuse.compare(solution, truth, skip_s=110.0, until_s=140.0)
    return solution, errors.statistics["position_horizontal"].max


if __name__ == "__main__":
    for with_radar in (False, True):
        print(f"radar {'on' if with_radar else 'off'}: worst horizontal error in the outage {run(with_radar)[1]:.2f} m")
