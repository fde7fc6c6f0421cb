from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from modelgen.errors import Problem
from modelgen.typed_values import typed


@dataclass(frozen=True)
class Inner:
    name: str
    value: float
    reason: str | None = None


@dataclass(frozen=True)
class Outer:
    count: int
    flag: bool
    relative_std: float
    pair: tuple[str, float]
    parts: tuple[Inner, ...]
    table: Mapping[str, float] = field(default_factory=dict)
    one: Inner | None = None


FINITE = st.floats(allow_nan=False, allow_infinity=False)
INNER = st.builds(Inner, st.text(), FINITE, st.none() | st.text())
OUTER = st.builds(
    Outer,
    st.integers(-(2**63), 2**63 - 1),
    st.booleans(),
    FINITE,
    st.tuples(st.text(), FINITE),
    st.lists(INNER, max_size=3).map(tuple),
    st.dictionaries(st.text(), FINITE, max_size=3),
    st.none() | INNER,
)


def read(document: Any) -> tuple[Any, list[Problem]]:
    problems: list[Problem] = []
    return typed(Outer, document, "a.json: part", "write it", problems), problems


@given(OUTER)
def test_what_was_written_comes_back(outer: Outer) -> None:
    assert read(json.loads(json.dumps(asdict(outer)))) == (outer, [])


@given(OUTER, st.data())
def test_a_value_of_another_type_is_named_with_its_place(outer: Outer, data: st.DataObject) -> None:
    document = json.loads(json.dumps(asdict(outer)))
    key = data.draw(st.sampled_from(sorted(document)))
    document[key] = {"unheard": {}} if key != "table" else [1]
    found, problems = read(document)
    assert found is None
    assert problems
    assert all(one.where.startswith(f"a.json: part.{key}") for one in problems)


def test_null_is_what_was_not_finite() -> None:
    document = asdict(Outer(1, True, 2.0, ("a", 1.0), ()))
    document = json.loads(json.dumps(document)) | {"relative_std": None, "pair": ["a", None]}
    found, problems = read(document)
    assert not problems
    assert found.relative_std == math.inf
    assert math.isnan(found.pair[1])


@pytest.mark.parametrize(
    ("key", "value", "where"),
    [
        ("count", True, "part.count"),
        ("count", 1.0, "part.count"),
        ("flag", 1, "part.flag"),
        ("relative_std", True, "part.relative_std"),
        ("pair", ["a"], "part.pair"),
        ("pair", [1, 1.0], "part.pair[0]"),
        ("parts", [{"name": "a"}], "part.parts[0].value"),
        ("parts", [{"name": "a", "value": 1.0, "odd": 1}], "part.parts[0].odd"),
        ("table", {"a": "b"}, "part.table.a"),
        ("one", [], "part.one"),
    ],
)
def test_one_message_a_mistake(key: str, value: Any, where: str) -> None:
    document = json.loads(json.dumps(asdict(Outer(1, True, 2.0, ("a", 1.0), ()))))
    found, problems = read({**document, key: value})
    assert found is None
    assert [one.where for one in problems] == [f"a.json: {where}"]
