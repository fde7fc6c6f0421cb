"""Noise of a measured force pulls instruments that this force drives, as predicted; and not the default."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.array_types import FloatArray
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.identification import default_method
from modelgen.runtime.identification.explanation.drive_noise import drive_bias
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from tests.runtime.rigid_motion import RIGID, TRUTH, rigid_record, swings

MOTION = swings((0.02, 1.3), (0.004, 4.1), (0.0005, 23.0))


@pytest.mark.slow
def test_what_noise_of_a_force_moves_is_predicted_and_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    # an exact encoder, and as much noise in the force as a poor current sensor has
    quiet = rigid_record(MOTION, n=8_000)
    size = 0.2 * float(np.std(quiet.signals["F"]))
    record = rigid_record(MOTION, n=8_000, force_noise=size)
    predicted: dict[str, float] = {}

    def kept(model: Model, records: tuple[Record, ...], choice: FilterChoice, fit: Fit) -> FloatArray:
        driven = drive_bias(model, records, choice, fit)
        predicted.update(zip(fit.columns, driven.tolist(), strict=True))
        return driven

    monkeypatch.setattr(default_method, "drive_bias", kept)
    estimate = identify(RIGID, record)
    assert estimate.bse["M"] < 0.01 * TRUTH["M"]
    assert all(abs(value - TRUTH[name]) < 3.0 * estimate.bse[name] for name, value in estimate.params.items())
    assert "noise of the forces biases instruments" in estimate.summary()
    driven = identify(RIGID, record, method="iv").params["M"] - estimate.params["M"]
    assert driven > 2.0 * estimate.bse["M"]
    assert 0.5 < driven / predicted["M"] < 2.0


def test_where_encoders_are_noisy_as_well_intervals_hold_what_it_moves(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    record = rigid_record(MOTION, n=8_000, force_noise=0.5, noise=2e-5)
    plain = identify(RIGID, record)
    assert "noise of the forces" not in plain.summary()
    monkeypatch.setattr(
        default_method, "drive_bias", lambda *_: 3.0 * np.array([plain.bse[n] for n in plain.params])
    )
    monkeypatch.setattr(default_method, "least_squares_instead", lambda *_: None)
    wider = identify(RIGID, record)
    assert wider.bse["M"] / plain.bse["M"] == pytest.approx(np.sqrt(10.0), rel=0.2)
