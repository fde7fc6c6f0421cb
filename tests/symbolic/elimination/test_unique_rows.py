"""Rows of an elimination have coefficients that the motion determines: nothing can be added unnoticed."""

from __future__ import annotations

import random
from types import ModuleType

import pytest

from modelgen.errors import ModelError
from modelgen.render.writer import generate
from modelgen.spec.chain import ChainSpec
from modelgen.spec.load import parse_spec
from modelgen.symbolic.elimination import common_factor, elimination, multipliers, unique_rows
from modelgen.symbolic.pipeline import build
from tests.symbolic.exact_rank import rank_along_motions
from tests.symbolic.random_chains import random_spec

ENDS = """
[sensors.set]
q_m = { body = "m", measures = "position" }
q_t = { body = "t", measures = "position" }
"""
WITHOUT_MOTOR = """
[sensors.set]
q_c = { body = "c", measures = "position" }
q_t = { body = "t", measures = "position" }
"""


def axis(sensors: str) -> ChainSpec:
    """Motor, coupling and table; every link damped, nothing but viscous friction behind the motor."""
    return parse_spec(
        """
[chain]
name = "axis"
motion = "rotation"
[[bodies]]
name = "m"
inertia = "J_m"
viscous = "F_vm"
actuator = "Gamma"
[[bodies]]
name = "c"
inertia = "J_c"
[[bodies]]
name = "t"
inertia = "J_t"
viscous = "F_vt"
[[links]]
bodies = ["m", "c"]
stiffness = "K_1"
damping = "D_1"
[[links]]
bodies = ["c", "t"]
stiffness = "K_2"
damping = "D_2"
"""
        + sensors,
        "axis.toml",
    )


def module_of(text: str) -> ModuleType:
    module = ModuleType("axis")
    exec(compile(text, "axis.py", "exec"), module.__dict__)
    return module


def test_an_unseen_body_between_two_seen_ones_gives_rows_of_full_rank() -> None:
    model = build(axis(ENDS), "set")
    assert [row.order for row in model.rows.rows] == [3, 4]
    assert rank_along_motions(model, 1) == len(model.base) == 15
    assert set(model.identifiable) == {"J_m", "F_vm", "J_c", "J_t", "F_vt", "K_1", "D_1", "K_2", "D_2"}


def test_the_coefficients_stay_finite_where_damping_vanishes() -> None:
    """What is given up to be unique must not leave quotients of two small dampings."""
    module = module_of(generate(axis(ENDS), "set"))
    firm = {"J_m": 1.0, "J_c": 0.7, "J_t": 1.4, "K_1": 2.0, "K_2": 1.2}
    weak = {"F_vm": 0.6, "F_vt": 0.8, "D_1": 0.9, "D_2": 1.1}
    small, smaller = (
        module.base_from_physical({**firm, **{name: value * size for name, value in weak.items()}})
        for size in (1e-6, 1e-9)
    )
    assert abs(small - smaller).max() < 1e-4
    assert abs(smaller).max() < 10.0


def test_a_row_without_force_or_shared_column_gives_quotients() -> None:
    model = build(axis(WITHOUT_MOTOR), "set")
    load, whole = model.rows.rows
    assert load.origin == "equation of motion of t, divided by J_t"
    assert {term.parameter for term in load.terms} == {None, "F_vt/J_t", "D_2/J_t", "K_2/J_t"}
    assert load.unit == "rad/s^2"
    assert whole.unit == "N m"
    assert rank_along_motions(model, 1) == len(model.base)


def test_a_shared_column_with_a_forced_row_fixes_the_scale() -> None:
    both = axis(ENDS + 'q_c = { body = "c", measures = "position" }')
    model = build(both, "set")
    assert all("divided" not in row.origin for row in model.rows.rows)
    assert rank_along_motions(model, 1) == len(model.base) == 9


def test_the_rows_are_the_same_without_flint(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("flint", reason="python-flint is not installed")
    fast = generate(axis(ENDS), "set")
    monkeypatch.setattr(common_factor, "flint", None)
    assert generate(axis(ENDS), "set") == fast


def test_coefficients_that_would_be_too_long_are_avoided(monkeypatch: pytest.MonkeyPatch) -> None:
    """Then all seen coordinates but one go: the transfer from the force is unique, at a higher order."""
    monkeypatch.setattr(multipliers, "MOST_TERMS", 2)
    model = build(axis(ENDS), "set")
    assert [row.name for row in model.rows.rows] == ["c+t without c", "m+c+t without c, t"]
    assert [row.order for row in model.rows.rows] == [4, 6]
    assert rank_along_motions(model, 1) == len(model.base)


def test_where_no_row_is_unique_the_error_names_the_bodies(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(unique_rows, "MOST_MULTIPLIERS", 0)
    monkeypatch.setattr(elimination, "MOST_SEEN", 0)
    with pytest.raises(ModelError, match="cannot be distinguished; add a sensor on one of c"):
        build(axis(ENDS), "set")


def test_seen_bodies_farther_away_are_eliminated_where_it_takes_that() -> None:
    """Three unseen bodies behind seen ones that no force drives: the whole chain counts as around them."""
    model = build(parse_spec(random_spec(random.Random(544)), "chain.toml"), "set")
    assert rank_along_motions(model, 544) == len(model.base)
