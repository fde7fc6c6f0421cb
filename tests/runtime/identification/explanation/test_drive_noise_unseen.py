"""Noise of a force where a body is not seen: rows differentiate the force, and columns hold it."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.array_types import FloatArray
from modelgen.cli.candidates import spec_model
from modelgen.runtime.identification.explanation import less_driven
from modelgen.runtime.identification.explanation.drive_noise import DriveBias, drive_bias
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.options import values_of
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.records.record import Record
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.simulation.simulate import simulate
from modelgen.spec.load import parse_spec
from tests.runtime.iv.shapes.chains import FURTHER, TWO

BOTH_ENDS = """
[sensors.s]
q_m = { body = "m", measures = "position" }
q_x = { body = "x", measures = "position" }
"""
MODEL = spec_model(parse_spec(TWO + FURTHER + BOTH_ENDS, "three.toml"), "s")
TRUTH = {
    "J_m": 1e-3, "F_vm": 0.0167, "F_sm": 0.44, "J_c": 2e-3, "K": 400.0, "D": 0.08,
    "J_x": 1.2e-3, "K_x": 17.0, "D_x": 0.013,
}  # fmt: skip
NOISE = {"q_m": 1e-6, "q_x": 1e-6}
FORCE_NOISE = 0.2


def values(estimate: Estimate) -> tuple[FloatArray, FloatArray]:
    """Return the physical parameters and their standard deviations, in SI, in the model's order."""
    found = {one.name: (one.value, one.std) for one in estimate.parameters.physical}
    value, std = np.transpose([found[name] for name in MODEL.parameters])
    return value, std


@pytest.mark.slow
def test_what_noise_of_a_force_moves_in_physical_parameters_is_predicted_and_taken_off(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    records = [
        simulate(MODEL, TRUTH, kind, fs=1000.0, duration_s=4.0, noise=NOISE, seed=3).record
        for kind in ("chirp", "trapezoid")
    ]
    noise = [FORCE_NOISE * np.random.default_rng(k).standard_normal(one.n) for k, one in enumerate(records)]
    predicted: list[DriveBias] = []

    def kept(job: Job, fit: Fit) -> DriveBias:
        predicted.append(drive_bias(job, fit))
        return predicted[-1]

    monkeypatch.setattr(less_driven, "drive_bias", kept)

    def at(sign: float) -> Estimate:
        moved = [
            Record(dict(one.signals) | {"T": one.signals["T"] + sign * own}, one.fs, one.name)
            for one, own in zip(records, noise, strict=True)
        ]
        return identify(MODEL, moved, **values_of("iv", cutoff_hz=160.0, drift_check=False))

    # what noise does to an estimate in first order has the sign of the noise; the rest is the shift
    plain, up, down = (at(sign) for sign in (0.0, 1.0, -1.0))
    assert "which is taken off" in up.summary()
    (more, deviations), (less, _), (clean, _) = values(up), values(down), values(plain)
    left = 0.5 * (more + less) - clean
    shift = predicted[-1].carried
    assert shift is not None
    taken = shift[: len(left)] / deviations
    assert np.sum(np.abs(taken) > 1.0) >= 3
    assert np.all(np.abs(left / deviations) < 0.5)
    assert np.linalg.norm(left / deviations) < 0.3 * np.linalg.norm(taken)
