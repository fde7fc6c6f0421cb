"""The spec's format: good files, and for every rule a wrong file with the message that it gives."""

from __future__ import annotations

import hashlib
import json
import tomllib
from collections.abc import Iterator
from dataclasses import FrozenInstanceError
from fractions import Fraction
from pathlib import Path
from typing import Any, get_args

import pytest

from modelgen.errors import Problem, SpecError
from modelgen.spec.chain import ChainSpec, Link, Parameter, Sensor
from modelgen.spec.load import load_spec, parse_spec
from modelgen.spec.units import Measures, Motion, Role, force_unit, parameter_unit, signal_unit

GOOD = """
[chain]
name = "axis"
title = "Axis"
motion = "rotation"
[[bodies]]
name = "m"
inertia = "J_m"
viscous = "F_vm"
coulomb = "F_sm"
actuator = "Gamma_m"
[[bodies]]
name = "c"
inertia = "J_c"
offset = "O_c"
[[links]]
bodies = ["m", "c"]
stiffness = "K"
damping = "F_d"
[known]
J_c = 7e-7
[parameters.first]
K = 1
O_c = -2.5
[sensors.qm_ac]
q_m = { body = "m", measures = "position" }
a_c = { body = "c", measures = "acceleration" }
"""
MINIMAL = '[chain]\nname = "x"\nmotion = "rotation"\n[[bodies]]\nname = "a"\ninertia = "J"\n'
THIRD = '[[bodies]]\nname = "d"\ninertia = "J_d"\n[[links]]\nbodies = ["c", "d"]\nstiffness = "K_d"\n[known]'
SLIDES = 'inertia = "J_c"\nmotion = "translation"'


def good(*changes: tuple[str, str]) -> str:
    """Return the good file with some of its text replaced."""
    text = GOOD
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    return text


def problems(text: str) -> tuple[Problem, ...]:
    with pytest.raises(SpecError) as caught:
        parse_spec(text, "axis.toml")
    return caught.value.problems


# Good files ----------------------------------------------------------------------------------------


def test_a_good_file_becomes_frozen_values() -> None:
    spec = parse_spec(GOOD, "folder/axis.toml")
    assert (spec.name, spec.title, spec.motion, spec.source) == ("axis", "Axis", "rotation", "axis.toml")
    assert [body.name for body in spec.bodies] == ["m", "c"]
    assert (spec.bodies[0].actuator, spec.bodies[1].actuator) == ("Gamma_m", None)
    assert spec.links == (Link(("m", "c"), "K", "F_d", None, Fraction(1)),)
    assert spec.known == {"J_c": 7e-7}
    assert spec.parameter_sets == {"first": {"K": 1.0, "O_c": -2.5}}
    assert isinstance(spec.parameter_sets["first"]["K"], float)
    assert spec.sensor_sets == {
        "qm_ac": (Sensor("q_m", "m", None, "position"), Sensor("a_c", "c", None, "acceleration"))
    }
    assert spec.sha256 == hashlib.sha256(GOOD.encode()).hexdigest()
    assert hash(spec) == hash(parse_spec(GOOD, "axis.toml"))
    with pytest.raises(FrozenInstanceError):
        spec.name = "other"  # type: ignore[misc]


def test_parameters_come_body_by_body_then_link_by_link() -> None:
    assert parse_spec(GOOD, "axis.toml").parameters == (
        Parameter("J_m", "inertia", ("m",), "kg m^2"),
        Parameter("F_vm", "viscous", ("m",), "N m s/rad"),
        Parameter("F_sm", "coulomb", ("m",), "N m"),
        Parameter("J_c", "inertia", ("c",), "kg m^2"),
        Parameter("O_c", "offset", ("c",), "N m"),
        Parameter("F_d", "damping", ("m", "c"), "N m s/rad"),
        Parameter("K", "stiffness", ("m", "c"), "N m/rad"),
    )


def test_a_minimal_file_needs_neither_title_nor_links_nor_sensors() -> None:
    spec = parse_spec(MINIMAL, "x.toml")
    assert (spec.title, spec.links, spec.sensor_sets, dict(spec.known)) == ("x", (), {}, {})


