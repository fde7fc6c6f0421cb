"""The parts of the choice of rows, value by value."""

from __future__ import annotations

import pytest

from modelgen.errors import ModelError
from modelgen.spec.chain import ChainSpec
from modelgen.spec.load import parse_spec
from modelgen.symbolic.equations.equation_sums import NEVER
from modelgen.symbolic.equations.sensor_reading import Candidate
from modelgen.symbolic.equations.sensor_span import Sensing
from modelgen.symbolic.equations.signals import DIRECTIONS, Signal, Term
from modelgen.symbolic.pipeline import build
from modelgen.symbolic.rows import _constant, _named_apart, link_levels
from tests.symbolic.test_rows import EMPS300, with_sensors


def spec(sensors: str, chain: str = EMPS300) -> ChainSpec:
    return parse_spec(chain + sensors, "emps300.toml")


def sensor(key: str, body: str, measures: str) -> str:
    return f'{key} = {{ body = "{body}", measures = "{measures}" }}\n'


def both(measures: str) -> str:
    return sensor("s_m", "m", measures) + sensor("s_c", "c", measures)


UNDAMPED = EMPS300.replace('damping = "F_vmc"\n', "")
TWIST = sensor("q_m", "m", "position") + 'twist = { deflection = ["m", "c"], measures = "velocity" }\n'


@pytest.mark.parametrize(
    ("chain", "sensors", "level"),
    [
        (EMPS300, both("position"), 0),
        (EMPS300, both("velocity"), 1),
        (EMPS300, both("acceleration"), 2),
        (EMPS300, sensor("q_m", "m", "position") + sensor("a_c", "c", "acceleration"), 2),
        (EMPS300, sensor("q_m", "m", "position"), NEVER),
        (EMPS300, TWIST, 1),
        (UNDAMPED, both("position"), 0),
        (UNDAMPED, both("velocity"), 1),
        (UNDAMPED, both("acceleration"), 2),
        (UNDAMPED, sensor("q_c", "c", "position"), NEVER),
    ],
)
def test_how_often_a_links_force_is_differentiated(chain: str, sensors: str, level: int | None) -> None:
    chosen = spec(sensors, chain)
    assert link_levels(chosen, Sensing.of(chosen, chosen.sensor_sets["set"])) == [level]


def test_what_is_constant_between_reversals() -> None:
    constant = {
        (kind, order): _constant(Term("p", Signal(kind, "m", order), 1))
        for kind in ("one", "sign", "coordinate", "force", "cube", *DIRECTIONS)
        for order in (0, 1, 2)
    }
    assert {key for key, is_constant in constant.items() if is_constant} == {
        *(("one", order) for order in (0, 1, 2)),
        *(("sign", order) for order in (0, 1, 2)),
        *((kind, 0) for kind in DIRECTIONS),
    }


def test_rows_of_one_name_are_numbered() -> None:
    chosen = [(Candidate(name, ("m",), (), f"{name} {times}"), times) for times, name in enumerate("abaab")]
    named = _named_apart(chosen)
    assert [candidate.name for candidate, _ in named] == ["a", "b", "a (2)", "a (3)", "b (2)"]
    assert [(candidate.origin, times) for candidate, times in named] == [
        (candidate.origin, times) for candidate, times in chosen
    ]


def test_sums_tell_where_they_come_from_and_are_taken_only_if_they_save_a_derivative() -> None:
    rows = with_sensors(sensor("q_m", "m", "position") + sensor("a_c", "c", "acceleration")).rows.rows
    assert [(row.name, row.differentiated) for row in rows] == [("m", 2), ("c", 2), ("m+c", 0)]
    assert rows[-1].origin == "sum of the equations of m, c"
    assert [row.name for row in with_sensors(both("position")).rows.rows] == ["m", "c"]


def test_refusals_name_the_place_and_the_remedy() -> None:
    with pytest.raises(ModelError) as caught:
        build(spec(both("position"), EMPS300.replace('actuator = "Gamma_m"\n', "")), "set")
    assert str(caught.value) == (
        "emps300.toml: bodies: no force is measured or known anywhere, so only the ratios to each other of "
        "J_m, F_vm, F_sm, J_c, F_vmc, K can be identified; "
        'give the body that is driven an actuator, for example actuator = "Gamma_m"'
    )
    cubic = EMPS300.replace('damping = "F_vmc"', 'damping = "F_vmc"\nstiffness3 = "K3"')
    with pytest.raises(ModelError) as caught:
        build(spec(sensor("q_m", "m", "position"), cubic), "set")
    assert str(caught.value).startswith(
        "emps300.toml: sensors.set: the cubic stiffness at m would have to be"
    )
