"""The Modelica text is read by a parser, and its equations say what the direct model says."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
import pymoca.parser
import pytest

from generated import emps300_qm_ac, emps_rigid_asymmetric_qm, tree_mixed
from modelgen.runtime.exports.case import Case
from modelgen.runtime.exports.export import export
from modelgen.runtime.exports.mechanics import mechanics
from modelgen.runtime.exports.modelica import write
from modelgen.runtime.exports.values import Values
from modelgen.runtime.model.model import Model, model_from_module
from tests.runtime.exports.open_loop import GEARED, model_of

MODELS = {
    "emps300": model_from_module(emps300_qm_ac),
    "asymmetric": model_from_module(emps_rigid_asymmetric_qm),
    "tree": model_from_module(tree_mixed),
    "geared": model_of(GEARED),
    "words of the language": model_of(GEARED.replace('"T"', '"input"').replace("K_g", "time")),
    "names of its own": model_of(GEARED.replace("O_t", "position_m").replace("K_g", "force_1")),
    "hardening": model_of(
        GEARED.replace("D = 800.0", "D = 800.0\nK3 = 1e9").replace('"D", l', '"D", stiffness3 = "K3", l')
    ),
}


def classes(text: str) -> list[str]:
    """Return the classes that a parser finds in a text, without those of the language."""
    own = pymoca.parser.parse("model none end none;").classes
    return [name for name in pymoca.parser.parse(text).classes if name not in own]


def text_of(model: Model) -> str:
    return export(model, next(iter(model.parameter_sets)), "modelica").files[""].decode()


def evaluated(text: str, given: Mapping[str, float]) -> dict[str, float]:
    """Return what every variable and derivative is, in the order of the equations."""
    known = {**given, "tanh": np.tanh}
    for line in text.partition("\nequation\n")[2].splitlines():
        if line.startswith("end "):
            break
        left, right = line.strip().removesuffix(";").split(" = ", 1)
        right = re.sub(r"der\((\w+)\)", r"der_\1", right).replace("'", "")
        right = re.sub(r"\(if (\w+) > 0 then (\w+) else (\w+)\)", r"(\2 if \1 > 0 else \3)", right)
        value = eval(right.replace("^", "**"), {"__builtins__": {}}, known)
        name = re.search(r"der\((\w+)\)", left)
        divisor = left.replace("'", "").partition("*der")[0]
        known[f"der_{name[1]}" if name else left.replace("'", "")] = (
            value / known[divisor] if name and "*" in left else value
        )
    return {key: float(value) for key, value in known.items() if key != "tanh"}


@pytest.mark.parametrize("name", MODELS)
def test_a_parser_reads_it_and_the_equations_are_those_of_the_chain(name: str) -> None:
    model = MODELS[name]
    text = text_of(model)
    assert classes(text) == [f"{model.chain}_{model.sensor_set}"]
    values = dict(next(iter(model.parameter_sets.values()))) | dict(model.known)
    space = model.state_space(values, {f.body: 1 for f in model.friction})
    n = len(space.A) // 2
    symbols = pymoca.parser.parse(text).classes[f"{model.chain}_{model.sensor_set}"].symbols
    states = [
        key for key, symbol in symbols.items() if re.match("position_|speed_", key) and not symbol.prefixes
    ]
    positions, speeds = states[0::2], states[1::2]
    rng = np.random.default_rng(1)
    # every body moves forwards, so fast that friction has its full size
    state = np.r_[1e-6 * rng.standard_normal(n), rng.uniform(50.0, 60.0, n)]
    force = rng.standard_normal(len(model.actuators))
    given = values | dict(zip(positions + speeds, state.tolist(), strict=True))
    given |= {a.key: float(f) for a, f in zip(model.actuators, force, strict=True)}
    given |= {key: 1e-3 for key in symbols if key.startswith("slow_")}
    found = evaluated(text, given)
    friction = [
        (values[f.coulomb_plus] if f.coulomb_plus else 0.0) + (values[f.offset] if f.offset else 0.0)
        for f in model.friction
    ]
    expected = space.A @ state + space.B @ force + space.E @ friction
    for spring in model.cubic_springs:
        stretch = sum(state[i] * c for i, c in spring.deflection)
        owner = {
            body: name for name, role in model.roles.items() if role.role == "inertia" for body in role.bodies
        }
        inertia = [values[owner[key.removeprefix("position_")]] for key in positions]
        for i, c in spring.deflection:
            expected[n + i] -= c * values[spring.parameter] * stretch**3 / inertia[i]
    size = np.abs(expected[n:]).max()
    for i, speed in enumerate(speeds):
        assert found[f"der_{speed}"] == pytest.approx(expected[n + i], rel=1e-9, abs=1e-9 * size)
    for sensor, reading in zip(model.sensors, space.C @ state, strict=True):
        if sensor.measures != "acceleration":
            assert found[sensor.key] == pytest.approx(reading, rel=1e-9, abs=1e-9)


def test_texts_of_users_stay_texts() -> None:
    for title in ('a\\"; model evil end evil; \\"', "back\\\\slash", "tick ' tick"):
        text = text_of(model_of(GEARED.replace('<b>\\"A -- gear\\"</b>', title)))
        assert classes(text) == ["geared_all"]


def test_samples_are_models_of_a_package() -> None:
    model = model_of(GEARED)
    case = Case(
        model,
        mechanics(model),
        Values(
            dict(model.parameter_sets["nominal"]),
            dict.fromkeys(model.parameters, "given"),
            samples=({**model.parameter_sets["nominal"], "K": 5e6},),
        ),
    )
    text = write(case).files[""].decode()
    assert classes(text) == ["geared_all_package"]
    inner = pymoca.parser.parse(text).classes["geared_all_package"].classes
    assert list(inner) == ["geared_all", "sample_001"]
    assert "model sample_001 = geared_all(K = 5000000.0);" in text
