"""Rows of sensor sets: the paper's matrices symbol by symbol, and the worked cases of the theory."""

from __future__ import annotations

import random
import re
from collections.abc import Mapping

import pytest

from modelgen.errors import ModelError, SpecError
from modelgen.spec.load import catalog_path, load_spec, parse_spec
from modelgen.symbolic.base_parameters import BaseModel
from modelgen.symbolic.equations.row import Row
from modelgen.symbolic.pipeline import build
from tests.broken_sentences import hole
from tests.symbolic.random_chains import random_spec

EMPS300 = """
[chain]
name = "emps300"
title = "two bodies"
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
[[links]]
bodies = ["m", "c"]
stiffness = "K"
damping = "F_vmc"
[sensors.set]
"""


def with_sensors(sensors: str, chain: str = EMPS300) -> BaseModel:
    return build(parse_spec(chain + sensors, "emps300.toml"), "set")


def equation(row: Row) -> dict[str | None, dict[str, float]]:
    """Return a row as parameter -> signal -> coefficient (the left-hand side under None)."""
    table: dict[str | None, dict[str, float]] = {}
    for term in row.terms:
        table.setdefault(term.parameter, {})[term.key] = float(term.coefficient)
    return table


Expected = Mapping[str | None, Mapping[str, float]]


def test_qm_qc_is_5_and_6_of_the_paper() -> None:
    model = build(load_spec(catalog_path("emps300")), "qm_qc")
    assert [b.name for b in model.base] == ["J_m", "F_vm", "F_sm", "J_c", "F_vmc", "K"]
    motor, load = model.rows.rows
    assert equation(motor) == {
        None: {"Gamma_m": 1},
        "J_m": {"d2_q_m": 1},
        "F_vm": {"d1_q_m": 1},
        "F_sm": {"sign(d1_q_m)": 1},
        "F_vmc": {"d1_q_m": 1, "d1_q_c": -1},
        "K": {"q_m": 1, "q_c": -1},
    }
    assert equation(load) == {
        "J_c": {"d2_q_c": 1},
        "F_vmc": {"d1_q_m": -1, "d1_q_c": 1},
        "K": {"q_m": -1, "q_c": 1},
    }
    assert [row.order for row in model.rows.rows] == [2, 2]


def test_qm_ac_is_14_to_16_of_the_paper_corrected() -> None:
    model = build(load_spec(catalog_path("emps300")), "qm_ac")
    assert [b.name for b in model.base] == ["J_m", "F_vm", "F_sm", "J_c", "F_vmc", "K"]
    motor, load, total = model.rows.rows
    assert equation(motor) == {
        None: {"d2_Gamma_m": 1},
        "J_m": {"d4_q_m": 1},
        "F_vm": {"d3_q_m": 1},
        "F_vmc": {"d3_q_m": 1, "d1_a_c": -1},
        "K": {"d2_q_m": 1, "a_c": -1},
    }
    assert equation(load) == {
        "J_c": {"d2_a_c": 1},
        "F_vmc": {"d3_q_m": -1, "d1_a_c": 1},
        "K": {"d2_q_m": -1, "a_c": 1},
    }
    assert equation(total) == {
        None: {"Gamma_m": 1},
        "J_m": {"d2_q_m": 1},
        "F_vm": {"d1_q_m": 1},
        "F_sm": {"sign(d1_q_m)": 1},
        "J_c": {"a_c": 1},
    }
    assert [(row.differentiated, row.order, row.reversals) for row in model.rows.rows] == [
        (2, 4, ("d1_q_m",)),
        (2, 4, ()),
        (0, 2, ()),
    ]


@pytest.mark.parametrize(
    ("sensors", "rows"),
    [
        # (name, differentiated, order): the worked answers of the theory for two bodies
        ("position position", [("m", 0, 2), ("c", 0, 2)]),
        ("position acceleration", [("m", 2, 4), ("c", 2, 4), ("m+c", 0, 2)]),
        ("velocity velocity", [("m", 1, 3), ("c", 1, 3), ("m+c", 0, 2)]),
        ("acceleration acceleration", [("m", 2, 4), ("c", 2, 4), ("m+c", 1, 3)]),
        ("position -", [("m+c without c", 0, 4)]),
        ("acceleration -", [("m+c without c", 1, 5)]),
        ("- position", [("m+c without m", 0, 4)]),
        # with a_m alone every row loses the Coulomb friction of m; eliminating m from q_c brings it back
        ("acceleration position", [("m", 2, 4), ("c", 2, 4), ("m+c", 1, 3), ("m+c without m", 0, 4)]),
    ],
)
def test_rows_of_the_worked_sensor_sets(sensors: str, rows: list[tuple[str, int, int]]) -> None:
    text = "".join(
        f'z_{body} = {{ body = "{body}", measures = "{measures}" }}\n'
        for body, measures in zip("mc", sensors.split(), strict=True)
        if measures != "-"
    )
    model = with_sensors(text)
    assert [(r.name, r.differentiated, r.order) for r in model.rows.rows] == rows


