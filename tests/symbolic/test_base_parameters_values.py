"""Elimination, regrouping and the random regressor, checked entry by entry."""

from __future__ import annotations

import dataclasses
import random
from collections.abc import Sequence
from fractions import Fraction
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from modelgen.errors import ModelError
from modelgen.spec.load import catalog_path, load_spec, parse_spec
from modelgen.symbolic import base_parameters
from modelgen.symbolic.base_parameters import (
    LARGEST_QR,
    REGROUPING_TOLERANCE,
    BaseParameter,
    _agree,
    _numerical_dependencies,
    _reasons,
    random_regressor,
    regroup,
)
from modelgen.symbolic.exact_dependencies import exact_dependencies
from modelgen.symbolic.pipeline import build
from tests.symbolic.test_base_parameters import PARALLEL, TWO_OFFSETS

Column = dict[tuple[int, str], Any]


def combined(columns: Sequence[Column], recipe: dict[int, Any]) -> Column:
    total: Column = {}
    for index, factor in recipe.items():
        for place, value in columns[index].items():
            total[place] = total.get(place, 0) + factor * value
    return {place: value for place, value in total.items() if value}


def rank(columns: Sequence[Column], chosen: Sequence[int]) -> int:
    places = sorted({place for column in columns for place in column})
    matrix = np.array([[float(columns[i].get(place, 0)) for i in chosen] for place in places])
    return int(np.linalg.matrix_rank(matrix)) if chosen else 0


# Exact elimination --------------------------------------------------------------------------------


def test_fill_in_that_meets_a_later_pivot_is_eliminated_as_well() -> None:
    a, b, c, d = ((0, key) for key in "abcd")
    columns: list[Column] = [{a: 1, b: 3}, {b: 2, c: 5}, {c: 7, d: 1}, {a: 4, d: Fraction(-30, 7)}]
    # a away leaves b, which no entry of the column was; b away leaves c, and so on
    dependent = exact_dependencies(columns)
    assert dependent == {3: {0: 4, 1: -6, 2: Fraction(30, 7)}} or dependent == {}
    columns[3] = combined(columns, {0: 4, 1: -6, 2: Fraction(30, 7)})
    assert set(columns[3]) == {a, d}
    assert exact_dependencies(columns) == {3: {0: 4, 1: -6, 2: Fraction(30, 7)}}


@pytest.mark.parametrize("seed", range(40))
def test_random_columns_split_into_independent_ones_and_exact_combinations(seed: int) -> None:
    draw = random.Random(seed)
    places = [(row, key) for row in range(3) for key in "xyz"]
    columns: list[Column] = []
    for _ in range(12):
        if columns and draw.random() < 0.4:  # a combination of earlier ones, dependent for certain
            recipe = {i: Fraction(draw.randint(-3, 3), draw.randint(1, 4)) for i in range(len(columns))}
            column = combined(columns, recipe)
        else:
            column = {
                place: Fraction(draw.choice([-3, -1, 1, 2, 5]), draw.randint(1, 3))
                for place in draw.sample(places, draw.randint(1, 3))
            }
        if column:
            columns.append(column)
    dependent = exact_dependencies(columns)
    independent = [i for i in range(len(columns)) if i not in dependent]
    assert rank(columns, independent) == len(independent) == rank(columns, range(len(columns)))
    for index, recipe in dependent.items():
        assert combined(columns, recipe) == columns[index]
        assert all(recipe.values())
        assert set(recipe) <= {i for i in independent if i < index}
        assert list(recipe) == sorted(recipe)


# Numbers and the exact ones ----------------------------------------------------------------------


def test_numbers_agree_with_exact_combinations_up_to_rounding_only() -> None:
    exact = {2: {0: Fraction(1, 3), 1: Fraction(-2)}}
    near = 1.0 + 0.5 * REGROUPING_TOLERANCE
    assert _agree({2: {0: near / 3.0, 1: -2.0}}, exact)
    far = 1.0 + 2.0 * REGROUPING_TOLERANCE
    assert not _agree({2: {0: far / 3.0, 1: -2.0}}, exact)
    assert not _agree({2: {0: 1.0 / 3.0, 1: -2.0 * far}}, exact)
    assert not _agree({2: {0: 1.0 / 3.0}}, exact)
    assert not _agree({2: {0: 1.0 / 3.0, 1: -2.0, 3: 1e-3}}, exact)
    assert not _agree({}, exact)
    assert not _agree({1: {0: 1.0}}, exact)
    assert _agree({}, {})


def numerical(monkeypatch: pytest.MonkeyPatch, matrix: np.ndarray[Any, Any]) -> dict[int, dict[int, float]]:
    names = [f"p{i}" for i in range(matrix.shape[1])]
    rows: Any = SimpleNamespace()
    monkeypatch.setattr(base_parameters, "random_regressor", lambda given, asked: matrix)
    return _numerical_dependencies(rows, names)


def test_dependent_columns_are_found_by_their_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    a, b, c = np.random.default_rng(1).standard_normal((3, 30))
    scaled = np.column_stack([a, 1e6 * b, 2.0 * a - 3e6 * b, 1e-4 * c, 5e-4 * c])
    found = numerical(monkeypatch, scaled)
    assert list(found) == [2, 4]
    assert found[2] == pytest.approx({0: 2.0, 1: -3.0})
    assert found[4] == pytest.approx({3: 5.0})


