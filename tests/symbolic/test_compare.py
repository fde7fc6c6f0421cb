"""Regressors compared by exact algebra."""

from __future__ import annotations

from fractions import Fraction
from random import Random

import pytest

from generated import emps300_qm_ac, emps300_qm_qc, tree_mixed, tree_positions
from modelgen.cli.formal_rows import exact, formal_regressor
from modelgen.render.writer import generate
from modelgen.runtime.model.model import model_from_module, model_from_text
from modelgen.spec.load import parse_spec
from modelgen.symbolic.compare import (
    COMBINATION,
    DIFFERENT,
    EQUAL,
    FormalRegressor,
    FormalSignal,
    compare,
    differentiated,
    rank,
)

Q1, Q2, ONE = FormalSignal("q", "m", 1), FormalSignal("q", "m", 2), FormalSignal("one", "1", 0)
SIGN = FormalSignal("sign", "1 d1 q_m", 0)


def rows(*given: dict[tuple[str, FormalSignal], int], title: str = "a") -> FormalRegressor:
    exact_rows = tuple({key: Fraction(value) for key, value in row.items()} for row in given)
    return FormalRegressor(title, tuple(f"r{i}" for i in range(len(given))), exact_rows)


def test_the_order_of_rows_does_not_matter() -> None:
    first, second = {("J", Q2): 1}, {("F", Q1): 2, ("O", ONE): 1}
    assert compare(rows(first, second), rows(second, first)).verdict == EQUAL
    assert compare(rows(first), rows(first, second)).verdict == DIFFERENT


def test_sums_of_rows_are_equal_up_to_a_combination() -> None:
    first, second = {("J", Q2): 1}, {("J", Q2): 3, ("F", Q1): 2}
    mixed = {("J", Q2): 4, ("F", Q1): 2}
    found = compare(rows(first, second), rows(first, mixed, title="b"))
    assert found.verdict == COMBINATION
    assert "a, row r1: a combination of rows of b" in found.lines


def test_a_derivative_is_recognised_and_is_different() -> None:
    row = {("", FormalSignal("force", "m", 0)): 1, ("J", Q2): -1, ("F", SIGN): -1, ("O", ONE): -1}
    moved = {("", FormalSignal("force", "m", 1)): 1, ("J", FormalSignal("q", "m", 3)): -1}
    found = compare(rows(row), rows(moved, title="b"))
    assert found.verdict == DIFFERENT
    assert found.lines == (
        "a, row r0: row r0 is its first derivative in b",
        "b, row r0: first derivative of row r0 of a",
    )
    assert differentiated({("K", FormalSignal("cube", "x", 0)): Fraction(1)}) is None


def test_dependent_rows_do_not_count() -> None:
    a, b = {("J", Q2): Fraction(1, 3)}, {("J", Q2): Fraction(2, 7)}
    assert rank([a, b]) == 1
    assert rank([]) == 0


def test_the_sensor_sets_of_the_paper() -> None:
    qc = formal_regressor(model_from_module(emps300_qm_qc), "qm_qc")
    ac = formal_regressor(model_from_module(emps300_qm_ac), "qm_ac")
    assert compare(ac, ac).verdict == EQUAL
    found = compare(qc, ac)
    assert found.verdict == DIFFERENT
    assert "qm_ac, row m: second derivative of row m of qm_qc" in found.lines
    assert "qm_ac, row c: second derivative of row c of qm_qc" in found.lines
    assert "qm_ac, row m+c: a combination of rows of qm_qc" in found.lines


def test_gears_and_relative_sensors_are_translated_exactly() -> None:
    positions = formal_regressor(model_from_module(tree_positions), "positions")
    mixed = formal_regressor(model_from_module(tree_mixed), "mixed")
    found = compare(mixed, positions)
    assert "mixed, row m: first derivative of row m of positions" in found.lines
    assert "mixed, row m+g+a: a combination of rows of positions" in found.lines


def test_coefficients_are_small_fractions_or_what_they_are() -> None:
    assert exact(0.05) == Fraction(1, 20)
    assert exact(2.0**0.5) == Fraction(2.0**0.5)


@pytest.mark.slow
def test_a_gear_of_many_digits_is_an_exact_fraction() -> None:
    ratio = Fraction("628.3")
    for power in (1, 2):
        assert exact(float(1 / ratio**power)) == 1 / ratio**power
    spec = """
chain = {{ name = "{name}", motion = "translation" }}
bodies = [
    {{ name = "m", inertia = "J", viscous = "B", motion = "rotation", actuator = "T" }},
    {{ name = "t", inertia = "M", viscous = "C" }},
]
links = [{{ bodies = ["m", "t"], stiffness = "K", ratio = {ratio} }}]
[sensors.both]
q_m = {{ body = "m", measures = "position" }}
x_t = {{ body = "t", measures = "position" }}
[sensors.stretched]
q_m = {{ body = "m", measures = "position" }}
stretch = {{ deflection = ["m", "t"], measures = "position" }}
[sensors.accelerations]
a_m = {{ body = "m", measures = "acceleration" }}
a_t = {{ body = "t", measures = "acceleration" }}
[sensors.stretching]
a_m = {{ body = "m", measures = "acceleration" }}
a_s = {{ deflection = ["m", "t"], measures = "acceleration" }}
"""
    formal = {}
    for gear in ("628.3", "628.4", '"2*pi/0.01"', "628.31853071795865", "628.32"):
        chain = parse_spec(spec.format(name="screw", ratio=gear), "screw.toml")
        for sensors in ("both", "stretched", "accelerations", "stretching"):
            title = f"{sensors} {gear}"
            formal[gear, sensors] = formal_regressor(model_from_text(generate(chain, sensors)), title)
    assert not formal["628.3", "both"].rounded
    assert compare(formal["628.3", "both"], formal["628.3", "stretched"]).verdict == EQUAL
    assert compare(formal["628.3", "both"], formal["628.4", "both"]).verdict == DIFFERENT
    pi = '"2*pi/0.01"'
    assert formal[pi, "both"].rounded
    assert compare(formal[pi, "both"], formal[pi, "stretched"]).verdict == EQUAL
    assert compare(formal[pi, "both"], formal["628.31853071795865", "stretched"]).verdict == EQUAL
    assert compare(formal[pi, "both"], formal["628.32", "both"]).verdict == DIFFERENT
    for gear in ("628.3", pi):
        assert compare(formal[gear, "accelerations"], formal[gear, "stretching"]).verdict == EQUAL
        found = compare(formal[gear, "both"], formal[gear, "accelerations"])
        assert f"accelerations {gear}, row t: second derivative of row t of both {gear}" in found.lines


def test_rounded_rows_are_compared_as_exact_ones_are() -> None:
    random = Random(1)
    for _ in range(50):
        signals = [("P", FormalSignal("q", str(i), 2)) for i in range(6)]
        given = [
            {s: Fraction(random.randint(-3, 3), random.randint(1, 9)) for s in signals} for _ in range(4)
        ]
        given[3] = {s: given[0][s] - 2 * given[1][s] for s in signals}
        exact_rows = [{s: v for s, v in row.items() if v} for row in given]
        # a gear spreads columns over many powers of ten
        gears = {s: Fraction(10.0 ** random.uniform(-6, 6)) for s in signals}
        rounded = [{s: Fraction(float(v * gears[s])) for s, v in row.items()} for row in exact_rows]
        for count in range(1, 5):
            assert rank(rounded[:count], rounded=True) == rank(exact_rows[:count])
