"""The bias that noise gives columns nonlinear in the signals: as predicted, and counted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from modelgen import CheckOptions, Filters, identify
from modelgen.runtime.diagnostics.noise_bias import lifted_along, noise_bias
from modelgen.runtime.diagnostics.noise_ways import noise_ways
from modelgen.runtime.diagnostics.row_noise import row_noise
from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.filter_choice.signal_to_noise import noise_band
from modelgen.runtime.identification.methods import WLS
from modelgen.runtime.least_squares.wls import fit_matched
from modelgen.runtime.model.model import Model
from modelgen.runtime.model.power.power_model import power_model
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.observation import observe
from modelgen.runtime.rows.row_block import RowBlock
from tests.runtime.made_arm_records import catalogued, model_of, record_of, values_of
from tests.runtime.mirrored_noise import lifted_and_expected


@cache
def arm() -> tuple[Model, dict[str, float], Record]:
    model = model_of(catalogued("two_link"))
    values = values_of(model)
    return model, values, record_of(model, values, 10.0)


def noisy(level: float, seed: int) -> Record:
    clean, rng = arm()[2], np.random.default_rng(seed)
    read = {
        k: x + level * k.startswith("q_") * rng.standard_normal(clean.n) for k, x in clean.signals.items()
    }
    return Record(read, clean.fs)


@pytest.mark.parametrize("rows", ["force", "power"])
def test_it_is_what_simulations_show(rows: str) -> None:
    model, values, clean = arm()
    used = power_model(model) if rows == "power" else model
    choice = choose_filter(used, [clean], cutoff_hz=60.0, signal_cutoff_hz=200.0)
    found, predicted = [], []
    for seed in range(2):
        record = noisy(1e-5, seed)
        fit = fit_matched(observe(used, [record], choice))
        found.append(fit.solution.x - model.base_from_physical(values))
        predicted.append(noise_bias(used, [record], choice, fit))
    one, other = np.mean(found, axis=0), np.mean(predicted, axis=0)
    scale = np.std(found, axis=0) + 0.05 * np.abs(one)
    assert np.abs(one).max() > 0.1  # there is something to predict
    assert np.linalg.norm(one - other) < 0.25 * np.linalg.norm(one)
    assert np.median(np.abs(one - other) / scale) < 3.0


def test_the_power_behind_a_row_is_its_spectrum_over_the_band() -> None:
    model, values, record = arm()
    choice = choose_filter(model, [record], cutoff_hz=60.0, signal_cutoff_hz=200.0)
    band, x = noise_band(record, choice), model.base_from_physical(values)
    for ways in noise_ways(model, record, choice, 1):
        left = ways.of_residual(x)
        for key in left.slopes:
            power = float(left.spectrum(key, band.frequency_hz) @ band.power)
            assert power > 0.0
            np.testing.assert_allclose(left.products(key, band), [[power]], rtol=1e-9)


def test_intervals_count_it_and_what_is_nothing_but_noise_is_refused() -> None:
    model, values, _ = arm()
    exact = dict(zip(model.base_parameters, model.base_from_physical(values), strict=True))
    filters, quick = Filters(cutoff_hz=60.0, signal_cutoff_hz=200.0), CheckOptions(tests=True)
    biased = identify(model, noisy(1e-5, 1), WLS(), filters, quick)
    assert any(one.kind == "biased by noise" for one in biased.checks.advice)
    for name, value in biased.params.items():
        assert abs(value - exact[name]) < 2.5 * biased.bse[name]
    drowned = identify(model, noisy(3e-4, 1), WLS(), filters, quick)
    assert {"Izz_1_R", "my_1", "mx_2", "my_2", "Izz_2"} <= {*drowned.not_identifiable}


def test_what_a_row_leaves_of_a_record_is_the_noise_that_is_expected_of_it() -> None:
    model, values, clean = arm()
    choice = choose_filter(model, [clean], cutoff_hz=60.0, signal_cutoff_hz=200.0)
    truth = model.base_from_physical(values)
    record = noisy(1e-5, 3)
    before, after = (observe(model, [one], choice).blocks for one in (clean, record))
    for one, other in zip(before, after, strict=True):
        _, here, there = np.intersect1d(one.place, other.place, return_indices=True)
        added = (other.Y - other.W @ truth)[there] - (one.Y - one.W @ truth)[here]
        expected = row_noise(model, record, choice, choice.decimation[0], one.row, truth)
        assert expected == pytest.approx(np.std(added), rel=0.1)


def smooth_reading() -> tuple[Model, np.ndarray, Callable[[float, int], Record]]:
    """The squared speed of the second row; without friction, which turns earlier or later with noise."""
    model, values, _ = arm()
    smooth = {name: value * (not name.startswith("Fs")) for name, value in values.items()}
    clean = record_of(model, smooth, 10.0)

    def read(level: float, seed: int) -> Record:
        rng = np.random.default_rng(seed)
        keys = [key for key in clean.signals if key.startswith("q_")]
        return clean.edited({k: clean.signals[k] + level * rng.standard_normal(clean.n) for k in keys})

    return model, model.base_from_physical(smooth), read


def test_noise_lifts_what_a_row_leaves_on_average_as_predicted() -> None:
    model, truth, read = smooth_reading()
    choice = choose_filter(model, [read(0.0, 0)], cutoff_hz=60.0, signal_cutoff_hz=200.0)
    lifted, expected = lifted_and_expected(model, choice, read, 1e-4, truth)
    assert len(lifted) > 200
    assert float(lifted @ expected) / float(expected @ expected) == pytest.approx(1.0, abs=0.15)


def test_products_of_noise_vary_as_predicted_and_hardly_in_a_balance_of_momentum() -> None:
    """What a squared speed adds there a position times an acceleration takes off."""
    model, truth, read = smooth_reading()
    choice = choose_filter(model, [read(0.0, 0)], cutoff_hz=60.0, signal_cutoff_hz=200.0)
    level, calm = 1e-3, observe(model, [read(0.0, 0)], choice).dense().blocks
    both = [observe(model, [read(one, 0)], choice).dense().blocks for one in (level, -level)]
    ways = noise_ways(model, read(level, 1), choice, choice.decimation[0])
    for before, up, down in zip(calm, *both, strict=True):
        here, *there = [_on_grid(block, truth) for block in (before, up, down)]
        added, one = 0.5 * (there[0] + there[1]) - here, ways[before.row].of_residual(truth)
        assert one.spread[0, 0] > 0.0
        expected = one.spread[0, 0] + np.mean(one.means**2)
        assert np.sqrt(expected / np.nanmean(added**2)) == pytest.approx(1.0, abs=0.12)


def _on_grid(block: RowBlock, point: np.ndarray) -> np.ndarray:
    found = np.full(block.grid, np.nan)
    found[block.place] = block.residual(point)
    return found


def test_what_noise_adds_on_average_is_known_along_columns_of_what_the_model_lacks() -> None:
    """It is like a zero of an encoder, or a gear, which were found where there is none."""
    model, truth, read = smooth_reading()
    choice = choose_filter(model, [read(0.0, 0)], cutoff_hz=60.0, signal_cutoff_hz=200.0)
    calm = observe(model, [read(0.0, 0)], choice).dense().blocks
    fit = fit_matched(observe(model, [read(1e-4, 0)], choice))
    fit = replace(fit, solution=replace(fit.solution, x=truth))
    found = np.zeros(len(truth))
    for seed in range(4):
        both = [observe(model, [read(level, seed)], choice).dense().blocks for level in (1e-4, -1e-4)]
        for weight, before, *pair in zip(fit.weights, calm, *both, strict=True):
            here, *there = [_on_grid(block, truth) for block in (before, *pair)]
            added = np.nan_to_num(0.5 * (there[0] + there[1]) - here)[before.place]
            found += 0.25 * weight**2 * before.W.T @ added
    expected = lifted_along(model, [read(1e-4, 0)], choice, fit, calm)
    scale = np.linalg.norm(
        np.vstack([w * block.W for w, block in zip(fit.weights, calm, strict=True)]), axis=0
    )
    assert np.linalg.norm((found - expected) / scale) < 0.35 * np.linalg.norm(expected / scale)
