"""Directions of speeds that rows give: behind their low-pass noise reverses nothing."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.runtime.filters.butterworth import butterworth
from modelgen.runtime.filters.fused_operator import fused_operator
from modelgen.runtime.model.arm_channels import Speed
from modelgen.runtime.model.given_directions import given_directions, mean_sign, sign_between

FS = 1000.0


def test_noise_of_a_given_speed_reverses_nothing_behind_the_low_pass() -> None:
    t = np.arange(4000) / FS
    true = np.sin(2.0 * np.pi * 2.0 * t + 0.3)
    speed = true + 0.1 * np.random.default_rng(1).standard_normal(len(t))
    operator = fused_operator(butterworth(4, 10.0, FS), FS)
    one = Speed("1", "d1_qm_1", ((1.0, "d1_qm_1"),))
    wrong = []
    for low_pass in (None, lambda samples: operator.apply(samples, 0, len(samples))[:, 0]):
        ways, _ = given_directions((one,), {"d1_qm_1": speed}, {"d1_qm_1"}, True, low_pass)
        wrong.append(np.count_nonzero(ways["sign 1"][500:-500] != np.sign(true[500:-500])))
        np.testing.assert_array_equal(ways["forward d1_qm_1"], (ways["sign 1"] > 0.0) * speed)
    assert wrong[0] > 50 and wrong[1] < 15


@pytest.mark.parametrize("harmonic", [1, 9, 17])
def test_a_sign_between_samples_is_a_step_to_a_low_pass(harmonic: int) -> None:
    """A square wave that reverses anywhere between samples has the lines of one in continuous time."""
    period, periods = 100.37, 1000
    n = round(period * periods)
    speed = np.sin(2.0 * np.pi * (np.arange(n) + 0.37) / period)
    exact = 2.0 / (np.pi * harmonic)
    found, mean = (
        abs(np.fft.rfft(one)[harmonic * periods]) / n / exact - 1.0
        for one in (sign_between(speed), mean_sign(speed)[0])
    )
    assert abs(found) < 6e-3
    assert abs(found) < 0.15 * abs(mean)
