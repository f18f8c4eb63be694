from __future__ import annotations

import math

import numpy as np
import pytest

from navfuse.simulation import car_drive, figure_eight_flight, static
from reference.mechanization_twin import gravity_e, integrate_ecef

MOTIONS = {
    "car": lambda: car_drive(60.0, seed=3, standing=5.0),
    "car at the south pole": lambda: car_drive(60.0, seed=4, standing=2.0, lat=-math.pi / 2.0),
    "car on the date line": lambda: car_drive(60.0, seed=5, standing=2.0, lat=-0.3, lon=math.pi),
    "flight": lambda: figure_eight_flight(60.0, straight=5.0, speed=100.0),
    "tripod": lambda: static(60.0, roll=0.4, pitch=-1.2, heading=2.0),
}


@pytest.mark.parametrize("name", MOTIONS)
def test_the_equations_of_motion_give_a_motion_back(name):
    motion = MOTIONS[name]()
    time = np.linspace(0.0, 60.0, 7)
    r_e, v_e, C_eb = integrate_ecef(
        motion.w_ib_b, motion.f_b, time, motion.r_e(0.0), motion.v_e(0.0), motion.C_eb(0.0), max_step=0.1
    )
    assert np.abs(r_e - motion.r_e(time)).max() < 1e-6
    assert np.abs(v_e - motion.v_e(time)).max() < 1e-7
    assert np.abs(C_eb - motion.C_eb(time)).max() < 1e-9


def test_gravity_of_the_twin_is_normal_gravity():
    np.testing.assert_allclose(gravity_e(np.array([6378137.0, 0.0, 0.0])), [-9.7803253359, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(gravity_e(np.array([0.0, 0.0, -6356752.314245179])), [0.0, 0.0, 9.8321849379], atol=1e-9)
