from __future__ import annotations

from navfuse.config import help_keys, load_project, template


def test_template_is_printed_and_can_be_loaded(navfuse, tmp_path):
    code, out, err = navfuse("config")
    assert (code, out, err) == (0, template(), "")
    path = tmp_path / "project.toml"
    path.write_text(out)
    assert load_project(path).imu.file == tmp_path / "imu.parquet"


def test_every_key_is_listed(navfuse, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    code, out, _ = navfuse("config", "--help-keys")
    assert code == 0
    heads = [line for line in out.splitlines() if not line.startswith(" ")]
    assert [line.split(":")[0].split(" ")[0] for line in heads] == [entry.key for entry in help_keys()]
    assert "imu.file: path; required" in heads
    assert "output.rate_hz [Hz]: number, >= 0 and <= 1000; default 10.0" in heads
    assert "start.lat_deg [deg]: number, >= -90 and <= 90" in heads
