from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from generated import emps_rigid_qm
from modelgen.runtime.model.mechanical_parts import Role
from modelgen.runtime.model.model import Model, model_from_module
from modelgen.runtime.parameters import physical_parameters as physical
from modelgen.runtime.parameters.physical_parameters import Covariances, physical_parameters
from tests.broken_sentences import hole

Formula = Callable[[np.ndarray], dict[str, float]]


def direct_model(physical: Formula, names: tuple[str, ...]) -> Model:
    """A model without composites whose physical parameters are a formula of two base parameters."""
    module = SimpleNamespace(physical_from_base=physical)
    whole = model_from_module(emps_rigid_qm)
    return replace(whole, module=module, parameters=names, identifiable=names, base_parameters=("b0", "b1"))


def composite_model() -> Model:
    """Two physical parameters in three composites: J, J K and J / K."""

    def base(p: Mapping[str, float]) -> np.ndarray:
        return np.array([p["J"], p["J"] * p["K"], p["J"] / p["K"]])

    def jacobian(p: Mapping[str, float]) -> np.ndarray:
        return np.array([[1.0, 0.0], [p["K"], p["J"]], [1.0 / p["K"], -p["J"] / p["K"] ** 2]])

    module = SimpleNamespace(base_from_physical=base, base_jacobian=jacobian)
    return replace(
        model_from_module(emps_rigid_qm),
        module=module,
        parameters=("J", "K"),
        identifiable=("J", "K"),
        base_parameters=("J", "J*K", "J/K"),
        composites={"J*K": "J*K", "J/K": "J/K"},
        roles={"J": Role("inertia", ("m",)), "K": Role("stiffness", ("m",))},
    )


def covariances(total: np.ndarray) -> Covariances:
    return Covariances(total, 0.25 * total, 0.75 * total, 0.01 * total)


def test_standard_deviations_are_carried_through_to_first_order() -> None:
    model = direct_model(lambda b: {"K": float(b[0] * b[1]), "J": float(b[1] / b[0])}, ("K", "J"))
    base, total = np.array([2.0, 5.0]), np.array([[0.04, 0.01], [0.01, 0.09]])
    found = physical_parameters(model, base, covariances(total), {}, {})
    assert [(entry.name, entry.value) for entry in found.parameters] == [("K", 10.0), ("J", 2.5)]
    for entry, gradient in zip(found.parameters, ([5.0, 2.0], [-1.25, 0.5]), strict=True):
        variance = np.array(gradient) @ total @ np.array(gradient)
        assert entry.std == pytest.approx(np.sqrt(variance), rel=1e-8)
        assert entry.noise_std == pytest.approx(0.5 * entry.std)
        assert entry.drift_std == pytest.approx(np.sqrt(0.75) * entry.std)
        assert entry.printed_std == pytest.approx(0.1 * entry.std)
    assert found.unanswered == {}


def test_what_depends_on_a_refused_base_parameter_gets_a_reason_and_no_number() -> None:
    model = direct_model(
        lambda b: {"a": float(b[0]), "b1": float(b[1]), "c": float(b[0] + b[1])}, ("a", "b1", "c")
    )
    base = np.array([2.0, np.nan])
    found = physical_parameters(model, base, covariances(np.eye(1)), {"b1": "never seen"}, {"b1": 7.0})
    assert [entry.name for entry in found.parameters] == ["a"]
    assert found.parameters[0].std == pytest.approx(1.0)
    assert found.unanswered == {"c": "depends on b1, which the records cannot answer"}


def test_more_composites_than_parameters_are_fitted_with_their_weights() -> None:
    model, total = composite_model(), np.diag([1.0, 1e-4, 1e-4])
    # J alone is poor; the other two give J = 6 and K = 2
    found = physical_parameters(model, np.array([7.0, 12.0, 3.0]), covariances(total), {}, {})
    values = {entry.name: entry.value for entry in found.parameters}
    assert values["J"] == pytest.approx(6.0, abs=1e-3)
    assert values["K"] == pytest.approx(2.0, abs=1e-3)
    J, K = 6.0, 2.0
    slopes = np.array([[1.0, 0.0], [K, J], [1.0 / K, -J / K**2]])
    expected = np.sqrt(np.diag(np.linalg.inv(slopes.T @ np.linalg.inv(total) @ slopes)))
    np.testing.assert_allclose([entry.std for entry in found.parameters], expected, rtol=1e-3)


def test_composites_that_are_left_may_still_determine_everything() -> None:
    base = np.array([np.nan, 12.0, 3.0])
    refused = {"J": "not seen"}
    found = physical_parameters(composite_model(), base, covariances(np.eye(2)), refused, {"J": 5.0})
    assert {entry.name: round(entry.value, 6) for entry in found.parameters} == {"J": 6.0, "K": 2.0}
    assert found.unanswered == {}


