"""Noise of a measured force pulls instruments that this force drives, as predicted, and is taken off."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.errors import DataError
from modelgen.runtime.identification.explanation import drive_noise, less_driven
from modelgen.runtime.identification.explanation.drive_noise import DriveBias, drive_bias
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.job import Job
from modelgen.runtime.least_squares.fit import Fit
from tests.runtime.rigid_motion import RIGID, TRUTH, rigid_record, swings

MOTION = swings((0.02, 1.3), (0.004, 4.1), (0.0005, 23.0))


@pytest.mark.slow
def test_what_noise_of_a_force_moves_is_predicted_and_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    # an exact encoder, and as much noise in the force as a poor current sensor has
    quiet = rigid_record(MOTION, n=8_000)
    size = 0.2 * float(np.std(quiet.signals["F"]))
    record = rigid_record(MOTION, n=8_000, force_noise=size)
    estimate = identify(RIGID, record)
    assert estimate.bse["M"] < 0.01 * TRUTH["M"]
    assert all(abs(value - TRUTH[name]) < 3.0 * estimate.bse[name] for name, value in estimate.params.items())
    assert "noise of the forces biases instruments" in estimate.summary()

    predicted: dict[str, float] = {}

    def kept(job: Job, fit: Fit) -> DriveBias:
        bias = drive_bias(job, fit)
        predicted.update(zip(fit.columns, bias.shift.tolist(), strict=True))
        return bias

    monkeypatch.setattr(less_driven, "drive_bias", kept)
    iv = identify(RIGID, record, method="iv")
    driven = iv.params["M"] + predicted["M"] - estimate.params["M"]
    assert driven > 2.0 * estimate.bse["M"]
    assert 0.5 < driven / predicted["M"] < 2.0


@pytest.mark.slow
def test_where_encoders_are_noisy_as_well_it_is_taken_off_instruments() -> None:
    # of one motion: ten draws of the noise
    found = [
        identify(RIGID, rigid_record(MOTION, n=8_000, force_noise=10.0, noise=1e-6, seed=seed), method="iv")
        for seed in range(10)
    ]
    assert all("which is taken off" in one.summary() for one in found)
    off = np.array([one.params["M"] - TRUTH["M"] for one in found])
    assert abs(off.mean()) < 0.7 * found[0].bse["M"]
    assert np.sum(np.abs(off) < 2.0 * found[0].bse["M"]) >= 8


def test_where_it_is_not_known_well_intervals_hold_it(monkeypatch: pytest.MonkeyPatch) -> None:
    record = rigid_record(MOTION, n=8_000, force_noise=10.0, noise=1e-6)
    less = identify(RIGID, record, method="iv")
    monkeypatch.setattr(less_driven, "MOST_DRIVEN", 0.0)
    wider = identify(RIGID, record, method="iv")
    shift = wider.params["M"] - less.params["M"]
    assert shift > less.bse["M"]
    assert "the intervals are widened by that" in wider.summary()
    assert wider.bse["M"] == pytest.approx(np.hypot(less.bse["M"], shift), rel=0.1)


def test_the_default_leaves_what_hardly_matters(monkeypatch: pytest.MonkeyPatch) -> None:
    record = rigid_record(MOTION, n=8_000, force_noise=0.5, noise=2e-5)
    plain = identify(RIGID, record)
    assert "noise of the forces" not in plain.summary()
    monkeypatch.setattr(less_driven, "drive_bias", _fails)
    assert identify(RIGID, record).params == plain.params


def _fails(*_: object) -> None:
    raise DataError.at("noise", "is too short", "give longer records")


def test_what_is_not_known_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    record = rigid_record(MOTION, n=8_000, force_noise=10.0, noise=1e-6)
    monkeypatch.setattr(less_driven, "drive_bias", _fails)
    assert "noise of the forces" not in identify(RIGID, record).summary()


def test_few_draws_say_what_many_say(monkeypatch: pytest.MonkeyPatch) -> None:
    record = rigid_record(MOTION, n=8_000, force_noise=10.0, noise=1e-6)
    shifts = []

    def kept(job: Job, fit: Fit) -> DriveBias:
        for few in (1, 4):
            monkeypatch.setattr(drive_noise, "DRAWS", 4 * few)
            shifts.append(drive_bias(job, fit))
        return shifts[0]

    monkeypatch.setattr(less_driven, "drive_bias", kept)
    identify(RIGID, record, method="iv")
    few, many = (one.shift for one in shifts[:2])
    assert few == pytest.approx(many, rel=0.1)
    assert 0.0 < shifts[0].share < 0.1