def test_an_accelerometer_beside_an_encoder_saves_two_differentiations() -> None:
    model = with_sensors(
        'q_m = { body = "m", measures = "position" }\n'
        'q_c = { body = "c", measures = "position" }\n'
        'a_c = { body = "c", measures = "acceleration" }\n'
    )
    assert [(r.name, r.differentiated) for r in model.rows.rows] == [("m", 0), ("c", 0)]
    assert equation(model.rows.rows[1])["J_c"] == {"a_c": 1}


def test_a_deflection_sensor_serves_the_whole_link() -> None:
    model = with_sensors(
        'q_m = { body = "m", measures = "position" }\n'
        'd = { deflection = ["m", "c"], measures = "position" }\n'
    )
    motor, load = model.rows.rows
    assert equation(motor)["K"] == {"d": 1}
    assert equation(load)["J_c"] == {"d2_q_m": 1, "d2_d": -1}
    assert motor.differentiated == load.differentiated == 0


def test_a_deflection_sensor_follows_the_gear_ratio_of_its_link() -> None:
    chain = EMPS300.replace('damping = "F_vmc"', 'damping = "F_vmc"\nratio = 10.0')
    model = with_sensors(
        'q_m = { body = "m", measures = "position" }\n'
        'd = { deflection = ["m", "c"], measures = "position" }\n',
        chain,
    )
    motor, load = model.rows.rows
    assert equation(motor)["K"] == {"d": 0.1}
    assert equation(load)["K"] == {"d": -1}
    assert equation(load)["J_c"] == {"d2_q_m": 0.1, "d2_d": -1}


def test_gear_ratio_weights_the_sum() -> None:
    chain = EMPS300.replace('damping = "F_vmc"', 'damping = "F_vmc"\nratio = 10.0')
    model = with_sensors(
        'q_m = { body = "m", measures = "position" }\na_c = { body = "c", measures = "acceleration" }\n',
        chain,
    )
    total = model.rows.rows[-1]
    # q_m / 10 - q_c: one turn of c costs ten of m, so the load's balance enters with a tenth.
    assert total.name == "m+c"
    assert equation(total)["J_c"] == {"a_c": 0.1}
    assert equation(total)[None] == {"Gamma_m": 1}


def test_a_body_without_velocity_asks_for_its_direction() -> None:
    chain = EMPS300.replace('inertia = "J_c"', 'inertia = "J_c"\ncoulomb = "F_sc"')
    model = with_sensors(
        'q_m = { body = "m", measures = "position" }\na_c = { body = "c", measures = "acceleration" }\n',
        chain,
    )
    assert [s.key for s in model.rows.signals if s.sensor is None and s.actuator is None] == ["sign_c"]
    assert model.rows.rows[1].reversals == ("sign_c",)
    assert equation(model.rows.rows[2])["F_sc"] == {"sign(sign_c)": 1}


def test_asymmetric_friction_has_four_columns_and_no_sign() -> None:
    model = build(load_spec(catalog_path("emps_rigid_asymmetric")), "qm")
    (row,) = model.rows.rows
    assert equation(row) == {
        None: {"F": 1},
        "M": {"d2_q_m": 1},
        "Fv_plus": {"forward(d1_q_m)*d1_q_m": 1},
        "Fc_plus": {"forward(d1_q_m)": 1},
        "Fv_minus": {"backward(d1_q_m)*d1_q_m": 1},
        "Fc_minus": {"backward(d1_q_m)": -1},
    }


def test_known_parameters_move_to_the_left_hand_side() -> None:
    model = with_sensors(
        'q_m = { body = "m", measures = "position" }\nq_c = { body = "c", measures = "position" }\n',
        EMPS300.replace("[sensors.set]", "[known]\nJ_c = 7.08e-7\n[sensors.set]"),
    )
    assert "J_c" not in [b.name for b in model.base]
    assert equation(model.rows.rows[1])[None] == {"d2_q_c": -7.08e-7}


def test_cubic_stiffness_needs_undifferentiated_deflection() -> None:
    chain = EMPS300.replace('damping = "F_vmc"', 'damping = "F_vmc"\nstiffness3 = "K3"')
    both = 'q_m = { body = "m", measures = "position" }\nq_c = { body = "c", measures = "position" }\n'
    model = with_sensors(both, chain)
    assert equation(model.rows.rows[0])["K3"] == {"cube(m-c)": 1}
    with pytest.raises(ModelError, match=r"K3 .*add a position sensor on c"):
        with_sensors(both.replace('"c", measures = "position"', '"c", measures = "acceleration"'), chain)


