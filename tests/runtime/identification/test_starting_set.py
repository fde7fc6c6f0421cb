"""Instruments that start from a set of the spec, or from values."""

from __future__ import annotations

import math
from typing import Any

import pytest

from modelgen import generate
from modelgen.errors import DataError
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.methods import IV
from modelgen.runtime.model.model import Model, model_from_text
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.simulate import simulate
from modelgen.spec.load import catalog_path, parse_spec
from tests.runtime.identification.test_one_road import bench


def only_motor() -> tuple[Model, list[Record]]:
    more = '\n[sensors.qm]\nq_m = { body = "m", measures = "position" }\n'
    spec = parse_spec(catalog_path("emps300").read_text(encoding="utf-8") + more, "emps300.toml")
    model = model_from_text(generate(spec, "qm"), "qm")
    truth = model.parameter_sets["table_2"]
    noise = {"q_m": 1e-6, "Gamma_m": 1e-4}
    return model, [
        simulate(model, truth, kind, duration_s=2.0, noise=noise, oversample=8, seed=seed).record
        for seed, kind in enumerate(("chirp", "trapezoid"))
    ]


@pytest.mark.slow
@pytest.mark.parametrize("experiment", [bench, only_motor])
def test_a_good_start_leads_to_the_same_estimate(experiment: Any) -> None:
    model, records = experiment()
    expected = identify(model, records, "iv")
    sets = model.parameter_sets
    for start in ("table_2", dict(sets["table_2"]), "table_1"):
        found = identify(model, records, IV(start=start))
        assert found.params.keys() == expected.params.keys()
        for name, value in found.params.items():
            assert abs(value - expected.params[name]) < 0.3 * expected.bse[name]


def test_the_start_is_used() -> None:
    model, records = bench()
    far = {name: 1e-25 for name in model.parameters}
    assert identify(model, records, "iv").params
    with pytest.raises(Exception, match="method iv"):
        identify(model, records, IV(start=far))


@pytest.mark.parametrize(
    ("start", "message"),
    [
        ("table_9", "start: has no parameter set table_9; did you mean table_2"),
        ({"K": 1.0}, "start: lacks J_m; give all parameters of the model"),
        (3.0, "start: is a float; give the name of a set, or a mapping"),
        ("K", "start: has no parameter set K"),
    ],
)
def test_what_is_no_start_is_refused(start: Any, message: str) -> None:
    model, records = bench()
    with pytest.raises(DataError, match=message):
        identify(model, records, IV(start=start))


@pytest.mark.parametrize("value", [math.nan, math.inf, 1e40, True, "1", None])
def test_values_must_be_numbers(value: Any) -> None:
    model, records = bench()
    values = {**model.parameter_sets["table_2"], "K": value}
    with pytest.raises(DataError, match="start: K: is "):
        identify(model, records, IV(start=values))
    with pytest.raises(DataError, match="start: has no parameter K_9"):
        identify(model, records, IV(start={**model.parameter_sets["table_2"], "K_9": 1.0}))
