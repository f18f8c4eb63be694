from __future__ import annotations

import webbrowser
from pathlib import Path

from navfuse import _numba_cache


def test_arguments_reach_the_pipeline(navfuse, pipeline, tmp_path):
    code, out, _ = navfuse("demo", "-o", tmp_path, "--seed", 7)
    assert code == 0
    assert pipeline.calls == [(tmp_path, 7)]
    assert out == f"horizontal error: 0.3 m\nopen {tmp_path}/report.html\n"


def test_defaults(navfuse, pipeline):
    navfuse("demo")
    assert pipeline.calls == [(Path("demo-output"), 1)]


def test_browser_only_on_request(navfuse, pipeline, tmp_path, monkeypatch):
    opened = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    navfuse("demo", "-o", tmp_path)
    assert opened == []
    navfuse("demo", "-o", tmp_path, "--open")
    assert opened == [(tmp_path / "report.html").as_uri()]


def test_a_first_run_says_what_it_waits_for(navfuse, pipeline, tmp_path, monkeypatch):
    monkeypatch.setattr(_numba_cache, "is_cold", lambda: True)
    _, _, err = navfuse("demo", "-o", tmp_path)
    assert err.startswith("compiling the numerical kernels, once for this version")


def test_the_demo_itself(navfuse, tmp_path):
    code, out, err = navfuse("demo", "-o", tmp_path / "demo")
    assert (code, "Traceback" in err) == (0, False), err
    assert (tmp_path / "demo" / "report.html").stat().st_size > 10_000
    assert "report.html" in out
