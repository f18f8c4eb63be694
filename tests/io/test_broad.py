from __future__ import annotations

import numpy as np
import pytest
from scipy.io import savemat

from navfuse.errors import InputError
from navfuse.io.broad import read_broad


def arrays(n=5):
    return {
        "imu_gyr": np.tile([0.1, 0.2, 0.3], (n, 1)), "imu_acc": np.tile([0.0, 0.0, 9.81], (n, 1)),
        "imu_mag": np.tile([0.0, 15.0, -40.0], (n, 1)), "opt_quat": np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)),
        "movement": np.ones((n, 1)), "sampling_rate": np.array([[100.0]]),
    }  # fmt: skip


def test_frames_and_units(tmp_path):
    savemat(tmp_path / "trial.mat", arrays())
    trial = read_broad(tmp_path / "trial.mat")
    assert trial.name == "trial"
    assert trial.imu.time.size == 6
    np.testing.assert_allclose(trial.imu.gyro[1], [0.001, -0.002, -0.003])
    np.testing.assert_allclose(trial.imu.accel[1], [0.0, 0.0, -0.0981])
    np.testing.assert_allclose(trial.magnetometer.field_b[0], [0.0, -15e-6, 40e-6])
    # Forward points east and up is up: forward-right-down has a heading of 90 deg.
    np.testing.assert_allclose(np.abs(trial.q_nb[0]), [np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)], atol=1e-15)
    assert trial.movement.all()


@pytest.mark.parametrize("fault", ["absent", "shape", "length", "no mat"])
def test_files_that_are_no_trial_are_refused(tmp_path, fault):
    data = arrays()
    if fault == "absent":
        del data["imu_mag"]
    elif fault == "shape":
        data["opt_quat"] = np.ones((5, 3))
    elif fault == "length":
        data["movement"] = np.ones((4, 1))
    path = tmp_path / "trial.mat"
    savemat(path, data)
    if fault == "no mat":
        path.write_text("hello, world" * 20)
    with pytest.raises(InputError, match=r"trial\.mat"):
        read_broad(path)
