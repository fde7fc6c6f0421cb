"""Measured beside modelled responses: a delay that was found is no difference of phase."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from generated import emps300_qm_qc
from modelgen.runtime.curves.responses import responses
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.records.record import Record
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.simulation.simulate import simulate

MODEL = model_from_module(emps300_qm_qc)


@pytest.fixture(scope="module")
def clean() -> tuple[Record, Estimate]:
    record = simulate(MODEL, MODEL.parameter_sets["light"], "chirp", duration_s=1.0, oversample=4).record
    return record, identify(MODEL, [record], "wls")


@pytest.mark.parametrize("samples", [-4, 3, 9])
@pytest.mark.parametrize("late", ["Gamma_m", "q_m"])
def test_a_delay_that_was_found_is_taken_out_and_told(
    clean: tuple[Record, Estimate], late: str, samples: int
) -> None:
    record, estimate = clean
    moved = Record({**record.signals, late: np.roll(record.signals[late], samples)}, record.fs, record.name)
    found = replace(estimate, fit=replace(estimate.fit, delays={late: samples / record.fs}))
    (before,) = responses(MODEL, record, replace(estimate, fit=replace(estimate.fit, delays={})), ["q_m"])
    (after,) = responses(MODEL, moved, found, ["q_m"])
    moving = (before.measured.coherence > 0.9) & (before.measured.frequency_hz < 200.0)
    turned = np.angle(after.measured.response / before.measured.response)[moving]
    assert np.degrees(np.abs(turned)).max() < 2.0
    assert not any("delay" in note for note in before.modelled.notes)
    word = "late" if samples > 0 else "early"
    assert any(f"{late} is {1e3 * abs(samples) / record.fs:.3g} ms {word}" in n for n in after.modelled.notes)
