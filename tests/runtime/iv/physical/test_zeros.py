"""Zeros of encoders on both sides of a body that no sensor sees: estimated with the physical parameters."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.runtime.identification.identify import identify
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.simulate import simulate
from tests.runtime.iv.physical.test_composite_iv import model_of
from tests.runtime.rows.test_dropped_friction import THREE

# friction at the motor only: what the others do not have, no direction has to be known of
CHAIN = THREE
for body in "cl":
    CHAIN = CHAIN.replace(f', viscous = "F_v{body}", coulomb = "F_s{body}"', "")
TRUTH = {
    "J_m": 2e-3, "F_vm": 0.02, "F_sm": 0.4, "J_c": 1e-3, "J_l": 4e-3, "K_1": 2500.0, "D_1": 0.5,
    "K_2": 1800.0, "D_2": 0.4,
}  # fmt: skip
NOISE = {"q_m": 1e-6, "q_l": 1e-6, "T": 2e-3}


def model() -> Model:
    return model_of(CHAIN, "ends")


def records(zeros: tuple[float, ...]) -> list[Record]:
    found = []
    for seed, (motion, zero) in enumerate(zip(("chirp", "trapezoid"), zeros, strict=True)):
        record = simulate(model(), TRUTH, motion, fs=5000.0, duration_s=2.0, noise=NOISE, seed=seed).record
        found.append(record.edited({"q_l": record.signals["q_l"] + zero}))
    return found


@pytest.mark.slow
@pytest.mark.parametrize("zeros", [(0.5, 0.5), (-30.0, 2.0)])
def test_zeros_beside_an_unseen_body_are_estimated_with_the_parameters(zeros: tuple[float, ...]) -> None:
    estimate, right = identify(model(), records(zeros)), identify(model(), records((0.0, 0.0)))
    wanted = {one.name: one for one in right.parameters.physical}
    found = {one.name: one for one in estimate.parameters.physical}
    assert set(found) == set(TRUTH)
    for name, one in found.items():
        assert abs(one.value - TRUTH[name]) < 3.5 * one.std
        # with zeros the cut-off stays where it is, and another one would tell more: of noise, and of whether
        # the force bends at its samples, which the intervals hold besides
        assert one.noise_std < 5.0 * wanted[name].noise_std
        assert one.std < 2.0 * one.noise_std
    said = [one.what for one in estimate.checks.advice if "zero of its own" in one.what]
    assert len(said) == 2
    sizes = [float(what.split("(")[1].split(")")[0]) for what in said]
    assert np.allclose(sizes, zeros, rtol=1e-2, atol=1e-3)
