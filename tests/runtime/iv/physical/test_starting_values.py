"""A body that steps leave nothing of is no body that the records know, where a sensor shows it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from generated import emps300_qm_qc
from modelgen.array_types import FloatArray
from modelgen.errors import IdentifiabilityError
from modelgen.runtime.iv.physical.starting_values import refuse_emptied, vanished_names
from modelgen.runtime.model.model import model_from_module

MODEL = model_from_module(emps300_qm_qc)
START = np.array([MODEL.parameter_sets["table_2"][name] for name in MODEL.parameters])
FIT = SimpleNamespace(blocks=(), columns=(), solution=SimpleNamespace(x=np.zeros(0)))
LOST = ("J_c", "K", "F_vmc")


def _without_load(values: FloatArray, share: float = 1e-4) -> FloatArray:
    return np.where(np.isin(MODEL.parameters, LOST), share, 1.0) * values


def test_a_sensed_body_that_steps_leave_nothing_of_is_refused() -> None:
    with pytest.raises(IdentifiabilityError, match="all parameters of c go to zero"):
        refuse_emptied(MODEL, START, _without_load(START), LOST, FIT)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("first", "last", "lost"),
    [
        pytest.param(START, START, LOST, id="hardly known, but not gone"),
        pytest.param(START, _without_load(START), (), id="known to be small"),
        pytest.param(_without_load(START), _without_load(START, 1e-5), LOST, id="small from the start"),
    ],
)
def test_small_bodies_and_uncertain_ones_are_left_to_their_intervals(
    first: FloatArray, last: FloatArray, lost: tuple[str, ...]
) -> None:
    refuse_emptied(MODEL, first, last, lost, FIT)  # type: ignore[arg-type]


def test_a_body_without_a_sensor_is_lost_alone() -> None:
    blind = replace(MODEL, sensors=tuple(one for one in MODEL.sensors if one.body != "c"))
    refuse_emptied(blind, START, _without_load(START), LOST, FIT)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "share", "gone"),
    [
        pytest.param("F_vmc", -0.5, (), id="a light damping is below zero by chance"),
        pytest.param("K", -0.5, ("J_c", "F_vmc", "K"), id="what no stiffness holds does not move along"),
        pytest.param("J_c", 1e-9, ("J_c", "F_vmc", "K"), id="a link goes with its body"),
    ],
)
def test_what_vanished_is_no_chain_that_the_records_know(
    name: str, share: float, gone: tuple[str, ...]
) -> None:
    """Starts went on being tried for a damping of -1 +- 3 of one of three masses, for half a minute."""
    values = dict(zip(MODEL.parameters, START.tolist(), strict=True))
    assert set(vanished_names(MODEL, {**values, name: share * values[name]})) == set(gone)