def test_asymmetric_friction_names_one_parameter_a_direction() -> None:
    spec = parse_spec(good(('coulomb = "F_sm"', 'coulomb = "F_sm"\nfriction = "asymmetric"')), "axis.toml")
    names = [(p.name, p.role) for p in spec.parameters if p.bodies == ("m",)]
    assert names[1:] == [
        ("F_vm_plus", "viscous"),
        ("F_sm_plus", "coulomb"),
        ("F_vm_minus", "viscous"),
        ("F_sm_minus", "coulomb"),
    ]


def test_elements_of_one_role_and_unit_may_share_a_parameter() -> None:
    spec = parse_spec(good(('inertia = "J_c"', 'inertia = "J_m"'), ("J_c = 7e-7", "")), "axis.toml")
    assert spec.parameters[0] == Parameter("J_m", "inertia", ("m", "c"), "kg m^2")
    assert [p.name for p in spec.parameters].count("J_m") == 1


@pytest.mark.parametrize(
    ("text", "exact"),
    [("0.1", Fraction(1, 10)), ("-3", Fraction(-3)), ("1e-3", Fraction(1, 1000)), ("12.5", Fraction(25, 2))],
)
def test_ratio_is_the_decimal_that_was_written(text: str, exact: Fraction) -> None:
    assert parse_spec(good(("[known]", f"ratio = {text}\n[known]")), "a.toml").links[0].ratio == exact


def test_ground_always_comes_second() -> None:
    to_ground = '[[links]]\nbodies = {}\nstiffness = "K_0"\n{}[known]'
    first = parse_spec(good(("[known]", to_ground.format('["ground", "c"]', ""))), "a.toml")
    second = parse_spec(good(("[known]", to_ground.format('["c", "ground"]', "ratio = 2.0\n"))), "a.toml")
    assert first.links[1].bodies == second.links[1].bodies == ("c", "ground")
    assert first.parameters[-1] == Parameter("K_0", "stiffness", ("c",), "N m/rad")


def test_a_body_may_move_otherwise_than_the_chain() -> None:
    text = good(('inertia = "J_c"', SLIDES), ("[known]", "ratio = 40.0\n[known]"))
    spec = parse_spec(text, "a.toml")
    assert [body.motion for body in spec.bodies] == ["rotation", "translation"]
    units = {p.name: p.unit for p in spec.parameters}
    assert (units["J_m"], units["J_c"], units["O_c"]) == ("kg m^2", "kg", "N")
    assert (units["K"], units["F_d"]) == ("N/m", "N s/m")  # the deflection is one of the second body


def test_a_deflection_in_the_order_of_a_geared_link_may_mix_motions() -> None:
    twist = 'twist = {{ deflection = ["{}", "{}"], measures = "position" }}\n'
    text = good(('inertia = "J_c"', SLIDES), ("[known]", "ratio = 40.0\n[known]"))
    spec = parse_spec(text + twist.format("m", "c"), "a.toml")
    assert spec.sensor_sets["qm_ac"][-1] == Sensor("twist", None, ("m", "c"), "position")
    (problem,) = problems(text + twist.format("c", "m"))
    assert problem.where == "axis.toml: sensors.qm_ac.twist.deflection"
    assert "subtracts a translation from a rotation" in problem.what


def test_byte_order_mark_and_windows_line_ends_are_accepted(tmp_path: Path) -> None:
    content = b"\xef\xbb\xbf" + GOOD.replace("\n", "\r\n").encode()
    path = tmp_path / "axis.toml"
    path.write_bytes(content)
    spec = load_spec(path)
    assert spec.name == "axis"
    assert spec.sha256 == hashlib.sha256(content).hexdigest()
    assert load_spec(str(path)) == spec


@pytest.mark.parametrize("text", ['<?xml version="1.0"?><robot name="r"/>', "\ufeff\n <robot/>"])
def test_a_urdf_is_told_what_makes_a_description_of_it(text: str) -> None:
    (problem,) = problems(text)
    assert (
        str(problem).startswith("axis.toml: is XML, no TOML; ")
        and "modelgen new NAME --urdf" in problem.remedy
    )


# Wrong files: what is changed, the key that the message names, words of the message ----------------

