"""Modes of composites that are too uncertain for a linear step are not told."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from modelgen.cli.candidates import spec_model
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.model.model import Model
from modelgen.runtime.modes.find_modes import modes_at
from modelgen.runtime.modes.uncertain_chain import loose_part
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.simulation.simulate import simulate
from modelgen.spec.load import catalog_path, parse_spec

MOTOR_ONLY = '\n[sensors.qm]\nq_m = { body = "m", measures = "position" }\n'


@cache
def case(parameters: str) -> tuple[Model, Estimate]:
    text = catalog_path("emps300").read_text(encoding="utf-8") + MOTOR_ONLY
    model = spec_model(parse_spec(text, "emps300.toml"), "qm")
    values = dict(model.parameter_sets[parameters])
    noise = {"q_m": 2e-5, "Gamma_m": 1e-4}
    kinds = ("chirp", "trapezoid")
    records = [simulate(model, values, kind, duration_s=2.0, noise=noise).record for kind in kinds]
    return model, identify(model, records, "iv")


@pytest.mark.slow
def test_a_mode_of_doubtful_composites_is_not_told() -> None:
    model, estimate = case("table_1")
    assert {"J_c", "K", "F_vmc"} <= estimate.not_identifiable.keys()
    (free,) = estimate.modes()
    true = modes_at(model, model.parameter_sets["table_1"])
    low, high = free.time_constants_s[0].low, free.time_constants_s[0].high
    assert low is not None and high is not None
    assert low <= true[0].time_constants_s[0].value <= high
    assert not estimate.modes().antiresonances
    assert "1 of 2 modes cannot be computed: they need J_c, F_vmc, K" in estimate.modes().notes[0]


@pytest.mark.slow
def test_modes_of_composites_that_are_known_well_are_told() -> None:
    _, estimate = case("light")
    assert len(estimate.modes().modes) == 2
    assert estimate.modes().antiresonances


@pytest.mark.parametrize("seed", range(5))
def test_the_loose_part_is_what_lies_along_uncertain_directions(seed: int) -> None:
    rng = np.random.default_rng(seed)
    values = 10.0 ** rng.uniform(-6, 6, 5) * rng.choice([-1.0, 1.0], 5)
    values[rng.integers(5)] = 0.0
    direction = rng.standard_normal(5) * (values != 0.0)
    direction /= np.linalg.norm(direction)
    tight = 1e-3 * rng.standard_normal((5, 5))
    root = np.abs(values)[:, None] * (0.5 * np.outer(direction, [1.0, 0.0, 0.0, 0.0, 0.0]) + tight)
    size = np.where(values == 0.0, 1.0, np.abs(values))[:, None]
    found = loose_part(values, root) / size
    assert np.linalg.matrix_rank(found, tol=1e-6) == 1
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 0.5 * np.abs(direction), atol=5e-3)
    assert not loose_part(values, 0.1 * root).any()
