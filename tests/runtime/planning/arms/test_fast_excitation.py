"""The fast stage of an elastic arm's excitation: about its modes, within limits, from rest to rest."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from modelgen.cli.arms.design_arm import planned_joints
from modelgen.cli.arms.simulate_arm import arm_model
from modelgen.errors import DataError
from modelgen.runtime.model.model import Model
from modelgen.runtime.planning.arms.fast_excitation import FastExcitation, fast_excitation
from modelgen.runtime.planning.arms.workspace import Box, PlannedJoint
from tests.runtime.made_arm_records import catalogued

POSTURE = np.array([0.2, 0.8])


@cache
def arm() -> tuple[Model, dict[str, float], tuple[PlannedJoint, ...]]:
    spec = catalogued("elastic_two_link")
    limited = (replace(joint, position_limits=(-2.0, 2.0), speed_limit=3.0) for joint in spec.joints)
    spec = replace(spec, joints=tuple(limited))
    model = arm_model(spec)
    return model, dict(model.parameter_sets["nominal"]), tuple(planned_joints(spec))


def found(period_s: float = 5.0, boxes: tuple[Box, ...] = ()) -> FastExcitation:
    model, values, joints = arm()
    return fast_excitation(model, values, joints, POSTURE, period_s, boxes)


def test_it_moves_about_the_modes_from_rest_to_rest_within_the_limits() -> None:
    fast = found()
    q, v, a = fast.trajectory.at(np.linspace(0.0, 5.0, 20_001))
    assert np.abs(v[:, [0, -1]]).max() < 1e-9 and np.abs(a[:, [0, -1]]).max() < 1e-7
    assert np.abs(v).max() < 3.0 and np.abs(v).max(axis=1).min() > 1.5
    assert np.abs(q - POSTURE[:, None]).max() < 0.05 * 4.0
    # held motors: 5.9 to 6.7 Hz and 16 to 24 Hz over the workspace
    low, high = fast.band_hz
    assert 2.5 < low < 3.5 and 18.0 < high < 30.0
    spectra = np.abs(np.fft.rfft(q[:, :-1], axis=1))[:, 1:]
    lines = spectra > 1e-6 * spectra.max()
    hertz = np.arange(1, lines.shape[1] + 1) / 5.0
    assert not (lines[0] & lines[1]).any()  # each joint has harmonics of its own
    assert all(low <= hertz[one].min() and hertz[one].max() <= high for one in lines)


@pytest.mark.slow
def test_boxes_make_it_smaller() -> None:
    at = 0.5 * np.sin(POSTURE[0])  # where the second joint stands
    narrow = found(boxes=(Box("2", (-1.0, -1.0, at - 0.01), (1.0, 1.0, at + 0.01)),))
    assert narrow.bounds.speed.max() < 0.6 * found().bounds.speed.max()
    with pytest.raises(DataError, match="no room"):
        found(boxes=(Box("2", (-1.0, -1.0, at + 0.01), (1.0, 1.0, 1.0)),))


@pytest.mark.parametrize(("period_s", "what"), [(0.2, "or more"), (500.0, "at most")])
def test_periods_that_do_not_fit_are_told(period_s: float, what: str) -> None:
    with pytest.raises(DataError, match=what):
        found(period_s)