Q_C = 'a_c = { body = "c", measures = "acceleration" }'
# fmt: off
WRONG = {
    # tables and keys
    "chain missing": (("[chain]", "[chian]"), "chian", "is not a key", 'did you mean "chain"?'),
    "key misspelt": (('offset = "O_c"', 'offset = "O_c"\ncolomb = "F"'), "bodies[1].colomb",
        "is not a key", '"coulomb"'),
    "link key misspelt": (('damping = "F_d"', 'dampning = "F_d"'), "links[0].dampning", "is not a key",
        '"damping"'),
    "chain key unknown": (('title = "Axis"', "x = 1"), "chain.x", "is not a key", "name, title, motion"),
    "sensor key unknown": ((Q_C, Q_C[:-1] + ", gain = 2 }"), "sensors.qm_ac.a_c.gain", "is not a key",
        "body, defl"),
    "key quoted": (("[known]", '["odd\\nkey"]\n[known]'), '"odd\\nkey"', "is not a key", "chain, bodies"),
    "name missing": (('name = "m"\n', ""), "bodies[0].name", "is missing", 'name = "m"'),
    "inertia missing": (('inertia = "J_m"', ""), "bodies[0].inertia", "is missing", 'inertia = "J_m"'),
    "stiffness missing": (('stiffness = "K"', ""), "links[0].stiffness", "is missing", 'stiffness = "K"'),
    "ends missing": (('bodies = ["m", "c"]', ""), "links[0].bodies", "is missing", 'bodies = ["m", "c"]'),
    "motion missing": (('motion = "rotation"', ""), "chain.motion", "is missing", 'motion = "rotation"'),
    "measures missing": ((', measures = "acceleration"', ""), "sensors.qm_ac.a_c.measures", "is missing",
        "position"),
    "name a number": (('inertia = "J_m"', "inertia = 3"), "bodies[0].inertia", "text in quotes, not 3",
        '"J_m"'),
    "name a date": (('inertia = "J_m"', "inertia = 1979-05-27"), "bodies[0].inertia", "not a date or time",
        '"J_m"'),
    "name a list": (('inertia = "J_m"', 'inertia = ["J"]'), "bodies[0].inertia", "quotes, not a list",
        '"J_m"'),
    "link no table": (("[[links]]", "[links]"), "links", "must be a list of tables, not a table",
        "[[links]]"),
    "chain a list": (("[chain]", "[[chain]]"), "chain", "must be a table, not a list", "[chain]"),
    "set no table": (("[parameters.first]", "[parameters]"), "parameters.K", "must be a table, not 1",
        "[parameters."),
    "sensor no table": (("q_m = { body", 'q_x = "m"\nq_m = { body'), "sensors.qm_ac.q_x", "a table, not",
        "[sensors"),
    # choices
    "motion": (('motion = "rotation"', 'motion = "spin"'), "chain.motion",
        '"rotation" or "translation", not "spin"', 'motion = "rotation"'),
    "friction": (('"O_c"', '"O_c"\nfriction = "none"'), "bodies[1].friction",
        '"symmetric" or "asymmetric", not "none"', "friction ="),
    "measures": (('"acceleration"', '"accel"'), "sensors.qm_ac.a_c.measures",
        '"acceleration", not "accel"', 'measures = "position"'),
    # names
    "spaces": (('"J_m"', '"J m"'), "bodies[0].inertia", '"J m" is not a name', "letter"),
    "empty name": (('name = "axis"', 'name = ""'), "chain.name", '"" is not a name', "letter"),
    "digit first": (('name = "axis"', 'name = "3d"'), "chain.name", '"3d" is not a name', "letter"),
    "underscore first": (('"F_sm"', '"_F"'), "bodies[0].coulomb", '"_F" is not a name', "letter"),
    "not ASCII": (('"Gamma_m"', '"Γ_m"'), "bodies[0].actuator", '"Γ_m" is not a name', "ASCII"),
    "not ASCII digit": (('"Gamma_m"', '"G٣"'), "bodies[0].actuator", "is not a name", "ASCII"),
    "line end": (('"J_m"', '"J_m\\n"'), "bodies[0].inertia", '"J_m\\n" is not a name', "letter"),
    "long": (('"J_m"', f'"{"J" * 65}"'), "bodies[0].inertia", 'JJJ..." is not a name', "64"),
    "keyword": (('"J_m"', '"lambda"'), "bodies[0].inertia", '"lambda" is a word of the Python',
        "lambda_1"),
    "constant": (('"F_vm"', '"None"'), "bodies[0].viscous", '"None" is a word of the Python', "None_1"),
    "soft keyword": (('"F_d"', '"match"'), "links[0].damping", '"match" is a word of the Python',
        "match_1"),
    "later keyword": (('"F_d"', '"type"'), "links[0].damping", '"type" is a word of the Python', "type_1"),
    "set name": (("[sensors.qm_ac]", '[sensors."qm-ac"]'), "sensors.qm-ac", '"qm-ac" is not a name',
        "letter"),
    "sensor name": (("a_c = {", '"a c" = {'), 'sensors.qm_ac."a c"', '"a c" is not a name', "letter"),
    "values name": (("[parameters.first]", "[parameters.1st]"), "parameters.1st", '"1st" is not a name',
        "letter"),
    "ground": (("[known]", THIRD.replace('"d"', '"ground"')), "bodies[2].name",
        '"ground" is what does not move', "another name"),
    "body twice": (("[known]", THIRD.replace('"d"', '"m"')), "bodies[2].name",
        '"m" is the name of bodies[0]', "rename"),
    "actuator twice": (('offset = "O_c"', 'offset = "O_c"\nactuator = "Gamma_m"'), "bodies[1].actuator",
        '"Gamma_m" is the actuator of bodies[0]', "rename"),
    "actuator reserved": (('"Gamma_m"', '"d2_Gamma"'), "bodies[0].actuator", "kept for a derived signal",
        "d1_"),
    "sensor reserved": (("a_c = {", "d12_ = {"), "sensors.qm_ac.d12_", "kept for a derived signal", "d1_"),
    "sensor a sign": (("a_c = {", "sign_c = {"), "sensors.qm_ac.sign_c", "kept for a derived signal",
        "sign_"),
    "sensor is actuator": (("a_c = {", "Gamma_m = {"), "sensors.qm_ac.Gamma_m", "bodies[0].actuator too",
        "rename"),
    "sensor is parameter": (("a_c = {", "K = {"), "sensors.qm_ac.K", "links[0].stiffness too", "rename"),
    "actuator is parameter": (('"Gamma_m"', '"K"'), "bodies[0].actuator", "links[0].stiffness too",
        "rename"),
    # title
    "title empty": (('"Axis"', '" "'), "chain.title", "is empty", "leave the key out"),
    "title long": (('"Axis"', f'"{"a" * 201}"'), "chain.title", "has 201 characters", "shorten it to 200"),
    "title lines": (('"Axis"', r'"a\nb"'), "chain.title", "control character U+000A", "one line"),
    "title invisible": (('"Axis"', r'"a\u202Eb"'), "chain.title", "control character U+202E", "one line"),
    "title line separator": (('"Axis"', r'"a\u2028b"'), "chain.title", "control character U+2028",
        "one line"),
    # links
    "ends one": (('["m", "c"]', '["m"]'), "links[0].bodies", "a list of two names, not a list",
        '["m", "c"]'),
    "ends three": (('["m", "c"]', '["m", "c", "m"]'), "links[0].bodies", "a list of two names",
        '["m", "c"]'),
    "ends text": (('["m", "c"]', '"m"'), "links[0].bodies", 'a list of two names, not "m"', '["m", "c"]'),
    "ends numbers": (('["m", "c"]', "[0, 1]"), "links[0].bodies", "a list of two names", '["m", "c"]'),
    "no such body": (('["m", "c"]', '["m", "k"]'), "links[0].bodies", '"k" is not a body',
        "the bodies are m, c"),
    "itself": (("[known]", '[[links]]\nbodies = ["m", "m"]\nstiffness = "K2"\n[known]'), "links[1].bodies",
        'joins "m" with itself', "two different"),
    "ground itself": (("[known]", '[[links]]\nbodies = ["ground", "ground"]\nstiffness = "K2"\n[known]'),
        "links[1].bodies", 'joins "ground" with itself', "two different"),
    "ground first": (
        ("[known]", '[[links]]\nbodies = ["ground", "m"]\nstiffness = "K2"\nratio = 2\n[known]'),
        "links[1].bodies", "first in a link with a ratio", 'write ["m", "ground"]'),
    "ratio zero": (("[known]", "ratio = 0.0\n[known]"), "links[0].ratio", "a number other than 0, not 0.0",
        "10.0"),
    "ratio infinite": (("[known]", "ratio = inf\n[known]"), "links[0].ratio", "a finite number, not inf",
        "10.0"),
    "ratio text": (("[known]", 'ratio = "two"\n[known]'), "links[0].ratio", "cannot be read from 'two'",
        "2*pi/0.01"),
    "ratio true": (("[known]", "ratio = true\n[known]"), "links[0].ratio", "must be a number, not true",
        "10.0"),
    "ratio missing": (('inertia = "J_c"', SLIDES), "links[0]", "a rotation and a translation without",
        "add ratio"),
    "unconnected": (("[known]", THIRD.replace('["c", "d"]', '["d", "ground"]')), "links",
        "leave 2 parts unconnected: m, c and d", "join them"),
    # sensors
    "set empty": (("[sensors.qm_ac]", "[sensors.none]\n[sensors.qm_ac]"), "sensors.none", "is empty",
        "add a sensor"),
    "body unknown": (('body = "c"', 'body = "cc"'), "sensors.qm_ac.a_c.body", '"cc" is not a body',
        'mean "c"?'),
    "body ground": (('body = "c"', 'body = "ground"'), "sensors.qm_ac.a_c.body", "is not a body", "m, c"),
    "body and deflection": (('body = "c"', 'body = "c", deflection = ["m", "c"]'), "sensors.qm_ac.a_c",
        "has both body and deflection", "keep one"),
    "neither": (('body = "c", ', ""), "sensors.qm_ac.a_c", "neither body nor deflection",
        'add body = "m"'),
    "deflection unknown": (('body = "c"', 'deflection = ["m", "x"]'), "sensors.qm_ac.a_c.deflection",
        '"x" is not a body', "the bodies are m, c"),
    "deflection self": (('body = "c"', 'deflection = ["m", "m"]'), "sensors.qm_ac.a_c.deflection",
        'joins "m" with itself', "two different"),
    "deflection ground": (('body = "c"', 'deflection = ["m", "ground"]'), "sensors.qm_ac.a_c.deflection",
        '"ground" does not move', "use body ="),
    "deflection text": (('body = "c"', 'deflection = "m"'), "sensors.qm_ac.a_c.deflection",
        'a list of two names, not "m"', 'deflection = ["m", "c"]'),
    # parameters and their values
    "two roles": (('damping = "F_d"', 'damping = "F_vm"'), "links[0].damping",
        "stands for viscous in bodies[0].viscous and for damping here", "different names"),
    "known unknown": (("J_c = 7e-7", "J_x = 7e-7"), "known.J_x", "is not a parameter", 'did you mean "J_'),
    "set unknown": (("K = 1", "stiff = 1"), "parameters.first.stiff", "is not a parameter",
        "are J_m, F_vm, F_sm"),
    "known text": (("J_c = 7e-7", 'J_c = "7,0"'), "known.J_c", "cannot be read from ','",
        "decimal point"),
    "known true": (("J_c = 7e-7", "J_c = true"), "known.J_c", "must be a number, not true", "J_c = 0.1"),
    "value nan": (("K = 1", "K = nan"), "parameters.first.K", "a finite number, not nan", "K = 0.1"),
    "value huge": (("K = 1", f"K = 0x{'f' * 5000}"), "parameters.first.K", "an integer beyond 64 bits",
        "shorten"),
    "inertia zero": (("7e-7", "0.0"), "known.J_c", "is 0.0, but inertia must be greater than 0",
        "correct"),
    "stiffness negative": (("K = 1", "K = -1"), "parameters.first.K", "is -1, but stiffness must be 0 or",
        "correct"),
    "viscous negative": (("K = 1", "F_vm = -1.5"), "parameters.first.F_vm", "-1.5, but viscous must be 0",
        "correct"),
    "damping negative": (("K = 1", "F_d = -1"), "parameters.first.F_d", "-1, but damping must be 0",
        "correct"),
    "coulomb negative": (("K = 1", "F_sm = -1"), "parameters.first.F_sm", "-1, but coulomb must be 0",
        "correct"),
}
# fmt: on


