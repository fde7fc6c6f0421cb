"""A module with parameters known is the module that the spec gives with them known."""

from __future__ import annotations

from random import Random

import numpy as np
import pytest

from generated import emps300_qm_qc, tree_mixed
from modelgen.errors import DataError, ModelError
from modelgen.render.writer import generate
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.model.known_parameters import with_known
from modelgen.runtime.model.model import Model, model_from_module, model_from_text
from modelgen.runtime.simulation.simulate import simulate
from modelgen.spec.chain import ChainSpec
from modelgen.spec.known_values import with_known as spec_with_known
from modelgen.spec.load import catalog_path, parse_spec
from tests.symbolic.random_chains import random_spec

MOTOR_ONLY = '\n[sensors.qm]\nq_m = { body = "m", measures = "position" }\n'
PLAIN = model_from_module(emps300_qm_qc)


def built(chain: ChainSpec, sensors: str) -> Model:
    return model_from_text(generate(chain, sensors), "chain")


def residual(model: Model, signals: dict[str, np.ndarray], values: dict[str, float]) -> np.ndarray:
    left = {name: values[name] for name in model.parameters}
    return model.measurement(signals) - model.regressor(signals) @ model.base_from_physical(left)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(24))
def test_rows_are_those_of_the_spec_with_the_same_known(seed: int) -> None:
    rng = Random(seed)
    try:
        chain = parse_spec(random_spec(rng, most_bodies=4), "chain.toml")
        model = built(chain, "set")
    except ModelError:
        return
    names = rng.sample(model.parameters, rng.randint(1, max(1, len(model.parameters) - 1)))
    known = {name: round(rng.uniform(0.5, 2.0), 3) for name in names}
    try:
        wanted = built(spec_with_known(chain, known, "known"), "set")
    except ModelError:
        wanted = None
    try:
        found = with_known(model, known)
    except DataError as error:
        # what was seen only through them has no column of its own either
        assert wanted is None, error
        return
    draw = np.random.default_rng(seed)
    keys = {entry.key for one in (model, *((wanted,) if wanted else ())) for entry in one.signals}
    signals = {key: draw.uniform(-1.0, 1.0, 5) for key in sorted(keys)}
    values = {name: float(draw.uniform(0.5, 2.0)) for name in model.parameters} | known
    np.testing.assert_allclose(residual(found, signals, values), residual(model, signals, values), atol=1e-9)
    assert found.known == {**model.known, **known}
    assert not {*found.parameters, *found.identifiable} & {*known}
    if wanted is not None and not model.composites:
        np.testing.assert_allclose(
            residual(found, signals, values), residual(wanted, signals, values), atol=1e-9
        )
        assert found.identifiable == wanted.identifiable
        assert len(found.base_parameters) == len(wanted.base_parameters)
        left = {name: values[name] for name in found.identifiable}
        recovered = found.physical_from_base(found.base_from_physical(values))
        assert recovered == pytest.approx(left, rel=1e-12)


def test_of_a_sum_the_other_is_left() -> None:
    model = model_from_module(tree_mixed)
    sums = [name for name in model.base_parameters if " + " in name]
    inside = [name for name in model.parameters if any(name in one for one in sums)]
    if not inside:
        pytest.skip("no sums in this module")
    found = with_known(model, {inside[0]: 0.1})
    assert set(found.identifiable) > set(model.identifiable) - {inside[0]}


@pytest.mark.parametrize("method", ["wls", "iv"])
def test_intervals_are_those_with_the_value_known(method: str) -> None:
    values = dict(PLAIN.parameter_sets["light"])
    noise = {"q_m": 2e-6, "q_c": 2e-6, "Gamma_m": 1e-4}
    records = [simulate(PLAIN, values, "chirp", duration_s=1.0, noise=noise, seed=1).record]
    every = identify(PLAIN, records, method)
    known = {"F_vm": values["F_vm"], "J_m": values["J_m"]}
    fewer = identify(with_known(PLAIN, known), records, method)
    assert list(fewer.physical) == [name for name in PLAIN.parameters if name not in known]
    assert dict(fewer.model.known) == known
    for name in fewer.params:
        assert abs(fewer.params[name] - values[name]) < 4.0 * fewer.bse[name]
        assert fewer.bse[name] < 1.5 * every.bse[name]
    # F_sm, that F_vm takes part of in a record of vibration, is better known
    assert fewer.bse["F_sm"] < every.bse["F_sm"]


@pytest.mark.slow
def test_composites_follow_what_is_known() -> None:
    text = catalog_path("emps300").read_text(encoding="utf-8") + MOTOR_ONLY
    model = built(parse_spec(text, "emps300.toml"), "qm")
    values = dict(model.parameter_sets["light"])
    records = [
        simulate(model, values, kind, duration_s=2.0, noise={"q_m": 2e-6, "Gamma_m": 1e-5}).record
        for kind in ("chirp", "trapezoid")
    ]
    every = identify(model, records, "iv")
    held = with_known(model, {"K": values["K"]})
    assert held.identifiable == tuple(name for name in model.identifiable if name != "K")
    fewer = identify(held, records, "iv")
    for entry in fewer.parameters.physical:
        assert abs(entry.value - values[entry.name]) < 4.0 * entry.std
        before = next(one.std for one in every.parameters.physical if one.name == entry.name)
        assert entry.std < 1.1 * before
    # what composites give is J_c / K
    spread = {p.name: p.std for p in fewer.parameters.physical}
    assert spread["J_c"] < 0.7 * next(p.std for p in every.parameters.physical if p.name == "J_c")


def test_what_cannot_be_known_is_said() -> None:
    with pytest.raises(DataError) as found:
        with_known(PLAIN, {"J": 1.0, "K": float("nan"), "J_c": 0.0, "F_vm": -1.0}, "--set")
    assert [problem.where for problem in found.value.problems] == [
        "--set: J",
        "--set: K",
        "--set: J_c",
        "--set: F_vm",
    ]
    with pytest.raises(DataError, match="no parameter to estimate"):
        with_known(PLAIN, dict.fromkeys(PLAIN.parameters, 1.0))
    assert with_known(PLAIN, {}) is PLAIN
    stiff = with_known(PLAIN, {"K": 2.0})
    assert with_known(stiff, {"K": 2.0}) is stiff
    with pytest.raises(DataError, match="is known in the module already"):
        with_known(stiff, {"K": 3.0})
    assert PLAIN.parameters == tuple(emps300_qm_qc.PARAMETERS)  # the module is left alone
