"""Physical parameters from some of their composites: what these leave open is open wherever the fit ends."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.render.writer import generate
from modelgen.runtime.model.model import Model, model_from_text
from modelgen.runtime.parameters.composite_fit import fit_composites
from modelgen.spec.load import parse_spec

TRUTH = {"J_m": 8e-3, "J_l": 2e-4, "D": 4e-3, "K": 1.0}

# a handle on the load, the motor behind a spring that no sensor sees
PUSHED = """
chain = { name = "pushed", motion = "rotation" }
bodies = [{ name = "m", inertia = "J_m" }, { name = "l", inertia = "J_l", actuator = "F" }]
links = [{ bodies = ["m", "l"], stiffness = "K", damping = "D" }]
[sensors.load]
q_l = { body = "l", measures = "position" }
"""


@pytest.fixture(scope="module")
def model() -> Model:
    return model_from_text(generate(parse_spec(PUSHED, "pushed.toml"), "load"))


def left_open(model: Model, motor: float, without: str = "") -> set[str]:
    """Return what composites leave open, without one of them, from a start with such a motor."""
    base = model.base_from_physical(TRUTH)
    base[[name == without for name in model.base_parameters]] = np.nan
    told = base[np.isfinite(base)]
    start = {**TRUTH, "J_m": motor, "K": motor * TRUTH["K"] / TRUTH["J_m"]}
    solution = fit_composites(model, base, np.diag((1e-3 * told) ** 2), start)
    return set(model.parameters) - solution.determined


def test_all_composites_determine_all(model: Model) -> None:
    assert left_open(model, TRUTH["J_m"]) == set()


@pytest.mark.parametrize("motor", [8e-3, 1e-12])
def test_a_body_of_no_size_hides_nothing_of_what_is_open(model: Model, motor: float) -> None:
    assert "J_m*J_l/K" in model.base_parameters
    assert left_open(model, motor, "J_m*J_l/K") == {"J_m", "J_l", "D", "K"}


def test_a_gear_hides_nothing_of_what_is_open() -> None:
    screw = """
chain = { name = "screw", motion = "rotation" }
bodies = [{ name = "m", inertia = "J_m", actuator = "T" }, { name = "l", inertia = "J_l" }]
links = [{ bodies = ["m", "l"], stiffness = "K", damping = "D", ratio = 2000.0 }]
[sensors.motor]
q_m = { body = "m", measures = "position" }
"""
    geared = model_from_text(generate(parse_spec(screw, "screw.toml"), "motor"))
    base = geared.base_from_physical(TRUTH)
    base[[name != "J_m + 1/4000000*J_l" for name in geared.base_parameters]] = np.nan
    assert np.isfinite(base).any()
    solution = fit_composites(geared, base, np.diag((1e-3 * base[np.isfinite(base)]) ** 2), TRUTH)
    # a sum with a four-millionth of the other inertia says nothing of either alone
    assert solution.determined == frozenset()