@pytest.mark.parametrize(("change", "key", "what", "remedy"), WRONG.values(), ids=WRONG)
def test_wrong_file(change: tuple[str, str], key: str, what: str, remedy: str) -> None:
    found = [problem for problem in problems(good(change)) if problem.where == f"axis.toml: {key}"]
    assert len(found) == 1
    assert what in found[0].what
    assert remedy in found[0].remedy


ONLY_ONE = [name for name in WRONG if name != "set no table"]


@pytest.mark.parametrize("name", ONLY_ONE)
def test_one_mistake_gives_one_problem(name: str) -> None:
    assert [problem.where for problem in problems(good(WRONG[name][0]))] == [f"axis.toml: {WRONG[name][1]}"]


def test_units_must_agree_where_a_name_is_shared() -> None:
    slides = SLIDES.replace("J_c", "J_m")
    (problem,) = problems(
        good(('inertia = "J_c"', slides), ("[known]", "ratio = 9.0\n[known]"), ("J_c = 7e-7", ""))
    )
    assert problem.where == "axis.toml: bodies[1].inertia"
    assert "is in kg m^2 in bodies[0].inertia and in kg here" in problem.what


def test_asymmetric_names_carry_the_direction() -> None:
    (problem,) = problems(
        good(('"O_c"', '"O_c"\nviscous = "F"\nfriction = "asymmetric"'), ("K = 1", "F = 1.0"))
    )
    assert str(problem) == (
        "axis.toml: parameters.first.F: is not a parameter of the chain; write F_plus and F_minus"
    )


