"""Slow motion of a stiff chain, seen by its motor's encoder alone, tells what moves as one."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from modelgen.errors import DataError, IdentifiabilityError
from modelgen.runtime.curves.rebuilt import rebuild
from modelgen.runtime.curves.subject import model_of
from modelgen.runtime.exports.export import export
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.one_body.found_as_one_body import best_at_lower_cutoffs
from modelgen.runtime.identification.options import Filters
from modelgen.runtime.model.mechanical_parts import BENDING
from modelgen.runtime.parameters.parameter import Parameter
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.validate import parameters_of
from tests.runtime.iv.physical.swinging_servo import TRUTH, servo, swung

HALVED = [20.0, 10.0, 5.0, 2.5, 1.25]
STIFF = {**TRUTH, "K": 600.0, "D": 0.05}


def slow_record() -> Record:
    """Return motion below 3 Hz of a chain whose mode is at 83 Hz, with noise of encoder and current."""
    made = swung(servo(), STIFF, [(0.4, 1.5, 0.0), (1.1, 0.4, 1.0), (2.7, 0.08, 2.0)], 12)
    rng = np.random.default_rng(1)
    force = made.signals["T"]
    noisy = {
        "q_m": made.signals["q_m"] + 2e-5 * rng.normal(size=made.n),
        "T": force + 1e-3 * np.abs(force).max() * rng.normal(size=made.n),
    }
    return Record(noisy, fs=made.fs, name="slow")


@pytest.mark.slow
def test_inertia_and_friction_are_told_where_the_spring_is_not() -> None:
    estimate = identify(servo(), slow_record(), cutoff_hz=8.0)
    true = {"J_m + J_l": 9e-3, "F_vm": STIFF["F_vm"], "F_sm": STIFF["F_sm"], "J_l^2/K": 5e-3**2 / 600.0}
    found = {entry.name: entry for entry in estimate.parameters.physical}
    assert list(found) == list(true)
    for name, value in true.items():
        assert abs(found[name].value - value) < 3.0 * found[name].std, name
    assert found["J_m + J_l"].relative_std < 1.0
    assert found["F_sm"].relative_std < 6.0
    for name in ("J_m", "J_l", "D", "K"):
        assert "J_m + J_l is their inertia" in estimate.not_identifiable[name]
    said = " ".join(str(estimate).split())
    assert "Next: record a chirp or steps that reach the mode of vibration" in said
    with pytest.raises(DataError, match="chain as one body"):
        export(servo(), estimate, "fmu")
    with pytest.raises(DataError, match="chain as one body"):
        parameters_of(estimate, servo())
    for name in ("F_vm", "F_sm"):  # a spring changes for how long the body sticks
        assert found[name].std > 1.9 * found[name].noise_std
    # the report and the figure have rows of the one body
    (row,), singular = rebuild(model_of(estimate, servo()), [slow_record()], estimate)
    assert row.has_force and len(singular) == len(true)


@pytest.mark.slow
def test_a_chain_whose_spring_shows_stays_one() -> None:
    made = swung(servo(), TRUTH, [(0.4, 1.5, 0.0), (2.7, 0.2, 2.0), (9.0, 0.05, 0.3), (17.0, 0.02, 1.0)], 8)
    estimate = identify(servo(), made)
    assert estimate.physical["K"] == pytest.approx(TRUTH["K"], rel=0.02)


def body_found(cutoff_hz: float, spread: float, bending: float = 0.0, advice: str = "") -> Any:
    """Return what is looked at of an estimate of one body: how certain, how it bends, what is said of it."""
    entries = tuple(
        Parameter(name, "", value, std, std, 0.0, std)
        for name, value, std in (("J", 1.0, spread), ("F", 2.0, spread), ("b", bending, 1.0))
    )
    return SimpleNamespace(
        parameters=SimpleNamespace(physical=entries),
        model=SimpleNamespace(roles={"J": "inertia", "F": "viscous", "b": BENDING}),
        checks=SimpleNamespace(advice=[SimpleNamespace(kind=advice)] if advice else []),
        fit=SimpleNamespace(filtering=SimpleNamespace(cutoff_hz=cutoff_hz)),
    )


def best(found: Mapping[float | None, Any], given: float | None = None) -> tuple[Any, list[float | None]]:
    """Return the cut-off of the best of estimates by the cut-off asked for, and those asked for."""
    asked: list[float | None] = []

    def look(filters: Filters) -> Any:
        asked.append(filters.cutoff_hz)
        if filters.cutoff_hz not in found:
            raise IdentifiabilityError.at("records", "no sample is left", "move")
        return found[filters.cutoff_hz]

    task: Any = SimpleNamespace(filters=Filters(cutoff_hz=given))
    one: Any = best_at_lower_cutoffs(task, look)
    return one and one.fit.filtering.cutoff_hz, asked


def test_the_cutoff_is_lowered_until_one_body_explains_the_rows() -> None:
    # a mode within the band bends the other way
    bent = body_found(40.0, 0.001, bending=-5.0)
    assert best({None: bent, 20.0: body_found(20.0, 0.002)}) == (20.0, [None, 20.0])
    # of what is left unexplained less certain numbers are better where they are explained
    odd = body_found(40.0, 0.001, advice="more than the model")
    every = {None: odd, 20.0: body_found(20.0, 0.05), 10.0: body_found(10.0, 0.03)}
    assert best(every) == (10.0, [None, *HALVED])
    assert best({None: odd}) == (40.0, [None, *HALVED])


def test_nothing_is_lowered_where_a_cutoff_is_given_or_nothing_is_found() -> None:
    assert best({8.0: body_found(8.0, 0.1)}, given=8.0) == (8.0, [8.0])
    assert best({}) == (None, [None])
    assert best({None: body_found(40.0, 0.5)}) == (None, [None, *HALVED])
