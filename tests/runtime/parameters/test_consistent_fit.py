"""Physical bounds of arms through `identify`: links become bodies, and it is said what that costs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from modelgen import CheckOptions, Estimate, Filters, Record, identify
from modelgen.errors import DataError
from modelgen.render.arms.arm_writer import arm_module
from modelgen.runtime.identification.methods import WLS, run_wls
from modelgen.runtime.identification.task import prepared
from modelgen.runtime.model.model import Model, model_from_text
from modelgen.runtime.parameters.bounds import BoundCost, bound_advice, bound_sentence
from modelgen.runtime.parameters.consistent_fit import among_bodies, bodies_of
from modelgen.runtime.parameters.consistent_links import LINK
from modelgen.symbolic.arms.arm_rows import arm_rows
from modelgen.symbolic.arms.base_parameters import arm_base_model
from tests.symbolic.arms.elastic_arms import SPATIAL, exact_record, readings, spatial
from tests.symbolic.arms.made_arms import serial

pytest.importorskip("clarabel", reason="the extra arms is not installed")
QUICK = CheckOptions(tests=False, drift_check=False)
FS = 200.0
FILTERS = Filters(cutoff_hz=12.0)


def made(elastic: bool, noise: float, seed: int = 1, **held: float) -> tuple[Model, Record, dict[str, float]]:
    """Return a model, a record with noise, and the parameters: links made of points.

    Torques have noise of that share of their size; encoders of elastic joints of a thousandth of it in rad,
    since no torque is in the rows of their links.
    """
    spec = spatial() if elastic else serial(SPATIAL, True)
    spec = replace(spec, known=held)
    sensor_set = "encoders" if elastic else ""
    model = model_from_text(arm_module(arm_base_model(arm_rows(spec, sensor_set=sensor_set))), "arm")
    rng = np.random.default_rng(seed)
    values = {name: float(rng.uniform(0.3, 1.0)) for name in (*model.parameters, *held)}
    values |= {joint.stiffness: 1500.0 for joint in spec.moving if joint.stiffness}
    for names in bodies_of(model)[0].values():
        points, masses = rng.normal(0.0, 0.03, (6, 3)), rng.uniform(0.1, 0.6, 6)
        tensor = sum(m * (x @ x * np.eye(3) - np.outer(x, x)) for m, x in zip(masses, points, strict=True))
        numbers = [*np.asarray(tensor)[np.triu_indices(3)], *(masses @ points), masses.sum()]
        values |= dict(zip(names, map(float, numbers), strict=True))
    values |= held
    motion, forces = exact_record(spec, values, np.arange(0.0, 12.0, 1.0 / FS), rng)
    if elastic:
        signals = readings(spec, motion, forces, sensor_set)
    else:
        signals = {f"q_{joint.name}": motion[joint.name, 0] for joint in spec.moving}
        signals |= {f"tau_{joint.name}": forces[f"force {joint.name}"] for joint in spec.moving}
    record = Record({key: signals[key] for key in model.channels}, FS, "arm")
    sizes = {key: np.std(record.signals[key]) if key.startswith("tau_") else 1e-3 for key in record.keys}
    loud = {
        key: value + noise * sizes[key] * rng.standard_normal(record.n)
        for key, value in record.signals.items()
        if elastic or key.startswith("tau_")
    }
    return model, record.edited(loud), values


def bounded(model: Model, record: Record) -> Estimate:
    return identify(model, record, WLS(bounds="physical"), FILTERS, QUICK)


@pytest.mark.parametrize("elastic", [False, True])
def test_links_of_noisy_records_become_bodies_and_the_price_is_told(elastic: bool) -> None:
    model, record, _ = made(elastic, 0.5)
    plain = identify(model, record, WLS(), FILTERS, QUICK)
    found = bounded(model, record)
    cost = found.checks.bounds
    assert cost is not None and cost.held and cost.bodies == ("link 1", "link 2", "link 3")
    assert 0.0 < cost.residual_increase < 0.05 and cost.deviations > 0.0
    assert all(name in found.params or name in found.not_identifiable for name in plain.params)
    assert all(found.params[name] >= 0.0 for name in bodies_of(model)[1] if name in found.params)
    # the bound tells something, and the intervals know of it
    widths = np.array([found.bse[name] / plain.bse[name] for name in plain.params if name in found.params])
    assert np.exp(np.mean(np.log(widths))) < 0.97 and widths.min() < 0.8
    assert "moved onto what a body can have: link" in " ".join(found.summary().split())


def test_in_the_metric_of_the_rows_bodies_are_nearer_to_the_truth() -> None:
    for seed in range(2, 6):
        model, record, values = made(False, 0.5, seed)
        plain = run_wls(prepared(model, record, WLS(), FILTERS, QUICK).job)[1]
        within, found = among_bodies(plain, model)
        places = [model.base_parameters.index(name) for name in plain.columns]
        truth = model.base_from_physical(values)[places]
        metric = plain.triangle[: len(truth), : len(truth)]
        before, after = (np.linalg.norm(metric @ (one.solution.x - truth)) for one in (plain, within))
        assert after < 0.95 * before and found.cost > 1.0
        np.testing.assert_allclose(model.base_from_physical(found.parameters)[places], within.solution.x)


def test_what_is_consistent_stays_and_costs_nothing() -> None:
    model, record, _ = made(False, 1e-4)
    plain = identify(model, record, WLS(), FILTERS, QUICK)
    found = bounded(model, record)
    cost = found.checks.bounds
    assert cost is not None and not cost.held and not cost.active and cost.residual_increase == 0.0
    assert found.params == plain.params and found.bse == plain.bse
    assert "they cost nothing" in found.summary()


def test_bodies_that_bounds_hardly_move_are_not_drawn_further_inside() -> None:
    """Their shapes are what the rows say: likely ones had 1.3 times the error of no bounds."""
    model, record, _ = made(False, 0.05)
    plain = run_wls(prepared(model, record, WLS(), FILTERS, QUICK).job)[1]
    within, found = among_bodies(plain, model)
    assert found.held and 0.0 < found.cost < 1.0
    c = len(plain.columns)
    moved = plain.triangle[:c, :c] @ (within.solution.x - plain.solution.x)
    sigma = plain.residual_norm / np.sqrt(plain.count - c)
    assert np.linalg.norm(moved) / sigma == pytest.approx(np.sqrt(found.cost), rel=1e-3)
    np.testing.assert_array_equal(within.solution.inverse, plain.solution.inverse)


def test_known_parameters_of_links_count_in_their_bodies() -> None:
    model, record, _ = made(False, 0.5, m2=1.0)
    links, _ = bodies_of(model)
    assert "m2" in links["link 2"] and len(links["link 2"]) == len(LINK) and "m2" not in model.parameters
    cost = bounded(model, record).checks.bounds
    assert cost is not None and cost.bodies == ("link 1", "link 2", "link 3")


def test_bounds_that_contradict_the_records_are_warned_of() -> None:
    """A torque whose sign is reversed: no body has such masses."""
    model, record, _ = made(False, 0.01)
    turned = record.edited({key: -record.signals[key] for key in record.keys if key.startswith("tau_")})
    cost = bounded(model, turned).checks.bounds
    assert cost is not None and cost.surprise > 3.0
    (advice,) = bound_advice(cost)
    assert "link" in advice.where and "bounds hide that" in advice.remedy
    chance = BoundCost((), (), 0.001, 4.0, ("link 1",), ("link 1",), 30)
    assert not bound_advice(chance)  # four deviations of thirty parameters together are none of one
    assert bound_sentence(chance).startswith("Bounds (mass and pseudo-inertia of link 1): moved onto")


def test_without_the_solver_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    model, record, _ = made(False, 0.5)
    monkeypatch.setitem(__import__("sys").modules, "clarabel", None)
    with pytest.raises(DataError, match=r"modelgen\[arms\]"):
        bounded(model, record)