def test_composites_that_do_not_determine_a_parameter_give_no_number() -> None:
    base = np.array([np.nan, 12.0, np.nan])
    refused = {"J": "not seen", "J/K": "not seen"}
    found = physical_parameters(composite_model(), base, covariances(np.eye(1)), refused, {"J": 5.0})
    assert found.parameters == ()
    assert found.unanswered == {"K": "depends on J, J/K, which the records cannot answer"}


@given(st.sets(st.integers(0, 2), max_size=2), st.booleans())
def test_no_reason_has_a_hole_whatever_is_missing(missing: set[int], told: bool) -> None:
    model = composite_model()
    base = np.array([np.nan if k in missing else value for k, value in enumerate((6.0, 12.0, 3.0))])
    names = [model.base_parameters[k] for k in sorted(missing)]
    refused = dict.fromkeys(names, "not seen") if told else {}
    C = np.eye(3 - len(missing))
    found = physical_parameters(model, base, covariances(C), refused, {"J": 5.0})
    reasons = [f"{name}: {why}" for name, why in found.unanswered.items()]
    named = {*found.unanswered, *refused} | {entry.name for entry in found.parameters}
    assert named >= set(model.identifiable)
    assert [hole(reason) for reason in reasons] == [None] * len(reasons)


@given(st.floats(-1.0, 1.0), st.floats(1e-6, 1e-3))
def test_drift_is_carried_on_and_does_not_weigh(direction: float, noise: float) -> None:
    model = composite_model()
    C, along = noise**2 * np.diag([36.0, 144.0, 9.0]), 10.0 * np.array([1.0, direction, -0.5])
    base = np.array([6.0, 12.0, 3.0]) * (1.0 + noise * np.array([1.0, -1.0, 0.5]))
    drifting = Covariances(C + np.outer(along, along), C, np.outer(along, along), C)
    quiet = physical_parameters(model, base, Covariances(C, C, 0.0 * C, C), {}, {}).parameters
    for one, same in zip(physical_parameters(model, base, drifting, {}, {}).parameters, quiet, strict=True):
        assert one.value == same.value
        assert one.noise_std == same.noise_std
        assert one.std == pytest.approx(np.hypot(one.noise_std, one.drift_std), rel=1e-3)
        assert one.drift_std >= same.drift_std


@pytest.mark.parametrize("apart", [0.0, 2.0, 10.0, 1000.0])
def test_composites_that_contradict_each_other_widen_the_intervals(apart: float) -> None:
    model, spread = composite_model(), np.array([0.06, 0.12, 0.03])
    C = np.diag(spread**2)
    base = np.array([6.0, 12.0, 3.0]) + apart * spread * np.array([1.0, 0.0, -1.0])
    found = physical_parameters(model, base, Covariances(C, C, 0.0 * C, C), {}, {})
    consistent = physical_parameters(model, np.array([6.0, 12.0, 3.0]), Covariances(C, C, 0.0 * C, C), {}, {})
    assert bool(found.notes) == (apart > 5.0)
    if apart > 5.0:
        assert "contradict each other" in found.notes[0]
        # whatever was to be believed, the truth is inside
        for one, true in zip(found.parameters, (6.0, 2.0), strict=True):
            assert abs(one.value - true) < 2.0 * one.std
    for one, plain in zip(found.parameters, consistent.parameters, strict=True):
        assert one.noise_std == pytest.approx(plain.noise_std, rel=0.3) or apart > 100.0


def test_contradictions_are_told_as_often_as_chance_has_it() -> None:
    model, rng, told = composite_model(), np.random.default_rng(3), 0
    spread = np.array([0.06, 0.12, 0.03])
    C = np.diag(spread**2)
    for _ in range(300):
        base = np.array([6.0, 12.0, 3.0]) + spread * rng.standard_normal(3)
        told += bool(physical_parameters(model, base, Covariances(C, C, 0.0 * C, C), {}, {}).notes)
    assert told <= 3


def test_a_solution_with_other_weights_is_the_only_start_where_it_leads_to_a_chain(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    model, base = composite_model(), np.array([2.0, 7.0, 0.66])  # J K and J / K say 3.5 and 3.03
    total, looked = np.diag([1e-4, 1e-4, 1e-6]), list[str]()
    for name in ("nearest_parameters", "robust_starts"):
        search = getattr(physical, name)
        monkeypatch.setattr(
            physical, name, lambda *given, name=name, search=search: looked.append(name) or search(*given)
        )
    searched = physical_parameters(model, base, covariances(total), {}, {})
    # they contradict each other: all starts were tried
    assert searched.factor > 1.0
    assert looked == ["nearest_parameters", "robust_starts"]
    looked.clear()
    again = physical_parameters(model, base, covariances(total), {}, {}, known={"J": 2.1, "K": 3.2})
    assert looked == []
    for one, other in zip(again.parameters, searched.parameters, strict=True):
        assert one.value == pytest.approx(other.value, rel=1e-6)
        assert one.std == pytest.approx(other.std, rel=1e-6)
    # from there the stiffness stays below zero: no chain
    physical_parameters(model, base, covariances(total), {}, {}, known={"J": -2.0, "K": -3.0})
    assert "nearest_parameters" in looked
