"""Rows rebuilt from an estimate, where channels of the model are sums of those of the record."""

from __future__ import annotations

import numpy as np
import pytest

import modelgen
from modelgen.runtime.curves.rebuilt import rebuild
from tests.runtime.identification.test_elastic_arms import QUICK, made, noisy
from tests.runtime.made_arm_records import model_of, record_of, values_of, written

ARM = """
[arm]
name = "two"
gravity = [0, -9.81, 0]
[[joints]]
name = "1"
[[joints]]
name = "2"
d = 0.4
gear = 10
[[couplings]]
motor = "2"
joint = "1"
ratio = 10
[payload.tool]
"""


def test_motors_that_move_two_joints_and_payloads_are_rebuilt_as_they_were_identified() -> None:
    model = model_of(written(ARM))
    record = record_of(model, values_of(model), 10.0, 1)
    bare = {key: line for key, line in record.signals.items() if key not in (*model.derived, *model.loads)}
    record = modelgen.Record(bare, record.fs, "run")
    estimate = modelgen.identify(model, record, "wls", checks=modelgen.CheckOptions(tests=False))
    rows, _ = rebuild(model, [record], estimate)
    for row, entry in zip(rows, estimate.fit.rows, strict=True):
        left = row.residual[np.isfinite(row.residual)]
        assert float(np.sqrt(np.mean(left**2))) == pytest.approx(entry.residual_rms, rel=1e-6)


@pytest.mark.parametrize(
    ("case", "left"),
    [
        pytest.param("motors alone", 4, marks=pytest.mark.slow),
        pytest.param("links alone", 4, marks=pytest.mark.slow),
        pytest.param("motors alone, gears", 2, marks=pytest.mark.slow),
        ("torques at links", 2),
    ],
)
def test_rows_that_springs_place_are_rebuilt_about_the_estimate(
    case: str, left: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With all numbers; where a stiffness has none; without rows for which no deflection was found."""
    model, record, _ = made(case)
    record = noisy(model, record, 1)
    if case == "torques at links":
        monkeypatch.setattr("modelgen.runtime.identification.elastic.rest.MOST_STEPS", 0)
    estimate = modelgen.identify(model, record, "wls", checks=QUICK)
    assert sum(name[0] in "KD" for name in estimate.params) <= left
    rows, _ = rebuild(model, [record], estimate)
    assert len(rows) == len(estimate.fit.rows)
    for row, entry in zip(rows, estimate.fit.rows, strict=True):
        rest = row.residual[np.isfinite(row.residual)]
        assert float(np.sqrt(np.mean(rest**2))) == pytest.approx(entry.residual_rms, rel=0.01)
