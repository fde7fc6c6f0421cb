"""What images of a held command add: against their sum, and taken off readings of a simulated chain."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.runtime.identification.explanation.commands.held_images import folded
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.methods import Auto
from modelgen.runtime.identification.options import CheckOptions
from modelgen.runtime.simulation.drive import Drive
from modelgen.runtime.simulation.simulate import simulate
from tests.runtime.two_mass_records import SMALL, TRUTH

FREQUENCY = np.array([0.02, 0.1, 0.2, 0.3])  # cycles a sample


@pytest.mark.parametrize("late", [0.0, 0.04, -0.3, -1.0])
@pytest.mark.parametrize("state", [0, 1, 2, 3])
def test_the_images_are_those_of_all_multiples_of_the_sampling_frequency(late: float, state: int) -> None:
    A = np.array([[0, 0, 1, 0], [0, 0, 0, 1], [-9e3, 9e3, -4.0, 3.0], [4e4, -4e4, 1.0, -2.0]], dtype=float)
    B, C, fs = np.array([0.0, 0.0, 5.0, 0.0]), np.eye(4)[state], 500.0
    n = np.arange(1.0, 3000.0)
    sums = []
    for f in FREQUENCY:
        image = f + np.concatenate([n, -n])
        s = 2j * np.pi * fs * image
        states = np.linalg.solve(s[:, None, None] * np.eye(4) - A, np.tile(B[:, None], (len(s), 1, 1)))
        sums.append(np.sum(states[..., 0] @ C * f / image * np.exp(2j * np.pi * late * image)))
    # what is beyond the last image is less than a thousandth
    np.testing.assert_allclose(folded(A, B, C, fs, late)(FREQUENCY), sums, rtol=1e-3)


def test_a_constant_command_has_no_images() -> None:
    found = folded(np.array([[0.0, 1.0], [0.0, -2.0]]), np.array([0.0, 1.0]), np.array([1.0, 0.0]), 100.0)
    assert found(np.array([0.0])) == 0.0


@pytest.mark.slow
def test_a_drive_sampled_slowly_has_the_true_stiffness() -> None:
    # not six samples a period of the mode: images of the command bend K by a tenth of a percent
    record = simulate(SMALL, TRUTH, "chirp", fs=700.0, duration_s=3.0, drive=Drive(rate_hz=700.0)).record
    estimate = identify(SMALL, record, Auto(held=("Gamma_m",)), checks=CheckOptions(tests=False))
    for name in ("J_m", "J_c", "K"):
        assert abs(estimate.params[name] / TRUTH[name] - 1.0) < 1e-4
