from __future__ import annotations

import os

import numpy as np

from navfuse import _numba_cache


def test_arguments_reach_the_pipeline(navfuse, pipeline, project_file, tmp_path):
    code, _, _ = navfuse("run", project_file, "-o", tmp_path / "out")
    assert code == 0
    navfuse("run", project_file, "--output", tmp_path / "out", "--no-report")
    assert pipeline.calls == [(project_file, tmp_path / "out", True), (project_file, tmp_path / "out", False)]


def test_what_it_says(navfuse, pipeline, project_file, tmp_path, result):
    _, out, _ = navfuse("run", project_file, "-o", tmp_path / "out")
    assert out.startswith("forward trajectory, 5 epochs, 0.000 .. 4.000 s (4.0 s)\n")
    assert "the sky is falling" in result.describe()
    assert "the sky is falling" not in out
    assert out.endswith(f"results in {tmp_path / 'out'}; open {tmp_path / 'out' / 'report.html'}\n")
    _, out, _ = navfuse("run", project_file, "-o", tmp_path / "out", "--no-report")
    assert out.endswith(f"results in {tmp_path / 'out'}\n")


def test_quiet_says_nothing(navfuse, pipeline, project_file, tmp_path, monkeypatch):
    monkeypatch.setattr(_numba_cache, "is_cold", lambda: True)
    code, out, err = navfuse("run", project_file, "-o", tmp_path / "out", "--quiet")
    assert (code, out, err) == (0, "", "")


def test_a_misspelt_key_is_found_before_anything_is_computed(navfuse, pipeline, project_file, tmp_path):
    project_file.write_text('[imu]\nfil = "imu.csv"\n[gnss]\nfile = "gnss.csv"\n')
    code, out, err = navfuse("run", project_file, "-o", tmp_path / "out")
    assert (code, out) == (1, "")
    assert err == f"error: {project_file}: imu.fil: unknown key; did you mean imu.file?\n"
    assert pipeline.calls == []
    assert not (tmp_path / "out").exists()


def test_a_first_run_says_what_it_waits_for(navfuse, pipeline, project_file, tmp_path, monkeypatch):
    monkeypatch.setattr(_numba_cache, "is_cold", lambda: True)
    _, _, err = navfuse("run", project_file, "-o", tmp_path / "out")
    assert err.startswith("compiling the numerical kernels, once for this version")
    monkeypatch.setattr(_numba_cache, "is_cold", lambda: False)
    _, _, err = navfuse("run", project_file, "-o", tmp_path / "out")
    assert err == ""


def test_a_missing_log_leaves_nothing_behind(navfuse, project_file, tmp_path):
    code, out, err = navfuse("run", project_file, "-o", tmp_path / "out", "-q")
    assert (code, out) == (1, "")
    assert err.startswith("error: ")
    assert "imu.csv" in err
    assert not (tmp_path / "out").exists() or os.listdir(tmp_path / "out") == []


def test_logs_to_results(navfuse, tmp_path):
    """A vehicle at rest, level, facing north: the smallest real run."""
    time = np.arange(0.0, 60.0, 0.02)
    imu = ["time_s,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2"]
    imu += [f"{t:.2f},5.16e-5,0,-5.16e-5,0,0,-9.806" for t in time]
    gnss = ["time_s,lat_deg,lon_deg,height_m,sd_north_m,sd_east_m,sd_down_m"]
    gnss += [f"{t},45.0,11.0,100.0,1.0,1.0,2.0" for t in range(60)]
    (tmp_path / "imu.csv").write_text("\n".join(imu))
    (tmp_path / "gnss.csv").write_text("\n".join(gnss))
    project = tmp_path / "project.toml"
    project.write_text(
        '[imu]\nfile = "imu.csv"\n[gnss]\nfile = "gnss.csv"\n'
        "[start]\nlat_deg = 45.0\nlon_deg = 11.0\nheight_m = 100.0\nvelocity_mps = [0.0, 0.0, 0.0]\n"
        "roll_deg = 0.0\npitch_deg = 0.0\nheading_deg = 0.0\n"
    )
    code, out, err = navfuse("run", project, "-o", tmp_path / "out", "--no-report")
    assert (code, "Traceback" in err) == (0, False), err
    assert "forward and smoothed trajectory" in out
    written = {"forward.parquet", "smoothed.parquet", "innovations.parquet", "summary.json"}
    assert written <= set(os.listdir(tmp_path / "out"))
    code, out, _ = navfuse("compare", tmp_path / "out", tmp_path / "out" / "forward.parquet", "--skip-s", 5, "--json")
    assert code == 0
    assert '"epochs"' in out
