from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np

from navfuse.report.figures import figure_errors, figure_map


def test_map_is_to_scale_and_shows_every_kind_of_fix(drive, tmp_path):
    figure = figure_map(*drive)
    axes = figure.axes[0]
    assert axes.get_aspect() == 1.0
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    assert labels == ["fixes used", "fixes rejected", "fixes withheld", "filter", "smoother", "truth", "start"]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("east of the start [m]", "north of the start [m]")
    figure.savefig(tmp_path / "map.png")
    assert (tmp_path / "map.png").read_bytes().startswith(b"\x89PNG")


def test_errors_have_units_and_an_envelope(drive):
    figure = figure_errors(*drive)
    assert [axes.get_ylabel() for axes in figure.axes][::3] == ["north [m]", "east [m]", "down [m]"]
    assert [axes.get_ylabel() for axes in figure.axes][2::3] == ["roll [deg]", "pitch [deg]", "heading [deg]"]
    assert figure.axes[-1].get_xlabel() == "log time [s]"
    line = figure.axes[0].get_lines()[0]
    assert line.get_label() == "filter"
    shown = np.abs(figure.axes[0].get_ylim())
    assert (shown > np.abs(line.get_ydata()).max()).all()
    assert len(figure.axes[0].collections) == 2
    figure.canvas.draw()


def test_a_truth_with_positions_only_gives_one_column(drive):
    result, truth = drive
    bare = replace(truth, velocity_n=None, attitude=None)
    assert len(figure_errors(replace(result, smoothed=None), bare).axes) == 3
    exact = replace(result, forward=bare, smoothed=None)
    assert len(figure_errors(exact, bare).axes) == 3


def test_a_map_without_fixes(drive):
    labels = [text.get_text() for text in figure_map(replace(drive[0], fixes=None)).axes[0].get_legend().get_texts()]
    assert labels == ["filter", "smoother", "start"]


def test_figures_need_no_global_plotting_state(drive, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)
    figure_map(*drive).canvas.draw()
    figure_errors(*drive).canvas.draw()