def test_one_column_and_two_equal_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    a = np.random.default_rng(2).standard_normal(20)
    assert numerical(monkeypatch, a[:, None]) == {}
    (recipe,) = numerical(monkeypatch, np.column_stack([a, -4.0 * a])).values()
    assert recipe == pytest.approx({0: -4.0})


def test_only_small_models_are_checked_by_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    rows = build(parse_spec(PARALLEL, "parallel.toml"), "q").rows
    asked: list[int] = []

    def recorded(given: Any, names: Sequence[str]) -> dict[int, dict[int, float]]:
        asked.append(len(names))
        return {2: {1: 1.0}, 4: {3: 1.0}}

    monkeypatch.setattr(base_parameters, "_numerical_dependencies", recorded)
    names = ["M", "D1", "D2", "K1", "K2"]
    for largest, expected in ((4, []), (5, [5]), (LARGEST_QR, [5, 5])):
        monkeypatch.setattr(base_parameters, "LARGEST_QR", largest)
        assert [b.name for b in regroup(rows, names)] == ["M", "D1 + D2", "K1 + K2"]
        assert asked == expected


# The random regressor -----------------------------------------------------------------------------


def test_a_constant_column_is_the_coefficient_of_its_parameter() -> None:
    rows = build(parse_spec(TWO_OFFSETS, "pair.toml"), "elastic").rows
    column = random_regressor(rows, ["O_c"]).reshape(-1, len(rows.rows))
    held = [sum(t.coefficient for t in row.terms if t.parameter == "O_c") for row in rows.rows]
    assert any(held)
    np.testing.assert_array_equal(column, np.tile([float(value) for value in held], (len(column), 1)))


def test_terms_of_one_parameter_in_a_row_add_up() -> None:
    rows = build(load_spec(catalog_path("emps300")), "qm_qc").rows
    index, row = next(
        (i, row) for i, row in enumerate(rows.rows) if sum(t.parameter == "K" for t in row.terms) > 1
    )
    first = next(place for place, term in enumerate(row.terms) if term.parameter == "K")
    apart = list(row.terms)
    apart[first] = apart[first]._replace(parameter="K_first")
    split = dataclasses.replace(
        rows,
        rows=tuple(
            dataclasses.replace(row, terms=tuple(apart)) if i == index else one
            for i, one in enumerate(rows.rows)
        ),
    )
    together = random_regressor(rows, ["K"])[:, 0]
    parts = random_regressor(split, ["K", "K_first"])[: len(together)]  # a wider row asks for more lines
    assert np.all(np.abs(parts).sum(axis=0) > 0.0)
    np.testing.assert_allclose(parts.sum(axis=1), together, rtol=1e-14)


def test_the_regressor_has_more_lines_than_columns_and_is_the_same_every_time() -> None:
    rows = build(load_spec(catalog_path("tree")), "mixed").rows
    names = [p.name for p in rows.spec.parameters]
    regressor = random_regressor(rows, names)
    assert regressor.shape[1] == len(names)
    assert regressor.shape[0] % len(rows.rows) == 0
    assert regressor.shape[0] >= 2 * len(names)
    np.testing.assert_array_equal(regressor, random_regressor(rows, names))
    single = dataclasses.replace(rows, rows=rows.rows[:1])
    assert random_regressor(single, names).shape[0] >= 2 * len(names)
    assert not np.array_equal(regressor, random_regressor(rows, names, seed=1))


# Reasons and messages -----------------------------------------------------------------------------


def test_a_parameter_in_several_combinations_names_them_all() -> None:
    rows: Any = SimpleNamespace(composites={})
    base = [BaseParameter((("A", 1), ("B", 1))), BaseParameter((("C", 1), ("B", -2)))]
    assert _reasons(rows, ["A", "B", "C"], base, ["C"]) == {
        "A": "only in combination: A + B",
        "B": "only in combination: A + B, C - 2*B",
    }


def test_what_is_differentiated_away_says_how_often() -> None:
    text = TWO_OFFSETS.replace(
        'q_m = { body = "m", measures = "position" }\na_c',
        'a_m = { body = "m", measures = "acceleration" }\na_c',
    )
    text = text.replace('offset = "O_m"', 'offset = "O_m"\nviscous = "F"')
    model = build(parse_spec(text, "pair.toml"), "rigid")
    least = min(row.differentiated for row in model.rows.rows)
    assert least > 0
    assert model.absent["O_m"] == (
        "it is constant between reversals and every row that holds it is differentiated "
        f"(at least {least} times) for these sensors; add a position or velocity sensor"
    )


def test_errors_name_the_file_and_the_sensors() -> None:
    known = PARALLEL + "[known]\nM = 1.0\nK1 = 1.0\nK2 = 1.0\nD1 = 1.0\nD2 = 1.0\n"
    with pytest.raises(ModelError) as caught:
        build(parse_spec(known, "parallel.toml"), "q")
    assert str(caught.value) == (
        "parallel.toml: sensors.q: no parameter is left to be estimated; "
        "take at least one parameter out of [known]"
    )


def test_ranks_that_disagree_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    rows = build(parse_spec(PARALLEL, "parallel.toml"), "q").rows
    monkeypatch.setattr(base_parameters, "_numerical_dependencies", lambda given, names: {4: {3: 1.0}})
    with pytest.raises(ModelError) as caught:
        regroup(rows, ["M", "D1", "D2", "K1", "K2"])
    assert str(caught.value) == (
        "parallel.toml: sensors.q: the numerical rank of the random regressor (4) and the exact rank (3) of "
        "its 5 columns disagree; check for gear ratios that are extremely large or small"
    )
