"""Rows rebuilt from an estimate, where channels of the model are sums of those of the record."""

from __future__ import annotations

import numpy as np
import pytest

import modelgen
from modelgen.runtime.curves.rebuilt import rebuild
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
