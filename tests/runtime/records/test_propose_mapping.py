"""Proposed columns: names as people write them, torques named T, what was measured before its set point."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest

from generated import emps300_qm_ac, emps300_qm_qc, emps_rigid_qm, three_mass_qa_qb_qc
from modelgen.runtime.files.source import Source
from modelgen.runtime.model.model import Model, model_from_module
from modelgen.runtime.records.mapping_file import mapping_text
from modelgen.runtime.records.propose_mapping import propose

QC, AC = model_from_module(emps300_qm_qc), model_from_module(emps300_qm_ac)
THREE = model_from_module(three_mass_qa_qb_qc)


def proposed(
    model: Model, names: Sequence[str], units: dict[str, str] | None = None
) -> dict[str, str | None]:
    def load(asked: Sequence[str]) -> dict[str, np.ndarray]:
        return {name: np.zeros(3) for name in asked}

    source = Source(Path("a.csv"), tuple(names), load, units=units or {})
    return {entry.key: entry.column for entry in propose(source, model)}


@pytest.mark.parametrize("change", [str.upper, str.lower, str.title])
@pytest.mark.parametrize("between", ["", "_", ".", " ", "-"])
@pytest.mark.parametrize("model", [QC, AC, THREE])
def test_names_are_compared_without_case_and_underscores(model: Model, change: object, between: str) -> None:
    names = {key: change(key.replace("_", between)) for key in model.channels}  # type: ignore[operator]
    for order in (list(names.values()), list(names.values())[::-1]):
        assert proposed(model, ["time", *order]) == names


@pytest.mark.parametrize(
    ("names", "units"),
    [
        (("t", "q_m", "q_c", "T"), {}),
        (("time", "qm", "qc", "T"), {"T": "Nm"}),
        (("q_m", "q_c", "T"), {"T": "Nm"}),
        (("time", "motor_pos", "load_pos", "Tm"), {}),
        (("time", "theta_m", "theta_c", "T_m"), {}),
    ],
)
def test_a_torque_named_T(names: tuple[str, ...], units: dict[str, str]) -> None:
    for order in permutations(names):
        assert proposed(QC, order, units)["Gamma_m"] == names[-1], order


def test_the_effort_of_a_joint_is_a_force() -> None:
    names = ["/joint_states.position[0]", "/joint_states.velocity[0]", "/joint_states.effort[0]"]
    assert proposed(QC, names)["Gamma_m"] == "/joint_states.effort[0]"


def test_times_named_t_are_no_torque() -> None:
    assert proposed(QC, ["t", "q_m", "q_c"])["Gamma_m"] is None
    assert proposed(QC, ["x", "q_m", "q_c", "dt"])["Gamma_m"] is None


@pytest.mark.parametrize("asked", ["ref", "cmd", "set", "des", "soll", "setpoint", "target", "demand"])
@pytest.mark.parametrize("found", ["meas", "act", "ist", "fbk", "measured"])
@pytest.mark.parametrize("pattern", ["i_{}", "i{}", "I{}", "motor.current.{}", "iq_{}"])
def test_what_was_measured_comes_before_what_was_asked_for(asked: str, found: str, pattern: str) -> None:
    words = [word.title() if pattern == "I{}" else word for word in (asked, found)]
    names = [pattern.format(word) for word in words]
    for order in (names, names[::-1]):
        columns = ["time", "theta_m", "theta_c", *order]
        units = dict.fromkeys(order, "A") | {"theta_m": "rad", "theta_c": "rad"}
        assert proposed(QC, columns, units)["Gamma_m"] == names[1]


def test_a_set_point_alone_is_proposed_with_a_word_of_caution() -> None:
    source = Source(Path("a"), ("q_m", "q_c", "torque_cmd"), lambda names: {}, units={"torque_cmd": "Nm"})
    force = next(entry for entry in propose(source, QC) if entry.key == "Gamma_m")
    assert force.column == "torque_cmd" and "set point" in force.why


@pytest.mark.parametrize("name", ["torque_ff", "feedforward", "feed_forward", "Vorsteuermoment", "tau ff"])
def test_a_feedforward_is_an_input_of_the_loop_and_no_measured_force(name: str) -> None:
    for units in ({}, {name: "Nm", "torque": "Nm"}):
        for order in ([name, "torque"], ["torque", name]):
            found = proposed(QC, ["t", "q_m", "q_c", *order], units)
            assert (found["Gamma_m"], found["feedforward"]) == ("torque", name)
    assert proposed(QC, ["t", "q_m", "q_c", name])["Gamma_m"] is None
    assert "feedforward" not in proposed(QC, ["t", "q_m", "q_c", "i_ff"], {"i_ff": "A"})


def test_references_are_told_from_each_other_and_from_the_current_s() -> None:
    names = ["t", "q_m", "q_c", "torque", "speed_ref", "pos_ref", "i_ref"]
    found = proposed(QC, names)
    assert (found["reference"], found["reference_rate"]) == ("pos_ref", "speed_ref")
    assert "reference" not in proposed(QC, ["t", "q_m", "q_c", "torque", "torque_ref", "i_ref", "iref"])
    german = ["Zeit", "Lage", "Sollage", "Solldrehzahl", "Drehmoment"]
    units = {"Lage": "°", "Sollage": "°", "Solldrehzahl": "1/min", "Drehmoment": "Nm"}
    found = proposed(QC, german, units)
    assert (found["reference"], found["reference_rate"]) == ("Sollage", "Solldrehzahl")


@pytest.mark.parametrize(
    ("key", "column", "unit", "wanted"),
    [
        ("Gamma_m", "iq", "mA", "N m"),
        ("Gamma_m", "Moment", "%", "N m"),  # of the drive's rated one
        ("Gamma_m", "Moment", "lsb", "N m"),
        *(("q_m", "q_m", unit, "rad") for unit in ("counts", "inc", "Increments", "[ticks]")),
        ("Gamma_m", "Moment", "furlong", "N m"),  # a unit that is not known
        ("q_m", "q_m", "grad", "rad"),  # a degree, or a hundredth of a right angle
    ],
)
def test_what_is_logged_as_something_else_is_proposed_with_the_factor_that_it_needs(
    key: str, column: str, unit: str, wanted: str
) -> None:
    names = ("q_m", "q_c", column if key == "Gamma_m" else "Gamma_m")
    entries = propose(Source(Path("a"), names, lambda asked: {}, units={column: unit}), QC)
    found = next(entry for entry in entries if entry.key == key)
    assert found.column == column and f"give {wanted} per {unit} as its factor" in found.why
    assert [entry.key for entry in entries if entry.lacks_factor] == [key]
    assert f"# factor = ...  # {wanted} per {unit}" in mapping_text("a", entries, None, None, None, ())


def test_what_may_be_a_unit_in_brackets_is_asked_for() -> None:
    columns = ("t", "q_m (Uml)", "q_c (load)", "Gamma_m (NM)")
    why = {e.key: e.why for e in propose(Source(Path("a"), columns, lambda asked: {}), QC)}
    assert "if Uml is a unit, give rad per Uml" in why["q_m"] and "if NM is a unit" in why["Gamma_m"]
    assert "is a unit" not in why["q_c"]
    places = ("q_m (elbow)", "Gamma_m (elbow)", "q_c (load)")
    assert not any("is a unit" in e.why for e in propose(Source(Path("a"), places, lambda asked: {}), QC))


def test_inputs_and_outputs_are_proposed_by_their_place() -> None:
    for names in (["y(:,1)", "y(:,2)", "u"], ["u[:,0]", "y[:,0]", "y[:,1]"]):
        found = proposed(QC, names)
        outputs = [name for name in names if name[0] == "y"]
        assert [found["q_m"], found["q_c"]] == outputs and found["Gamma_m"][0] == "u"  # type: ignore[index]
    # as many as the model has, or none
    assert set(proposed(QC, ["y(:,1)", "y(:,2)", "y(:,3)"]).values()) == {None}
    # what has a name is found by it
    assert proposed(QC, ["y(:,1)", "q_m", "q_c", "u"])["q_m"] == "q_m"


def test_what_never_changes_gives_way_to_what_does() -> None:
    names = ("/joints.position[elbow]", "/joints.position[gripper]", "/second.angle", "/joints.effort[elbow]")
    source = Source(Path("a.bag"), names, lambda asked: {})
    found = {entry.key: entry.column for entry in propose(source, QC, still=["/joints.position[gripper]"])}
    assert {found["q_m"], found["q_c"]} == {"/joints.position[elbow]", "/second.angle"}
    found = {entry.key: entry.column for entry in propose(source, QC)}
    assert "/second.angle" not in found.values()


@pytest.mark.parametrize(
    ("columns", "units"),
    [
        (("Motorlageistwert", "Lastposition", "Motorstrom"), {"Motorstrom": "A"}),
        (("Motorwinkel", "Lastwinkel", "Istdrehmoment"), {"Istdrehmoment": "Nm"}),
        (("motorangle", "loadangle", "motortorque"), {}),
    ],
)
def test_compounds_are_taken_apart(columns: tuple[str, ...], units: dict[str, str]) -> None:
    others = ("Zeit", "Anlage", "Motordrehzahl", "Lastbeschleunigung", "Drehzahlsollwert")
    found = proposed(QC, (*others, *columns), units)
    assert tuple(found[key] for key in ("q_m", "q_c", "Gamma_m")) == columns


def test_words_of_a_body_that_the_model_lacks_are_no_other_body() -> None:
    assert proposed(THREE, ["t", "carriage", "q_b", "q_c", "Gamma_a"], {"carriage": "deg"})["q_a"] is None
    single = model_from_module(emps_rigid_qm)
    assert proposed(single, ["t", "carriage", "force"], {"carriage": "mm"})["q_m"] == "carriage"
