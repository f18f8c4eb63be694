from __future__ import annotations

import io
import sys

from navfuse.cli.progress import progress


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def shown_on(stream: io.StringIO, monkeypatch, quiet: bool = False) -> str:
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setenv("TERM", "xterm")
    with progress(quiet) as tell:
        tell("filter", 0.25)
        tell("filter", 1.0)
        tell("[smoother]", 0.5)
    return stream.getvalue()


def test_a_bar_on_a_terminal(monkeypatch):
    shown = shown_on(Terminal(), monkeypatch)
    assert "filter" in shown
    assert "[smoother]" in shown
    assert "100%" in shown


def test_silence_in_a_pipe(monkeypatch):
    assert shown_on(io.StringIO(), monkeypatch) == ""


def test_silence_on_request(monkeypatch):
    assert shown_on(Terminal(), monkeypatch, quiet=True) == ""