def test_no_bodies() -> None:
    (problem,) = problems('bodies = []\n[chain]\nname = "x"\nmotion = "rotation"\n')
    assert (problem.where, problem.what) == ("axis.toml: bodies", "is empty")
    (problem,) = problems('[chain]\nname = "x"\nmotion = "rotation"\n')
    assert (problem.where, problem.what) == ("axis.toml: bodies", "is missing")


def test_misspelt_bodies_are_not_missed_elsewhere() -> None:
    text = GOOD.replace("[[bodies]]", "[[body]]")
    assert [p.where for p in problems(text)] == ["axis.toml: body"]


def test_every_mistake_is_reported_at_once() -> None:
    text = good(
        ('motion = "rotation"', 'motion = "rotating"'),
        ('inertia = "J_m"', 'inertia = "J m"'),
        ('coulomb = "F_sm"', 'colomb = "F_sm"'),
        ('["m", "c"]', '["m", "x"]'),
        ("7e-7", "-7e-7"),
        ("K = 1", 'K_c = 1\nK = "stiff"'),
        ("q_m = {", "d1_q = {"),
        ('body = "c"', 'body = "y"'),
        ('"acceleration"', '"force"'),
    )
    assert [p.where.removeprefix("axis.toml: ") for p in problems(text)] == [
        "chain.motion",
        "bodies[0].inertia",
        "bodies[0].colomb",
        "parameters.first.K",
        "sensors.qm_ac.a_c.measures",
        "links[0].bodies",
        "sensors.qm_ac.d1_q",
        "sensors.qm_ac.a_c.body",
        "known.J_c",
        "parameters.first.K_c",
    ]


