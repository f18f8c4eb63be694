from __future__ import annotations

import sys

import numpy as np
import pytest

from navfuse.analysis.ensemble import average, rms_error
from navfuse.analysis.nees import components_of
from navfuse.data.layout import Block, Layout
from navfuse.report.montecarlo_figures import figure_averages, figure_rmse

TIME = np.arange(30.0)
COMPONENTS = components_of(Layout.join([Block("gyro_bias", 3, 1e-4)]))


def averages(factor=1.0):
    rng = np.random.default_rng(1)
    return [average(name, TIME, factor * rng.chisquare(3, (20, 30)), 3.0) for name in ("position", "gyro_bias")]


def test_averages_stand_in_their_bounds():
    figure = figure_averages(averages(), "NEES", settle_s=10.0)
    assert [axes.get_title() for axes in figure.axes] == ["position", "gyro bias"]
    assert figure.axes[1].get_xlabel() == "time [s]"
    assert figure.axes[0].get_ylabel() == "NEES / dof [1]"
    np.testing.assert_allclose(figure.axes[0].get_lines()[0].get_ydata(), averages()[0].mean)
    assert len(figure.axes[0].collections) == 1
    assert len(figure.axes[0].patches) == 1
    figure.canvas.draw()


@pytest.mark.parametrize(("factor", "scale"), [(1.0, "linear"), (30.0, "log")])
def test_a_bad_filter_gets_a_logarithmic_axis(factor, scale):
    assert figure_averages(averages(factor), "NIS").axes[0].get_yscale() == scale


def test_rmse_against_sigma_in_printed_units(tmp_path):
    rng = np.random.default_rng(2)
    sd = np.full((20, 30), 1e-3)
    rms = [rms_error(component, TIME, sd * rng.standard_normal((20, 30)), sd) for component in COMPONENTS[5:]]
    figure = figure_rmse(rms)
    shown = [axes for axes in figure.axes if axes.get_visible()]
    assert len(shown) == len(rms) == 7
    assert len(figure.axes) == 9
    assert shown[1].get_ylabel() == "[deg]"
    assert shown[6].get_ylabel() == "[deg/h]"
    assert shown[0].get_ylabel() == "[m/s]"
    np.testing.assert_allclose(shown[1].get_lines()[1].get_ydata(), np.degrees(1e-3))
    assert shown[1].get_title() == f"roll: ratio {rms[1].ratio:.2f}"
    figure.savefig(tmp_path / "rmse.png")
    assert (tmp_path / "rmse.png").read_bytes().startswith(b"\x89PNG")


def test_figures_need_no_global_plotting_state(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)
    figure_averages(averages()).canvas.draw()
