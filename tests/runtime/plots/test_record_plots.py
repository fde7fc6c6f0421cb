"""Plots of records: axes in and out, labels with units, all peaks, nothing shown and nothing changed."""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure

from generated import emps300_qm_ac
from modelgen.errors import DataError
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.plots.axes import DARK, LIGHT, colours
from modelgen.runtime.records.record import Record

MODEL = model_from_module(emps300_qm_ac)


def bench(n: int = 3000) -> Record:
    rng = np.random.default_rng(0)
    return Record({key: rng.standard_normal(n) for key in ("q_m", "a_c", "Gamma_m")}, 1000.0, "bench")


def test_a_panel_a_channel_with_units() -> None:
    axes = bench().plot(model=MODEL)
    assert [axis.get_ylabel() for axis in axes] == ["q_m in rad", "a_c in rad/s^2", "Gamma_m in N m"]
    assert axes[-1].get_xlabel() == "time in s"
    assert bench().plot("q_m").get_ylabel() == "q_m in SI units"


@pytest.mark.parametrize("n", [50, 4000, 4001, 600_000])
def test_every_peak_is_drawn(n: int) -> None:
    samples = np.zeros(n)
    samples[n // 3], samples[n // 2] = 5.0, -7.0
    axis = Record({"q_m": samples}, 1000.0).plot()
    low, high = axis.dataLim.intervaly
    assert (low, high) == (-7.0, 5.0)
    assert axis.dataLim.x1 == pytest.approx((n - 1) / 1000.0, abs=n / 1000.0 / 2000.0)


def test_given_axes_are_drawn_into() -> None:
    own = Figure().subplots(2, 1)
    found = bench().plot(["a_c", "q_m"], axes=own)
    assert list(found) == list(own)
    one = Figure().subplots()
    assert bench().plot(["q_m"], axes=one) is one
    for draw in (bench().plot, bench().plot.spectra):
        with pytest.raises(DataError, match="axes: are 2; give 3"):
            draw(axes=own)


def test_spectra_show_the_white_noise() -> None:
    axis = bench(20000).plot.spectra(["q_m"], model=MODEL)
    assert axis.get_xlabel() == "frequency in Hz"
    assert axis.get_ylabel() == "q_m in rad / √Hz"
    # of unit variance, one-sided over 500 Hz
    assert axis.lines[-1].get_ydata()[0] == pytest.approx(np.sqrt(1.0 / 500.0), rel=0.1)


def test_a_frequency_response_has_three_panels() -> None:
    axes = bench().frequency_response("q_m", "Gamma_m").plot(unit="rad/(N m)")
    labels = ["magnitude in rad/(N m)", "phase in deg", "coherence"]
    assert [axis.get_ylabel() for axis in axes] == labels
    assert axes[-1].get_xlabel() == "frequency in Hz"


def test_names_are_no_formulas() -> None:
    record = Record({r"i_$\bad$": np.arange(9.0), "q": np.arange(9.0) ** 2}, 1000.0, r"costs $5, $\bad{$")
    for axes in (record.plot(), record.plot.spectra()):
        axes[0].figure.canvas.draw()  # which would raise
        assert axes[0].get_title(loc="left").startswith(r"costs $5, $\bad{$")


def test_nothing_of_matplotlib_is_changed() -> None:
    before = dict(mpl.rcParams)
    bench().plot()
    bench().plot.spectra()
    assert dict(mpl.rcParams) == before


def test_a_new_figure_is_one_of_pyplot_where_that_is_in_use(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "matplotlib.pyplot", raising=False)
    bench().plot()
    assert "matplotlib.pyplot" not in sys.modules
    mpl.use("agg")
    pyplot = import_module("matplotlib.pyplot")

    try:
        pyplot.close("all")
        axes = bench().plot()
        assert pyplot.gcf() is axes[0].figure
        bench().plot(axes=axes)
        assert len(pyplot.get_fignums()) == 1
    finally:
        pyplot.close("all")


def test_in_a_notebook_a_new_figure_is_one_of_pyplot_s(monkeypatch: pytest.MonkeyPatch) -> None:
    mpl.use("agg")
    monkeypatch.setitem(sys.modules, "ipykernel", ModuleType("ipykernel"))
    axes = bench().plot()
    pyplot = sys.modules["matplotlib.pyplot"]
    try:
        assert pyplot.gcf() is axes[0].figure  # type: ignore[attr-defined]
    finally:
        pyplot.close("all")  # type: ignore[attr-defined]


def test_colours_suit_the_ground() -> None:
    for ground, expected in (("white", LIGHT), ("black", DARK), ("#14181d", DARK), ("#f3f5f7", LIGHT)):
        axis = Figure().subplots()
        axis.set_facecolor(ground)
        assert colours(axis) is expected
        axis = Figure(facecolor=ground).subplots()
        axis.set_facecolor("none")
        assert colours(axis) is expected


def test_what_is_absent_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(DataError, match="has no channel q_x"):
        bench().plot(["q_x"])
    with pytest.raises(DataError, match="channels: are none"):
        bench().plot([])
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(DataError, match=r"needs matplotlib.*pip install 'modelgen\[plot\]'"):
        bench().plot()