def test_motor_position_alone_is_the_worked_elimination_row() -> None:
    model = with_sensors('q_m = { body = "m", measures = "position" }\n')
    (row,) = model.rows.rows
    assert row.origin == "elimination of c from the equations of m, c"
    assert row.reversals == ("d1_q_m",)  # sign() is differentiated inside the row, so reversals spoil it
    assert equation(row) == {
        None: {"Gamma_m": 1},
        "J_m*J_c/K": {"d4_q_m": 1},
        "(J_m*F_vmc + F_vm*J_c + J_c*F_vmc)/K": {"d3_q_m": 1},
        "(J_m*K + F_vm*F_vmc + J_c*K)/K": {"d2_q_m": 1},
        "F_vm": {"d1_q_m": 1},
        "F_sm": {"sign(d1_q_m)": 1},
        "F_vmc/K": {"d1_Gamma_m": -1},
        "J_c/K": {"d2_Gamma_m": -1},
    }
    assert model.identifiable == ("J_m", "F_vm", "F_sm", "J_c", "F_vmc", "K")


def test_what_a_deflection_alone_leaves_open() -> None:
    model = with_sensors('d = { deflection = ["m", "c"], measures = "position" }\n')
    assert model.identifiable == ("J_m",)
    assert "only in combination: F_vm*K/J_c" in model.absent["F_vm"]
    assert "constant between reversals" in model.absent["F_sm"]


def test_equal_composites_share_their_column() -> None:
    chain = EMPS300 + 'q_m = { body = "m", measures = "position" }\n'
    third = '[[bodies]]\nname = "d"\ninertia = "J_d"\n[[links]]\nbodies = ["m", "d"]\nstiffness = "K"\n'
    model = build(parse_spec(chain.replace("[sensors.set]", third + "[sensors.set]"), "x.toml"), "set")
    names = [b.name for b in model.base]
    assert len(names) == len(set(names))


def test_what_cannot_be_eliminated_is_refused_by_name() -> None:
    cubic = EMPS300.replace('damping = "F_vmc"', 'damping = "F_vmc"\nstiffness3 = "K3"')
    with pytest.raises(ModelError, match=r"cubic stiffness at m would .* add a position sensor on c"):
        with_sensors('q_m = { body = "m", measures = "position" }\n', cubic)
    asymmetric = EMPS300.replace('coulomb = "F_sm"', 'coulomb = "F_sm"\nfriction = "asymmetric"')
    with pytest.raises(ModelError, match="asymmetric viscous friction of m would have to be eliminated"):
        with_sensors('q_c = { body = "c", measures = "position" }\n', asymmetric)
    lines = [f'[[bodies]]\nname = "b{i}"\ninertia = "J{i}"\n' for i in range(6)]
    links = [f'[[links]]\nbodies = ["b{i}", "b{i + 1}"]\nstiffness = "K{i}"\n' for i in range(5)]
    long = EMPS300[: EMPS300.index("[[bodies]]")] + "".join(lines) + "".join(links) + "[sensors.set]\n"
    long = long.replace('inertia = "J0"', 'inertia = "J0"\nactuator = "G"')
    with pytest.raises(ModelError, match=r"5 bodies .* \(b1, b2, b3, b4, b5\); at most 4 can be eliminated"):
        with_sensors('q = { body = "b0", measures = "position" }\n', long)


def test_messages_for_sets_that_cannot_be_built() -> None:
    with pytest.raises(ModelError, match="no force is measured or known"):
        with_sensors(
            'q_m = { body = "m", measures = "position" }\n', EMPS300.replace('actuator = "Gamma_m"', "")
        )
    with pytest.raises(SpecError, match="no such sensor set; choose one of qm_qc, qm_ac"):
        build(load_spec(catalog_path("emps300")), "nothing")


@pytest.mark.parametrize("seed", range(40))
def test_friction_by_direction_is_read_or_refused_in_words(seed: int) -> None:
    rng = random.Random(seed)
    text = re.sub(
        r'coulomb = "(\w+)"', r'coulomb = "\1"\nfriction = "asymmetric"', random_spec(rng, most_bodies=5)
    )
    # what is read between two bodies says nothing of the motion of either
    bodies = re.findall(r'bodies = \["(b\d)", "(b\d)"\]', text)
    if seed % 2 and bodies:
        one, other = rng.choice(bodies)
        text = text.partition("[sensors.set]")[0] + (
            f'[sensors.set]\nrel = {{ deflection = ["{one}", "{other}"], measures = "position" }}'
        )
    try:
        build(parse_spec(text, "chain.toml"), "set")
    except ModelError as error:
        assert hole(str(error)) is None