# Units ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("motion", "measures", "derivative", "unit"),
    [
        ("rotation", "position", 0, "rad"),
        ("rotation", "position", 1, "rad/s"),
        ("rotation", "velocity", 1, "rad/s^2"),
        ("translation", "velocity", 0, "m/s"),
        ("translation", "acceleration", 2, "m/s^4"),
    ],
)
def test_signal_units(motion: Motion, measures: Measures, derivative: int, unit: str) -> None:
    assert signal_unit(motion, measures, derivative) == unit


def test_force_units() -> None:
    assert [force_unit("rotation", n) for n in range(3)] == ["N m", "N m/s", "N m/s^2"]
    assert [force_unit("translation", n) for n in range(3)] == ["N", "N/s", "N/s^2"]


@pytest.mark.parametrize(
    ("motion", "units"),
    [
        ("rotation", "kg m^2, N m s/rad, N m, N m, N m s/rad, N m/rad, N m/rad^3"),
        ("translation", "kg, N s/m, N, N, N s/m, N/m, N/m^3"),
    ],
)
def test_parameter_units(motion: Motion, units: str) -> None:
    assert ", ".join(parameter_unit(motion, role) for role in get_args(Role)) == units


# Files that are no TOML, or no files ---------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "where", "what"),
    [
        ('[chain]\nname = x"', "axis.toml: line 2, column 8", "is not valid TOML (Invalid value)"),
        ("[chain\n", "axis.toml: line 1, column 7", "Expected ']'"),
        ('name = "a', "axis.toml: end of document", "is not valid TOML"),
        ("a = 1\na = 2\n", "axis.toml: line 2, column 6", "Cannot overwrite a value"),
        ("a = " + "[" * 100_000, "axis.toml", "nests lists or tables too deeply"),
        ("a = " + "1" * 5000, "axis.toml", "holds a number of thousands of digits"),
        ("#" * 1_000_001, "axis.toml", "is larger than 1 MB"),
    ],
)
def test_text_that_is_no_toml(text: str, where: str, what: str) -> None:
    (problem,) = problems(text)
    assert problem.where == where
    assert what in problem.what


