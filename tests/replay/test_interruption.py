"""What is on the disk when a run cannot finish: the earlier result, whole, and nothing else."""

from __future__ import annotations

import os
import pty
import resource
import select
import signal
import subprocess
import sys
import time

import numpy as np
import pandas as pd
import pytest

from replay.job import navfuse

EARLIER = {"forward.parquet": "earlier forward", "summary.json": "{}", "notes.txt": "mine"}
PATIENCE_S = 120.0


def earlier_results(folder):
    folder.mkdir()
    for name, text in EARLIER.items():
        (folder / name).write_text(text)
    return folder


def assert_untouched(folder):
    assert {path.name: path.read_text() for path in folder.iterdir()} == EARLIER


def program(path, output, **more):
    command = [sys.executable, "-m", "navfuse", "run", str(path), "-o", str(output)]
    return subprocess.Popen(command, text=True, stdout=subprocess.PIPE, **{"preexec_fn": heed_ctrl_c} | more)


def heed_ctrl_c():
    """As at a terminal: what a shell puts into the background ignores the signal, and its children inherit that."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@pytest.fixture
def long_job(job):
    """A quarter of an hour of standing still, with fixes so dense that a run takes seconds."""
    time_s = np.arange(0.0, 900.0, 0.02)
    job.imu = pd.DataFrame(0.0, index=range(time_s.size), columns=job.imu.columns)
    job.imu["time_s"] = time_s
    job.imu["accel_z_mps2"] = -9.807
    stamps = np.arange(0.0, 900.0, 0.05)
    job.gnss = pd.DataFrame({"time_s": stamps, "lat_deg": 45.0, "lon_deg": 11.0, "height_m": 100.0})
    job.gnss[["sd_north_m", "sd_east_m", "sd_down_m"]] = 1.0
    job.gnss_name = "gnss.parquet"
    return job.set("gnss", file="gnss.parquet").set("start", heading_deg=0.0)


def interrupted(path, output, stage):
    """Press Ctrl-C as soon as the progress bar names a stage; exit code and all that the terminal showed."""
    terminal, other_end = pty.openpty()
    running = program(path, output, stderr=other_end, env={**os.environ, "TERM": "xterm", "COLUMNS": "100"})
    os.close(other_end)
    shown = b""
    patience = time.monotonic() + PATIENCE_S
    while stage.encode() not in shown:
        assert time.monotonic() < patience, shown
        assert running.poll() is None, shown
        if select.select([terminal], [], [], 0.1)[0]:
            shown += os.read(terminal, 65536)
    running.send_signal(signal.SIGINT)
    while True:
        try:
            piece = os.read(terminal, 65536)
        except OSError:
            break
        if not piece:
            break
        shown += piece
    os.close(terminal)
    out, _ = running.communicate(timeout=PATIENCE_S)
    return running.returncode, out, shown.decode()


@pytest.mark.parametrize(("stage", "exists"), [("filter", True), ("smoother", False)])
def test_ctrl_c(long_job, stage, exists):
    output = earlier_results(long_job.output) if exists else long_job.output / "deep" / "er"
    path = long_job.write()
    before = sorted(long_job.folder.rglob("*"))
    code, out, shown = interrupted(path, output, stage)
    assert code == 130, shown
    assert out == ""
    assert shown.rstrip().endswith("interrupted")
    assert "Traceback" not in shown
    assert sorted(long_job.folder.rglob("*")) == before
    if exists:
        assert_untouched(output)


def test_a_file_in_place_of_the_output_folder(job):
    job.output.write_text("mine")
    code, out, err = job.run()
    assert (code, out) == (1, "")
    assert err == f"error: {job.output}: is a file, not a folder; choose another name\n"
    assert job.output.read_text() == "mine"


def test_an_output_folder_under_a_file(job):
    path = job.write()
    code, out, err = navfuse("run", path, "-o", path / "deep" / "out")
    assert (code, out) == (1, "")
    assert err.startswith(f"error: {path / 'deep' / 'out'}: ")
    assert f"'{path}' is a file" in err


def test_an_output_folder_where_nothing_can_be_made(job):
    code, out, err = navfuse("run", job.write(), "-o", "/proc/navfuse-out")
    assert (code, out) == (1, "")
    assert err.startswith("error: /proc/navfuse-out: cannot be written: ")


def test_the_output_folder_is_found_bad_before_the_logs_are_read(job):
    job.output.write_text("mine")
    (job.folder / "imu.parquet").write_text("not read")
    _, _, err = navfuse("run", job.write_project(), "-o", job.output)
    assert "is a file, not a folder" in err


def test_the_disk_is_full(job):
    """Stood in for by a limit on the size of files."""
    path = job.write()
    assert job.done().outcome.code == 0
    output = earlier_results(job.folder / "results")

    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, 50_000))

    running = program(path, output, stderr=subprocess.PIPE, preexec_fn=limit)
    out, err = running.communicate(timeout=PATIENCE_S)
    assert running.returncode == 1, err
    assert out == ""
    told = [line for line in err.splitlines() if not line.startswith("compiling the numerical kernels")]
    assert len(told) == 1
    assert told[0].startswith("error: ")
    assert "cannot be written" in told[0]
    assert_untouched(output)


def test_a_finished_run_replaces_the_earlier_result_and_nothing_else(job):
    earlier_results(job.output)
    (job.output / "smoothed.csv").write_text("of an earlier run with other formats")
    done = job.done()
    assert {path.name for path in job.output.iterdir()} == {
        "forward.parquet",
        "smoothed.parquet",
        "innovations.parquet",
        "states.parquet",
        "fixes.parquet",
        "imu.json",
        "summary.json",
        "notes.txt",
    }
    assert len(done.trajectory()) == 1201
    assert (job.output / "notes.txt").read_text() == "mine"
