from __future__ import annotations

import numpy as np
import pytest

from generated import emps300_qm_qc
from modelgen.render.writer import generate
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.options import CheckOptions
from modelgen.runtime.model.model import Model, model_from_module, model_from_text
from modelgen.runtime.parameters.other_solutions import other_solutions, solution_notes
from modelgen.runtime.parameters.parameter import Parameter
from modelgen.runtime.parameters.physical_parameters import Covariances
from modelgen.runtime.simulation.simulate import simulate
from modelgen.spec.load import parse_spec

# Seen from the load, a motor and a load on a known spring, without friction to ground, can change places.
TWINS = """
chain = { name = "twins", motion = "rotation" }
bodies = [{ name = "m", inertia = "J_m", actuator = "torque" }, { name = "c", inertia = "J_c" }]
links = [{ bodies = ["m", "c"], stiffness = "K", damping = "D" }]
[known]
K = 40.0
[sensors.load]
q_c = { body = "c", measures = "position" }
[sensors.motor]
q_m = { body = "m", measures = "position" }
"""
TRUTH = {"J_m": 2.0e-3, "J_c": 5.0e-4, "D": 0.01}


def found(sensors: str) -> tuple[Model, tuple[object, ...]]:
    model = model_from_text(generate(parse_spec(TWINS, "twins.toml"), sensors))
    base = model.base_from_physical(TRUTH)
    covariance = np.diag((1e-3 * base) ** 2)
    reported = [Parameter(name, "", TRUTH[name], 0.0, 0.0, 0.0, 0.0) for name in model.parameters]
    zero = np.zeros_like(covariance)
    return model, other_solutions(
        model, base, Covariances(covariance, covariance, zero, covariance), reported
    )


def test_bodies_that_can_change_places_give_two_solutions() -> None:
    _, others = found("load")
    (swapped,) = others
    assert swapped == pytest.approx({"J_m": 5.0e-4, "J_c": 2.0e-3, "D": 0.01}, rel=1e-4)
    (note,) = solution_notes(others)  # type: ignore[arg-type]
    assert note.startswith("other values fit as well: J_m 0.0005, J_c 0.002")


def test_seen_from_the_motor_there_is_one() -> None:
    _, others = found("motor")
    assert others == ()


def test_models_without_composites_are_not_searched() -> None:
    model = model_from_module(emps300_qm_qc)
    covariance = np.eye(6)
    assert other_solutions(model, np.ones(6), Covariances(*[covariance] * 4), []) == ()


def test_estimates_are_searched_unless_told_otherwise() -> None:
    model, _ = found("load")
    record = simulate(model, TRUTH, "chirp", duration_s=1.0, fs=2000.0).record
    searched, quick = (
        identify(model, record, "wls", checks=CheckOptions(drift_check=False, other_solutions=asked))
        for asked in (True, False)
    )
    assert len(searched.parameters.other_solutions) == 1
    assert quick.parameters.other_solutions == ()
    assert dict(quick.physical) == dict(searched.physical)
