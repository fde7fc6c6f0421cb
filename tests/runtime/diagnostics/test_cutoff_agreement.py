from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from generated import two_mass_bench_qm_qc
from modelgen.runtime.diagnostics.cutoff_agreement import (
    Disagreement,
    FitCoordinates,
    disagreement,
    disagreement_notes,
    own_columns,
    significant_drift,
)
from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.least_squares.wls import fit_matched
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.observation import observe

X = np.array([10.0, 10.0])
BENCH = model_from_module(two_mass_bench_qm_qc)


def test_a_move_below_what_sampling_allows_does_not_count() -> None:
    tiny = Disagreement(100.0, np.array([1e-3, 1.0]), np.array([1e-9, 0.1]), X)
    assert tiny.significant.tolist() == [False, True]


def test_only_what_noise_does_not_explain_counts() -> None:
    found = (
        Disagreement(100.0, np.array([1.0, 0.1]), np.array([0.1, 0.1]), X),
        Disagreement(400.0, np.array([-2.0, 0.2]), np.array([0.1, 0.1]), X),
    )
    np.testing.assert_allclose(significant_drift(found, 2), [[2.5, 0.0], [0.0, 0.0]])
    (note,) = disagreement_notes(found, ("a", "b"), ("a", "b"))
    assert "a 20 % at 400 Hz" in note
    assert "b" not in note.split("(")[1].split(")")[0]
    assert disagreement_notes(found, ("a", "b"), ("b",)) == ()
    np.testing.assert_array_equal(significant_drift((), 2), np.zeros((2, 2)))


@pytest.mark.slow
def test_the_bench_agrees_over_cutoffs_and_periods(bench: Record) -> None:
    found = []
    for cutoff_hz, (first, last) in (
        (120.0, (1, 10)),
        (200.0, (10, 20)),
        (300.0, (1, 10)),
        (400.0, (10, 20)),
    ):
        signals = {key: s[2500 * first : 2500 * last] for key, s in bench.signals.items()}
        found.append(identify(BENCH, Record(signals, 2500.0, "periods"), "iv", cutoff_hz=cutoff_hz))
    for name in ("Jm", "Jc", "K"):
        # every interval overlaps every other, and none is blown up
        assert max(one.conf_int()[name][0] for one in found) < min(one.conf_int()[name][1] for one in found)
        assert all(1.96 * one.relative_std[name] < 10.0 for one in found)
    assert all(any("model error" in note for note in one.fit.notes) for one in found)


def test_a_record_without_samples_at_the_other_cutoff_is_compared_with_nothing() -> None:
    rng, t = np.random.default_rng(0), np.arange(4000) / 2500.0
    signals = {
        key: 50.0 * t + 0.1 * np.sin(60.0 * t**2 + phase) + 1e-4 * rng.standard_normal(4000)
        for phase, key in enumerate(BENCH.channels)
    }
    records = [Record(signals, 2500.0, name) for name in ("first", "second")]
    choice = choose_filter(BENCH, records, cutoff_hz=100.0, direction_cutoff_hz=50.0)
    fit = fit_matched(observe(BENCH, records, choice))
    kept = [index for index, block in enumerate(fit.blocks) if block.record == 0]
    fewer = replace(
        fit,
        blocks=tuple(fit.blocks[index] for index in kept),
        weights=tuple(fit.weights[index] for index in kept),
        residuals=tuple(fit.residuals[index] for index in kept),
    )
    found = disagreement(fit, choice, choice, fewer, own_columns(fit))
    assert found is not None
    assert np.all(np.isfinite(found.std))
    assert np.all(found.std > 0.0)


@pytest.mark.slow
def test_the_bench_agrees_over_periods_and_names_its_model_error(bench: Record) -> None:
    periods = [
        Record(
            {key: s[2500 * a : 2500 * b] for key, s in bench.signals.items()}, 2500.0, f"periods {a + 1}-{b}"
        )
        for a, b in ((1, 10), (10, 20))
    ]
    first, second = (identify(BENCH, record, "iv") for record in periods)
    for name in ("Jm", "Jc", "K"):
        assert first.conf_int()[name][0] < second.params[name] < first.conf_int()[name][1]
        assert second.conf_int()[name][0] < first.params[name] < second.conf_int()[name][1]
        # the intervals are not blown up
        assert 1.96 * first.relative_std[name] < 10.0
    assert any("model error" in note for note in first.fit.notes)


def test_a_drift_of_physical_parameters_is_not_seen_through() -> None:
    # three composites of two parameters; only one of the composites moves noticeably
    slope = np.array([[1.0, 0.0], [0.0, 1.0], [2.0, -1.0]])
    seen = FitCoordinates(("p", "q"), np.array([3.0, 4.0]), slope)
    np.testing.assert_allclose(seen.inverse @ slope, np.eye(2), atol=1e-12)
    noise = slope @ np.diag([1e-6, 1e-6]) @ slope.T
    moved = Disagreement(10.0, np.array([0.02, 0.0]), np.full(2, 1e-3), seen.values)
    total = noise + slope @ significant_drift((moved,), 2) @ slope.T
    # back to the parameters, weighted by that covariance
    weights = np.linalg.pinv(total, rcond=1e-10)
    back = np.linalg.inv(slope.T @ weights @ slope)
    np.testing.assert_allclose(np.sqrt(np.diag(back)), [np.hypot(0.02, 1e-3), 1e-3], rtol=1e-6)