@pytest.mark.parametrize(
    ("line", "remedy"),
    [
        ("lead = 0,02", "write decimals with a point, 0.5"),
        ("name = \u201caxis\u201d", 'write straight quotes, "like these"'),
        ("J = \u22121.0", "write minus as the hyphen of the keyboard, -"),
        ("a = 1\rb = 2", "save the file with line ends of Unix or Windows (LF, CR LF)"),
        ("a = \u22121\r", "write minus as the hyphen of the keyboard, -"),
        ("lead = ", "correct the TOML there; text needs quotes, and a key or table is written once only"),
    ],
)
def test_what_keyboards_write_that_toml_refuses_is_named(line: str, remedy: str) -> None:
    (problem,) = problems(f"[chain]\n{line}\n")
    assert problem.remedy == remedy


def test_file_name_with_control_characters_is_refused() -> None:
    with pytest.raises(SpecError, match=r"'a\\nimport os.toml': has a file name with control characters"):
        parse_spec(GOOD, "a\nimport os.toml")


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match=r"none\.toml: cannot be read \(No such file or directory\); check"):
        load_spec(tmp_path / "none.toml")
    with pytest.raises(SpecError, match=r"cannot be read \(it is a folder\); check the path"):
        load_spec(tmp_path)
    latin = tmp_path / "latin.toml"
    latin.write_bytes(b'[chain]\ntitle = "f\xfcr"\n')
    with pytest.raises(SpecError, match=r"latin\.toml: line 2: is not UTF-8 text; save the file as UTF-8"):
        load_spec(latin)
    big = tmp_path / "big.toml"
    big.write_bytes(b"\xff" * 1_000_001)
    with pytest.raises(SpecError, match=r"big\.toml: is larger than 1 MB"):
        load_spec(big)


def test_an_unreadable_file_is_explained(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "locked.toml"
    path.write_text(GOOD, encoding="utf-8")

    def refuse(*_: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("modelgen.read_file.os.open", refuse)
    with pytest.raises(
        SpecError, match=r"locked\.toml: cannot be read \(Permission denied\); check the path"
    ):
        load_spec(path)


# Whatever stands anywhere: a spec or an explanation, never another error ---------------------------

ODD: tuple[Any, ...] = (
    3,
    -0.5,
    float("nan"),
    True,
    "",
    "x",
    "ground",
    [],
    [1],
    ["m", "c"],
    [{}],
    {},
    {"m": {}},
    10**400,
)


def test_any_value_in_any_place_is_explained() -> None:
    document = tomllib.loads(GOOD)
    refused = 0
    for place in places(document):
        for value in ODD:
            try:
                spec = parse_spec(toml(changed(document, place, value)), "axis.toml")
            except SpecError as error:
                refused += 1
                assert all(is_explained(problem) for problem in error.problems), (place, value)
            else:
                assert isinstance(spec, ChainSpec)
    assert refused > 400


def is_explained(problem: Problem) -> bool:
    lines = str(problem).splitlines()
    return (
        len(lines) == 1
        and all(lines[0].split(": "))
        and "None" not in lines[0]
        and "pydantic" not in lines[0]
    )


def places(node: Any) -> Iterator[tuple[str | int, ...]]:
    """Yield the path of every value in a document."""
    children = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()
    for key, child in children:
        yield (key,)
        yield from ((key, *rest) for rest in places(child))


def changed(node: Any, place: tuple[str | int, ...], value: Any) -> Any:
    """Return a copy of a document with another value in one place."""
    if not place:
        return value
    copy = node.copy()
    copy[place[0]] = changed(node[place[0]], place[1:], value)
    return copy


def toml(document: dict[str, Any]) -> str:
    return "\n".join(f"{key} = {inline(value)}" for key, value in document.items())


def inline(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {inline(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(inline(item) for item in value) + "]"
    return json.dumps(value) if isinstance(value, str | bool) else str(value)
