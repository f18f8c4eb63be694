from __future__ import annotations

import os
import subprocess
import sys

import pytest

from navfuse import _warm_up

REPORT = """
import numpy as np
from navfuse import _warm_up
from navfuse.smoothers import adjoint, rts
from navfuse.filters.event import note, take
from navfuse.data.nav_state import describe_rows
_warm_up.compile_late_kernels()
kernels = (
    adjoint.back_across_rows, rts._back_across_update, rts._smooth_rows, rts._smooth_states, take,
    note, describe_rows,
)
compiled = {kernel.__name__: len(kernel.signatures) for kernel in kernels}

from navfuse import simulation
from navfuse.aiding.gnss_fix import GnssPosition
from navfuse.filters.ekf import ErrorStateFilter, FilterSettings
from navfuse.imu.alignment import align
from navfuse.imu.grades import GRADES
from navfuse.imu.increments import to_increments

motion = simulation.car_drive(12.0, seed=1, standing=8.0)
logs = simulation.simulate(motion, GRADES["industrial-mems"], 1, imu_rate=50.0)
increments = to_increments(logs.imu)
start = align(increments, logs.gnss, GRADES["industrial-mems"], np.zeros(3)).start
at = int(np.searchsorted(increments.time, start.time - 1e-6))
options = FilterSettings(checkpoints=True)
run = ErrorStateFilter(start, GRADES["industrial-mems"], [GnssPosition(logs.gnss)], options)
run.feed(increments.piece(at))
rts.smooth(run, increments.piece(at))
for kernel in kernels:
    assert compiled[kernel.__name__] == len(kernel.signatures) == 1, (kernel.__name__, kernel.signatures)
"""


def test_a_run_needs_the_very_kernels_that_are_compiled_beforehand():
    done = subprocess.run([sys.executable, "-c", REPORT], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_compiling_in_the_background_leaves_no_noise_and_no_process(capfd, monkeypatch):
    started = []
    real = subprocess.Popen

    def popen(command, **options):
        started.append(real([command[0], "-c", "print('noise', flush=True); import time; time.sleep(600)"], **options))
        return started[-1]

    monkeypatch.setattr(_warm_up.subprocess, "Popen", popen)
    with _warm_up.second_core():
        assert started[0].poll() is None
    assert started[0].poll() is not None
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("executable", ["", None, os.path.join(os.sep, "no", "such", "python")])
def test_a_machine_without_an_interpreter_to_start_goes_on(monkeypatch, executable):
    monkeypatch.setattr(sys, "executable", executable)
    with _warm_up.second_core():
        pass
