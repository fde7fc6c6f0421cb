"""Base parameters: regrouping, exact rationals, agreement of numerical and exact rank."""

from __future__ import annotations

import dataclasses
from fractions import Fraction

import numpy as np
import pytest

from modelgen.errors import ModelError
from modelgen.spec.load import catalog_names, catalog_path, load_spec, parse_spec
from modelgen.symbolic import base_parameters
from modelgen.symbolic.base_parameters import random_regressor, regroup
from modelgen.symbolic.exact_dependencies import exact_dependencies
from modelgen.symbolic.pipeline import build

TWO_OFFSETS = """
[chain]
name = "pair"
title = "two bodies whose offsets only the rigid sum row holds"
motion = "rotation"
[[bodies]]
name = "m"
inertia = "J_m"
offset = "O_m"
actuator = "Gamma_m"
[[bodies]]
name = "c"
inertia = "J_c"
offset = "O_c"
[[links]]
bodies = ["m", "c"]
stiffness = "K"
ratio = 4.0
[sensors.rigid]
q_m = { body = "m", measures = "position" }
a_c = { body = "c", measures = "acceleration" }
[sensors.elastic]
q_m = { body = "m", measures = "position" }
q_c = { body = "c", measures = "position" }
"""

PARALLEL = """
[chain]
name = "parallel"
title = "two springs side by side"
motion = "translation"
[[bodies]]
name = "m"
inertia = "M"
actuator = "F"
[[links]]
bodies = ["m", "ground"]
stiffness = "K1"
damping = "D1"
[[links]]
bodies = ["m", "ground"]
stiffness = "K2"
damping = "D2"
[sensors.q]
q = { body = "m", measures = "position" }
"""


@pytest.mark.parametrize("name", catalog_names())
def test_catalogue_rank_of_the_random_regressor(name: str) -> None:
    spec = load_spec(catalog_path(name))
    for sensor_set in spec.sensor_sets:
        model = build(spec, sensor_set)
        names = [p for b in model.base for p, _ in b.combination]
        rank = np.linalg.matrix_rank(random_regressor(model.rows, names))
        assert rank == len(model.base)


def test_bodies_that_move_as_one_for_the_sensors_are_regrouped() -> None:
    model = build(parse_spec(TWO_OFFSETS, "pair.toml"), "rigid")
    assert [b.name for b in model.base] == ["J_m", "O_m + 1/4*O_c", "J_c", "K"]
    assert model.identifiable == ("J_m", "J_c", "K")


def test_the_same_bodies_are_told_apart_by_two_encoders() -> None:
    model = build(parse_spec(TWO_OFFSETS, "pair.toml"), "elastic")
    assert model.identifiable == ("J_m", "O_m", "J_c", "O_c", "K")


def test_parallel_links_are_regrouped() -> None:
    model = build(parse_spec(PARALLEL, "parallel.toml"), "q")
    assert [b.name for b in model.base] == ["M", "D1 + D2", "K1 + K2"]
    assert model.base[1].combination == (("D1", Fraction(1)), ("D2", Fraction(1)))
    assert model.identifiable == ("M",)


def test_regrouped_columns_give_the_same_measurement() -> None:
    model = build(parse_spec(TWO_OFFSETS, "pair.toml"), "rigid")
    values = {"J_m": 1.0, "O_m": 0.3, "J_c": 2.0, "O_c": -0.7, "K": 5.0}
    full = random_regressor(model.rows, list(values)) @ np.array(list(values.values()))
    first = [b.combination[0][0] for b in model.base]
    base = [sum(float(f) * values[p] for p, f in b.combination) for b in model.base]
    np.testing.assert_allclose(
        random_regressor(model.rows, list(values))[:, [list(values).index(p) for p in first]] @ base, full
    )


def test_what_no_row_holds_is_listed_with_its_reason() -> None:
    text = TWO_OFFSETS.replace(
        'q_m = { body = "m", measures = "position" }\na_c',
        'a_m = { body = "m", measures = "acceleration" }\na_c',
    )
    text = text.replace('offset = "O_m"', 'offset = "O_m"\nviscous = "F"')
    model = build(parse_spec(text, "pair.toml"), "rigid")
    assert set(model.absent) == {"O_m", "O_c"}
    assert "constant between reversals" in model.absent["O_m"]


def test_exact_dependencies_of_a_hand_made_matrix() -> None:
    a, b, c = (0, "x"), (0, "y"), (1, "x")
    columns = [
        {a: Fraction(1), b: Fraction(2)},
        {c: Fraction(1, 3)},
        {a: Fraction(1, 2), b: Fraction(1), c: Fraction(2)},
        {a: Fraction(1)},
    ]
    assert exact_dependencies(columns) == {2: {0: Fraction(1, 2), 1: Fraction(6)}}


def test_disagreeing_ranks_are_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    rows = build(load_spec(catalog_path("emps300")), "qm_qc").rows
    monkeypatch.setattr(base_parameters, "RANK_TOLERANCE", 0.9)
    with pytest.raises(ModelError, match=r"numerical rank .* and the exact rank \(6\)"):
        regroup(rows, ["J_m", "F_vm", "F_sm", "J_c", "F_vmc", "K"])


def test_nothing_left_to_estimate() -> None:
    text = PARALLEL + "[known]\nM = 1.0\nK1 = 1.0\nK2 = 1.0\nD1 = 1.0\nD2 = 1.0\n"
    with pytest.raises(ModelError, match="no parameter is left"):
        build(parse_spec(text, "parallel.toml"), "q")


def test_base_parameter_names_show_signs_and_factors() -> None:
    parameter = base_parameters.BaseParameter(
        (("A", Fraction(1)), ("B", Fraction(-1)), ("C", Fraction(3, 2)))
    )
    assert parameter.name == "A - B + 3/2*C"
    assert dataclasses.is_dataclass(parameter)
