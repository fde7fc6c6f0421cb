"""Plots of estimates: what they show, axes in and out, estimates that were loaded, others next to them."""

from __future__ import annotations

import pickle
from functools import cache

import numpy as np
import pytest
from matplotlib.figure import Figure

from modelgen.errors import DataError
from modelgen.runtime.curves.rebuilt import Rebuilt
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.plots.row_plots import draw_residual, draw_row
from modelgen.runtime.results.estimate import Estimate
from tests.runtime.two_mass_records import GEARED, SMALL, two_mass_records


@cache
def estimated(geared: bool = False) -> Estimate:
    return identify(GEARED if geared else SMALL, two_mass_records(geared=geared), "wls", cutoff_hz=300.0)


@pytest.mark.parametrize("geared", [False, True])
def test_bode_shows_measured_and_modelled_with_a_band(geared: bool) -> None:
    estimate = estimated(geared)
    axes = estimate.plot.bode(output="q_c")
    assert [axis.get_ylabel() for axis in axes] == ["magnitude in (rad)/(N m)", "phase in deg", "coherence"]
    assert axes[-1].get_xlabel() == "frequency in Hz"
    _, labels = axes[0].get_legend_handles_labels()
    assert labels == ["measured", "modelled, Coulomb friction at the record's amplitude", "95 %"]
    f, size = axes[0].lines[0].get_data()
    coherent = axes[2].lines[0].get_ydata() > 0.99
    modelled = np.interp(f, *axes[0].lines[2].get_data())
    # the record says what the model says, where it says anything
    assert np.median(np.abs(np.log(size / modelled))[coherent]) < 0.1


def test_fit_and_residuals_have_a_panel_a_row_and_record() -> None:
    estimate = estimated()
    rows = len(estimate.fit.rows)
    fit, residuals = np.ravel(estimate.plot.fit()), np.ravel(estimate.plot.residuals())
    assert (len(fit), len(residuals)) == (rows, 2 * rows)
    assert fit[0].get_xlabel() == "time in s"
    assert fit[0].get_legend_handles_labels()[1] == ["measured, filtered", "rebuilt", "difference"]
    assert residuals[1].get_xlabel() == "lag in ms"
    own = Figure().subplots(2, rows)
    assert estimate.plot.residuals(axes=own)[0] is own[0, 0]


def test_a_row_without_samples_says_so() -> None:
    row = Rebuilt("run", "m", "N m", 0.0, 0.01, *[np.full(30, np.nan)] * 2, masked=30, has_force=True)
    for draw in (draw_row, draw_residual):
        axis = Figure().subplots()
        draw(axis, row)
        assert [text.get_text().partition(":")[0] for text in axis.texts] == ["not drawn"]


def test_what_is_drawn_is_what_was_fitted() -> None:
    estimate = estimated()
    axes = np.ravel(estimate.plot.residuals())[::2]
    drawn = []
    for axis, row in zip(axes, estimate.fit.rows, strict=True):
        values = np.asarray(axis.lines[0].get_ydata(), dtype=float)
        assert values.size < 4000  # every sample is drawn, no lowest and highest ones
        drawn.append(row.weight * values[np.isfinite(values)])
    assert np.linalg.norm(np.concatenate(drawn)) == pytest.approx(estimate.fit.error_norm, rel=1e-9)


def test_parameters_stand_side_by_side() -> None:
    estimate, other = estimated(), identify(SMALL, two_mass_records(seed=6), "wls", cutoff_hz=300.0)
    axes = np.ravel(estimate.plot.parameters({"another day": other}))
    assert len(axes) == len(estimate.physical)
    for axis, entry in zip(axes, estimate.parameters.physical, strict=True):
        assert axis.get_xlabel() == f"{entry.name} in {entry.unit}"
        assert [label.get_text() for label in axis.get_yticklabels()] == ["this", "another day"]
        np.testing.assert_allclose(axis.lines[0].get_xdata(), entry.interval())
        assert not axis.xaxis.get_major_formatter().get_useOffset()
        assert axis.lines[3].get_xdata() == pytest.approx([other.physical[entry.name]])
    names = [label.get_text() for label in estimate.plot.parameters([other], "K").get_yticklabels()]
    assert names == ["1. wls: chirp, trapezoid", "2. wls: chirp, trapezoid"]
    narrow = estimate.plot.parameters(names=["K"], alpha=0.5).lines[0].get_xdata()
    assert np.ptp(narrow) < np.ptp(estimate.plot.parameters(names=["K"]).lines[0].get_xdata())


@pytest.mark.slow
def test_a_loaded_estimate_asks_for_model_and_records() -> None:
    estimate, records = estimated(), two_mass_records()
    for loaded in (Estimate.from_json(estimate.to_json()), pickle.loads(pickle.dumps(estimate))):
        with pytest.raises(DataError, match=r"holds no model.*give model=modelgen.load_model"):
            loaded.plot.bode()
        with pytest.raises(DataError, match=r"holds no records.*give records="):
            loaded.plot.fit(model=SMALL)
        with pytest.raises(DataError, match=r"is of emps300, sensors qm_qc, the model of geared"):
            loaded.plot.bode(model=GEARED)
        kept, again = estimate.plot.bode(), loaded.plot.bode(records[0], model=SMALL)
        for one, other in zip(kept, again, strict=True):
            for line, same in zip(one.lines, other.lines, strict=True):
                np.testing.assert_allclose(line.get_ydata(), same.get_ydata(), rtol=1e-6, equal_nan=True)
        assert len(np.ravel(loaded.plot.fit(records, model=SMALL))) == len(estimate.fit.rows)


def test_wrong_names_are_named() -> None:
    estimate = estimated()
    with pytest.raises(DataError, match="has no sensor q_x; did you mean q_m"):
        estimate.plot.bode(output="q_x")
    with pytest.raises(DataError, match="has no moving force Gamma_x"):
        estimate.plot.bode(input="Gamma_x")
    with pytest.raises(DataError, match="has no parameter J_x"):
        estimate.plot.parameters(names=["J_x"])
    with pytest.raises(DataError, match="alpha: is 2"):
        estimate.plot.parameters(alpha=2)
    with pytest.raises(DataError, match="none of those that it was identified from: chirp, trapezoid"):
        estimate.plot.fit(two_mass_records()[0].part(0, 5000, "other"))
