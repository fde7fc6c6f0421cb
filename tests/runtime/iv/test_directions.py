"""Instrumental variables and the cut-off of directions: what must not move, what is told where it does."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from generated import emps_rigid_asymmetric_qm, emps_rigid_qm
from modelgen.runtime.diagnostics.cutoff_agreement import (
    Disagreement,
    all_disagreements,
    disagreement_notes,
    significant_drift,
)
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filters.reversals import turns
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import METHODS
from modelgen.runtime.identification.options import values_of
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.model.model import Model, model_from_module
from modelgen.runtime.records.record import Record
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.rows.observation import observe
from tests.runtime.rigid_motion import CHOICE, FS, RIGID, TRUTH, rigid_record, swings

# a fast vibration that reverses the body again and again: no sample is far from a reversal
VIBRATING = swings((0.5, 0.25), (0.05, 3.0))
DIRECTIONS_HZ = (None, 10.0, 20.0, 40.0, 80.0)
EMPS = {module.__name__: model_from_module(module) for module in (emps_rigid_qm, emps_rigid_asymmetric_qm)}


def test_turns_are_changes_of_sign_with_the_rest_around_them() -> None:
    forth, back, rest = np.ones(50), -np.ones(50), np.full(10, 1e-3)
    # forward, nearly at rest, forward again, at rest, backward, a touch of zero, backward again
    velocity = np.concatenate([forth, rest, forth, rest, np.zeros(1), -rest, back, [-1e-3], back])
    assert np.flatnonzero(turns(velocity)).tolist() == list(range(110, 131))
    assert np.flatnonzero(turns(np.concatenate([forth, back]))).tolist() == [49, 50]
    assert turns(np.zeros(20)).all()
    assert not turns(2.0 + np.sin(np.arange(100.0))).any()
    # the threshold is that of the record unless it is given
    assert np.flatnonzero(turns(velocity, 1e-4)).tolist() == [119, 120, 121]


def masked(record: Record, direction_hz: float) -> int:
    choice = FilterChoice(4, 40.0, direction_hz, (10,), 30.0, 30.0, (), (), ())
    (block,) = observe(RIGID, [record], choice, turns=False).blocks
    return block.masked


def test_a_moment_of_rest_between_two_motions_the_same_way_is_used() -> None:
    # once a second, for 39 ms, it is slower than what counts as a standstill, but it never turns
    creeping = swings((0.2, 1.0), speed=0.2005)
    turning = swings((0.2, 0.5), speed=0.1)
    for direction_hz in (20.0, 40.0, 80.0):
        assert masked(rigid_record(creeping, noise=1e-8), direction_hz) == 0
        assert masked(rigid_record(turning, noise=1e-8), direction_hz) > 100


def overlapping(one: Estimate, other: Estimate, names: tuple[str, ...]) -> bool:
    pairs = [(one.conf_int()[name], other.conf_int()[name]) for name in names]
    return all(a[0] <= b[1] and b[0] <= a[1] for a, b in pairs)


@pytest.mark.slow
@pytest.mark.parametrize("model", EMPS.values(), ids=EMPS)
def test_iv_and_wls_agree_on_the_positioning_bench_whatever_the_directions(
    model: Model, emps: Record
) -> None:
    by = {
        method: [identify(model, emps, **values_of(method, direction_cutoff_hz=hz)) for hz in DIRECTIONS_HZ]
        for method in ("iv", "wls")
    }
    for one, other in product(by["iv"], by["wls"]):
        assert overlapping(one, other, model.base_parameters)
    masses = [one.params["M"] for one in by["iv"]]
    assert max(masses) - min(masses) < 0.2 * max(one.bse["M"] for one in by["iv"])


def test_what_the_positioning_bench_moves_by_is_named(emps: Record) -> None:
    estimate = identify(
        EMPS[emps_rigid_qm.__name__], emps, **values_of("iv", cutoff_hz=43.0, direction_cutoff_hz=10.0)
    )
    (note,) = [note for note in estimate.fit.notes if note.startswith("model error")]
    assert "offset" in note
    assert "with directions below 20 Hz" in note
    assert "with directions below 20 Hz" in " ".join(estimate.summary().split())


def test_directions_that_bend_the_estimate_are_in_its_interval_and_named() -> None:
    record = rigid_record(VIBRATING)
    estimate = identify(RIGID, record, **values_of("iv", cutoff_hz=40.0, direction_cutoff_hz=2.0))
    (offset,) = [entry for entry in estimate.parameters.identified if entry.name == "offset"]
    error = abs(offset.value - TRUTH["offset"])
    assert 3.0 * offset.noise_std < error < 1.96 * offset.std
    assert any("offset" in note and "with directions below 4 Hz" in note for note in estimate.fit.notes)


def test_where_directions_are_clear_nothing_is_added() -> None:
    for record, direction_hz in ((rigid_record(), 10.0), (rigid_record(VIBRATING), 6.0)):
        estimate = identify(
            RIGID, record, **values_of("iv", cutoff_hz=40.0, direction_cutoff_hz=direction_hz)
        )
        assert not any(entry.drift_std for entry in estimate.parameters.identified)
        assert not any("model error" in note for note in estimate.fit.notes)


def test_directions_are_changed_where_the_model_has_any_and_the_records_allow_it() -> None:
    record = rigid_record(n=8000)
    fit = METHODS["iv"].run(Job(RIGID, (record,), CHOICE))[1]
    tried: list[FilterChoice] = []

    def again(choice: FilterChoice) -> Fit:
        tried.append(choice)
        return fit

    found = all_disagreements(fit, CHOICE, FS, again, directions=True)
    assert [(one.directions, one.cutoff_hz) for one in found][-1] == (True, 20.0)
    assert [(one.direction_cutoff_hz, one.cutoff_hz == 40.0) for one in tried] == [
        (10.0, False),
        (10.0, False),
        (20.0, True),
    ]
    assert not any(one.directions for one in all_disagreements(fit, CHOICE, FS, again, directions=False))
    # 0.4 of the sampling frequency is the highest that is tried
    assert not any(one.directions for one in all_disagreements(fit, CHOICE, 25.0, again, directions=True))


def test_cutoffs_and_directions_add_up() -> None:
    value, std = np.array([10.0, 10.0]), np.array([0.1, 0.1])
    found = (
        Disagreement(100.0, np.array([1.0, 0.1]), std, value),
        Disagreement(400.0, np.array([0.1, 0.1]), std, value),
        Disagreement(60.0, np.array([0.2, 2.0]), std, value, directions=True),
    )
    np.testing.assert_allclose(significant_drift(found, 2), [[0.5, 0.0], [0.0, 4.0]])
    (note,) = disagreement_notes(found, ("a", "b"), ("a", "b"))
    assert "(a 10 % at 100 Hz, b 20 % with directions below 60 Hz)" in note
