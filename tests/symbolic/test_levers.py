"""Gears: levers of the bodies, and base parameters of columns that differ by many powers of ten."""

from __future__ import annotations

from fractions import Fraction

import pytest

from modelgen.spec.load import catalog_path, load_spec, parse_spec
from modelgen.symbolic.equations.equation_sums import levers
from modelgen.symbolic.pipeline import build

SCREW = """
chain = { name = "screw", motion = "translation" }
bodies = [
    { name = "motor", motion = "rotation", inertia = "J", viscous = "b", actuator = "torque" },
    { name = "carriage", inertia = "M", viscous = "d" },
    { name = "tool", inertia = "m" },
]
links = [
    { bodies = ["motor", "carriage"], stiffness = "K", damping = "D", ratio = 628.3185 },
    { bodies = ["carriage", "tool"], stiffness = "k" },
]
[sensors.motor]
q = { body = "motor", measures = "position" }
"""


def test_levers_follow_the_gears() -> None:
    found = levers(parse_spec(SCREW, "screw.toml"))
    assert found == pytest.approx({"motor": 1.0, "carriage": 1 / 628.3185, "tool": 1 / 628.3185})


def test_levers_of_a_tree_do_not_depend_on_the_direction_of_its_links() -> None:
    assert levers(load_spec(catalog_path("tree"))) == pytest.approx({"m": 1, "g": 0.05, "a": 0.05, "b": 0.05})


def test_large_gear_ratios_do_not_disturb_the_numerical_rank() -> None:
    model = build(parse_spec(SCREW, "screw.toml"), "motor")
    assert model.identifiable == ("J", "b", "M", "d", "m", "D", "K", "k")


def test_regrouping_by_large_ratios_is_exact() -> None:
    text = SCREW.replace('inertia = "M"', 'inertia = "M", offset = "w"')
    text = text.replace('inertia = "J"', 'inertia = "J", offset = "o"')
    text += 'x = { body = "carriage", measures = "acceleration" }\n'
    text += 'y = { body = "tool", measures = "acceleration" }\n'
    model = build(parse_spec(text, "screw.toml"), "motor")
    both = next(b for b in model.base if b.name == "o + 0.00159155*w")  # the name has six digits of it
    assert both.combination == (("o", 1), ("w", Fraction(2000, 1256637)))
    assert {"b", "d"} <= set(model.identifiable)
