"""Proposed columns: names as people write them, torques named T, what was measured before its set point."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest

from generated import emps300_qm_ac, emps300_qm_qc, three_mass_qa_qb_qc
from modelgen.runtime.files.source import Source
from modelgen.runtime.model.model import Model, model_from_module
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
