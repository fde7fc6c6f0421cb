"""Ratios as people write them, from the spec to the model: text, leads, and values of parameters."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from modelgen.errors import SpecError
from modelgen.number_expression import PI
from modelgen.render.writer import generate
from modelgen.runtime.model.model import model_from_text
from modelgen.spec.chain import ChainSpec
from modelgen.spec.load import parse_spec
from modelgen.symbolic.equations.equation_sums import contradicts_itself
from modelgen.symbolic.pipeline import build

SCREW = """
chain = {{ name = "screw", motion = "rotation" }}
bodies = [
    {{ name = "m", inertia = "J_m", viscous = "F_m", actuator = "T" }},
    {{ name = "t", inertia = "M_t", viscous = "F_t", motion = "translation" }},
]
links = [{{ bodies = [{bodies}], stiffness = "K", damping = "D", {ratio} }}]
parameters.nominal = {{ {values} }}
[sensors.both]
q_m = {{ body = "m", measures = "position" }}
x = {{ body = "t", measures = "position" }}
[sensors.motor]
q_m = {{ body = "m", measures = "position" }}
"""


def screw(ratio: str, bodies: str = '"m", "t"', values: str = "") -> ChainSpec:
    return parse_spec(SCREW.format(ratio=ratio, bodies=bodies, values=values), "screw.toml")


def test_a_lead_is_the_travel_of_a_turn_whichever_body_is_first() -> None:
    expected = 200 * PI
    assert screw('ratio = "2*pi/0.01"').links[0].ratio == expected
    assert screw("lead = 0.01").links[0].ratio == expected
    assert screw('lead = "10/1000"').links[0].ratio == expected
    assert screw("lead = 0.01", '"t", "m"').links[0].ratio == 1 / expected
    assert screw("lead = -0.01").links[0].ratio == -expected  # a left-handed screw
    assert screw("ratio = 628.3").links[0].ratio == Fraction("628.3")


@pytest.mark.parametrize(
    ("ratio", "said"),
    [
        ("ratio = 2.0, lead = 0.01", "links[0]: has both ratio and lead"),
        ('ratio = "2*pie"', "links[0].ratio: is \"2*pie\", which cannot be read from 'pie' at character 3"),
        ('ratio = "1-1"', "links[0].ratio: must be a number other than 0"),
        ('ratio = "1e400"', 'links[0].ratio: is "1e400", a number that cannot be used'),
        ('lead = "1e-40"', 'links[0].lead: is "1e-40", a number that cannot be used'),
        ("lead = 0", "links[0].lead: must be a number other than 0"),
    ],
)
def test_mistakes_are_told_at_their_key(ratio: str, said: str) -> None:
    with pytest.raises(SpecError) as found:
        screw(ratio)
    assert len(found.value.problems) == 1
    assert said in str(found.value)


def test_a_lead_needs_a_rotation_and_a_translation() -> None:
    text = SCREW.format(ratio="lead = 0.01", bodies='"m", "t"', values="")
    with pytest.raises(SpecError, match="no travel a turn"):
        parse_spec(text.replace(', motion = "translation" }', " }"), "screw.toml")


def test_values_of_parameters_are_written_likewise() -> None:
    spec = screw("lead = 0.01", values='J_m = "1/3", K = "2*pi*(1e3+1)", M_t = 5')
    assert spec.parameter_sets["nominal"] == {"J_m": 1 / 3, "K": float(2 * PI * 1001), "M_t": 5.0}
    with pytest.raises(SpecError, match=r"parameters.nominal.J_m: is -0.333333, but inertia must be"):
        screw("lead = 0.01", values='J_m = "-1/3"')


@pytest.mark.parametrize("ratio", ["lead = 0.01", "ratio = 628.3185307179586", 'ratio = "200*22/7"'])
@pytest.mark.parametrize("sensors", ["both", "motor"])
def test_names_stay_short_and_values_exact(ratio: str, sensors: str) -> None:
    spec = screw(ratio)
    model = build(spec, sensors)
    small = float(1 / spec.links[0].ratio ** 2)
    texts = [base.name for base in model.base] + [c.formula for c in model.rows.composites.values()]
    assert all(sum(c.isdigit() for c in part) <= 10 for text in texts for part in text.split("*"))
    made = model_from_text(generate(spec, sensors), "screw")
    values = {"J_m": 1e-4, "F_m": 1e-3, "M_t": 20.0, "F_t": 50.0, "K": 1e7, "D": 1e3}
    base = dict(zip(made.base_parameters, made.base_from_physical(values).tolist(), strict=True))
    if sensors == "motor":
        name = next(name for name in base if name.startswith("F_m + "))
        assert base[name] == pytest.approx(1e-3 + small * 50.0, rel=1e-14)
        # composites are of the size of what they are made of, not of whole numbers of the ratio's digits
        assert all(np.abs(value) < 1e3 for value in base.values())


def test_the_same_rank_and_columns_as_with_a_whole_number() -> None:
    whole = build(screw("ratio = 600"), "motor")
    for ratio in ("lead = 0.01", "ratio = 628.3185307", 'ratio = "2*pi/(1/100)"', "ratio = 0.0123456789"):
        found = build(screw(ratio), "motor")
        assert len(found.base) == len(whole.base)
        assert found.identifiable == whole.identifiable
        assert generate(screw(ratio), "motor") == generate(screw(ratio), "motor")


def test_pi_cancels_around_a_loop() -> None:
    text = """
chain = {{ name = "loop", motion = "rotation" }}
bodies = [
    {{ name = "a", inertia = "J_a", actuator = "T" }},
    {{ name = "b", inertia = "M_b", motion = "translation" }},
    {{ name = "c", inertia = "J_c" }},
]
links = [
    {{ bodies = ["a", "b"], stiffness = "K_1", lead = 0.01 }},
    {{ bodies = ["b", "c"], stiffness = "K_2", ratio = "0.02/2/pi" }},
    {{ bodies = ["a", "c"], stiffness = "K_3", ratio = {ratio} }},
]
sensors.s = {{ q = {{ body = "a", measures = "position" }} }}
"""
    assert not contradicts_itself(parse_spec(text.format(ratio="2"), "loop.toml"))
    assert contradicts_itself(parse_spec(text.format(ratio="2.1"), "loop.toml"))
