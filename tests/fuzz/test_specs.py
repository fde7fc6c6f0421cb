"""Any text and any table of TOML either is a spec or gets explained: no other exception, no hang.

Every test tries 200 examples, the same ones in every run; with MODELGEN_FUZZ=nightly 10,000 new ones.
"""

from __future__ import annotations

import json
import math
import os
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from modelgen.errors import ModelgenError, SpecError
from modelgen.generated_module.module_check import module_problems
from modelgen.render.writer import generate
from modelgen.spec.load import parse_spec

NIGHTLY = os.environ.get("MODELGEN_FUZZ") == "nightly"
FUZZ = settings(
    max_examples=10_000 if NIGHTLY else 200,
    deadline=5000,  # ms
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.filter_too_much],
)

PLAIN = st.sampled_from(
    ["m", "c", "q_m", "J_m", "J_c", "K", "F_v", "F_s", "O", "Gamma", "ground", "nominal", "qm"]
)
MARKS = st.sampled_from(['"', "'''", "[", "]", "[[", "=", "\n", "0x", "#"])
TEXT = PLAIN | st.text(max_size=8)
NUMBER = st.floats() | st.integers() | st.sampled_from([0, 0.0, -1.0, 1e-300, 1e308, math.inf])
ANYTHING: st.SearchStrategy[Any] = st.recursive(
    st.booleans() | NUMBER | TEXT,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(TEXT, inner, max_size=3),
    max_leaves=8,
)
MOTION = st.sampled_from(["rotation", "translation"])
MEASURES = st.sampled_from(["position", "velocity", "acceleration"])


def mostly(good: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    """Draw what belongs there nine times of ten."""
    return st.integers(0, 9).flatmap(lambda dice: ANYTHING if dice == 0 else good)


def table(required: dict[str, Any], optional: dict[str, Any] | None = None) -> st.SearchStrategy[Any]:
    return mostly(st.fixed_dictionaries(required, optional=optional or {}))


PAIR = mostly(st.lists(PLAIN, min_size=2, max_size=2))
BODY = table(
    {"name": mostly(PLAIN), "inertia": mostly(PLAIN)},
    {
        **{key: mostly(PLAIN) for key in ("viscous", "coulomb", "offset", "actuator")},
        "friction": mostly(st.sampled_from(["symmetric", "asymmetric"])),
        "motion": mostly(MOTION),
    },
)
LINK = table(
    {"bodies": PAIR, "stiffness": mostly(PLAIN)},
    {"damping": mostly(PLAIN), "stiffness3": mostly(PLAIN), "ratio": mostly(NUMBER)},
)
SENSOR = table({"measures": mostly(MEASURES)}, {"body": mostly(PLAIN), "deflection": PAIR})
DOCUMENT = st.fixed_dictionaries(
    {
        "chain": table({"name": mostly(PLAIN), "motion": mostly(MOTION)}, {"title": mostly(TEXT)}),
        "bodies": mostly(st.lists(BODY, min_size=1, max_size=3)),
    },
    optional={
        "links": mostly(st.lists(LINK, max_size=3)),
        "known": mostly(st.dictionaries(PLAIN, mostly(NUMBER), max_size=2)),
        "parameters": mostly(st.dictionaries(PLAIN, st.dictionaries(PLAIN, NUMBER, max_size=3), max_size=2)),
        "sensors": mostly(st.dictionaries(PLAIN, st.dictionaries(PLAIN, SENSOR, max_size=3), max_size=2)),
        "extra": ANYTHING,
    },
)


def toml(value: Any) -> str:
    """Write a value as TOML does within a line."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{toml(str(key))} = {toml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    if isinstance(value, str):
        return "".join(f"\\U{ord(c):08X}" if ord(c) > 126 else json.dumps(c)[1:-1] for c in value).join('""')
    return {True: "true", False: "false"}[value] if isinstance(value, bool) else repr(value)


@pytest.mark.slow
@FUZZ
@given(DOCUMENT)
def test_any_tables(document: dict[str, Any]) -> None:
    explained(document_text(document))


@pytest.mark.slow
@FUZZ
@given(st.text(max_size=300))
def test_any_text(text: str) -> None:
    explained(text)


@pytest.mark.slow
@FUZZ
@given(st.data())
def test_a_good_file_with_one_piece_replaced(data: st.DataObject) -> None:
    start = data.draw(st.integers(0, len(GOOD)))
    piece = data.draw(st.text(max_size=5) | MARKS)
    explained(GOOD[:start] + piece + GOOD[start + data.draw(st.integers(0, 20)) :])


GOOD = """
chain = { name = "axis", motion = "rotation" }
bodies = [{ name = "m", inertia = "J_m", actuator = "T" }, { name = "c", inertia = "J_c", coulomb = "F_s" }]
links = [{ bodies = ["m", "c"], stiffness = "K", damping = "D", ratio = 2.5 }]
known = { J_c = 1e-3 }
[sensors.qm]
q_m = { body = "m", measures = "position" }
"""


def document_text(document: dict[str, Any]) -> str:
    return "\n".join(f"{toml(key)} = {toml(value)}" for key, value in document.items())


def explained(text: str) -> None:
    """Parse a spec, and generate its modules if it is one; what is refused is told in printable lines."""
    try:
        spec = parse_spec(text, "axis.toml")
        for sensors in spec.sensor_sets:
            assert module_problems(generate(spec, sensors)) == []
    except SpecError as error:
        check_lines(error)
        assert all(problem.where.startswith("axis.toml") for problem in error.problems)
    except ModelgenError as error:
        check_lines(error)


def check_lines(error: ModelgenError) -> None:
    assert error.problems
    assert all(line.isprintable() for line in str(error).splitlines()), str(error)
    assert all(problem.what and problem.remedy for problem in error.problems)
