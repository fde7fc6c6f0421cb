from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from generated import emps300_qm_qc, emps_rigid_asymmetric_qm, three_mass_qa_qb_qc
from modelgen.cli.candidates import spec_model
from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import METHODS, run_wls
from modelgen.runtime.identification.options import values_of
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.parameters.bounds import (
    BoundCost,
    bound_advice,
    bound_sentence,
    bounded_below_or_above,
    bounded_fit,
    impossible_columns,
)
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.simulate import simulate
from modelgen.spec.load import parse_spec
from tests.broken_sentences import hole
from tests.runtime.iv.shapes.chains import KNOWN, TWO
from tests.runtime.rigid_motion import CHOICE, FS, RIGID, SETTINGS, TRUTH, rigid_record

LOAD_SEEN = '[sensors.s]\nq_c = { body = "c", measures = "position" }\n'


@pytest.mark.parametrize("module", [emps300_qm_qc, emps_rigid_asymmetric_qm, three_mass_qa_qb_qc])
def test_signs_follow_from_the_roles(module: object) -> None:
    model = model_from_module(module)
    lower, upper = bounded_below_or_above(model)
    for name, low, high in zip(model.base_parameters, lower, upper, strict=True):
        offset = name in model.roles and model.roles[name].role == "offset"
        assert low == (-np.inf if offset else 0.0), name
        assert high == np.inf


def test_composites_of_a_sign_that_nature_does_not_have_are_impossible_beyond_chance() -> None:
    model = spec_model(parse_spec(TWO + LOAD_SEEN, "two.toml"), "s")
    levels = {"q_c": 1e-6, "T": 1e-2}
    record = simulate(model, KNOWN, "chirp", fs=2000.0, duration_s=1.0, noise=levels, oversample=8).record
    fit = run_wls(Job(model, (record,), choose_filter(model, [record])))[1]
    assert impossible_columns(model, fit) == ()
    place = fit.columns.index("D/K")
    std = float(np.sqrt(hac_covariance(fit)[place, place]))
    for deviations, told in ((2.0, ()), (4.0, ("D/K",))):
        x = fit.solution.x.copy()
        x[place] = -deviations * std
        moved = replace(fit, solution=replace(fit.solution, x=x), residuals=fit.residuals)
        assert impossible_columns(model, moved) == told


def test_bounds_that_hold_cost_nothing() -> None:
    plain = identify(RIGID, rigid_record(), **values_of("wls", **SETTINGS))
    bounded = identify(RIGID, rigid_record(), **values_of("wls", bounds="physical", **SETTINGS))
    assert bounded.params == plain.params
    assert bounded.bse == plain.bse
    cost = bounded.checks.bounds
    assert cost is not None
    assert (cost.active, cost.residual_increase) == ((), 0.0)
    assert cost.bounded == ("M", "Fv", "Fc")
    assert "none is active" in bounded.summary()
    assert plain.checks.bounds is None


def frictionless(seed: int) -> Record:
    """Without viscous friction: by chance its estimate is below zero in half of all records."""
    return rigid_record(seed=seed, force_noise=8.0, extra=lambda q, v, a: -TRUTH["Fv"] * v)


@pytest.mark.slow
def test_a_parameter_at_its_bound_has_no_number_and_its_cost_is_told() -> None:
    active = 0
    for seed in range(6):
        record = frictionless(seed)
        plain = identify(RIGID, record, **values_of("wls", drift_check=False, **SETTINGS))
        bounded = identify(
            RIGID, record, **values_of("wls", bounds="physical", drift_check=False, **SETTINGS)
        )
        cost = bounded.checks.bounds
        assert cost is not None
        if plain.params["Fv"] >= 0.0:
            assert bounded.params == plain.params
            continue
        active += 1
        assert cost.active == (("Fv", plain.params["Fv"]),)
        assert "lies at its bound, 0" in bounded.not_identifiable["Fv"]
        assert "Fv" not in bounded.conf_int()
        assert bounded.parameters.nuisance["Fv"] == 0.0
        assert cost.residual_increase > 0.0
        assert cost.deviations == pytest.approx(-plain.params["Fv"] / plain.bse["Fv"], rel=0.05)
        # no more than chance: no warning
        assert "bounds" not in [advice.kind for advice in bounded.checks.advice]
        assert bounded.bse["Fc"] < plain.bse["Fc"]
    assert 0 < active < 6


def test_the_bounded_estimate_is_the_best_within_the_bounds() -> None:
    record = rigid_record(extra=lambda q, v, a: -300.0 * v)
    fit = METHODS["wls"].run(Job(RIGID, (record,), CHOICE))[1]
    found, cost = bounded_fit(fit, RIGID, hac_covariance(fit))
    (block,) = fit.blocks
    best = lsq_linear(block.W, block.Y, ([0.0, 0.0, 0.0, -np.inf], np.inf), method="bvls", tol=1e-14)
    x = dict(zip(found.columns, found.solution.x, strict=True))
    expected = dict(zip(fit.columns, best.x, strict=True))
    for name, _ in cost.active:
        assert expected.pop(name) == pytest.approx(0.0, abs=1e-6)
    assert x == pytest.approx(expected, rel=1e-6)
    assert cost.residual_increase == pytest.approx(
        np.sqrt(2.0 * best.cost) / np.linalg.norm(fit.weighted_residual) - 1.0, rel=1e-6
    )


def test_bounds_that_contradict_the_records_are_a_warning() -> None:
    record = rigid_record(extra=lambda q, v, a: -300.0 * v)
    estimate = identify(RIGID, record, **values_of("wls", bounds="physical", **SETTINGS))
    (advice,) = [one for one in estimate.checks.advice if one.kind == "bounds"]
    assert "Fv" in advice.where
    assert "standard deviations from what the records say" in advice.what
    reversed_sign = Record({"q_m": -rigid_record().signals["q_m"], "F": rigid_record().signals["F"]}, FS)
    assert identify(
        RIGID, reversed_sign, **values_of("wls", bounds="physical", **SETTINGS)
    ).params.keys() == {"offset"}


def test_instruments_can_be_bounded() -> None:
    record = rigid_record(n=12000, extra=lambda q, v, a: -300.0 * v)
    estimate = identify(RIGID, record, **values_of("iv", bounds="physical", **SETTINGS))
    assert "Fv" in estimate.not_identifiable
    assert estimate.params["M"] > 0.0


@given(st.lists(st.sampled_from(("M", "Fv", "Fc")), unique=True), st.integers(0, 3), st.floats(0.0, 9.0))
def test_what_is_said_of_bounds_has_no_hole(bounded: list[str], active: int, deviations: float) -> None:
    at_zero = tuple((name, -1.0) for name in bounded[:active])
    cost = BoundCost(tuple(bounded), at_zero, 0.1, deviations if at_zero else 0.0)
    assert hole(bound_sentence(cost)) is None
    assert [hole(one.sentence) for one in bound_advice(cost)] in ([], [None])
