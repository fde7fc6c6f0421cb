"""Effects estimated from the start on, of motion in which every sample feels a reversal."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter

from modelgen.array_types import FloatArray
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.records.record import Record
from tests.runtime.identification.explanation.test_simulated_directions import PLACES, servo
from tests.runtime.iv.physical.swinging_servo import FS, TRUTH, swung

NOISE = {"q_m": 1e-6, "q_l": 1e-6}


def lagging(samples: FloatArray, samples_late: float) -> FloatArray:
    """Return samples behind a first-order low-pass, exact for what is straight between them, shape (n,)."""
    over, under, _ = cont2discrete(([1.0], [samples_late, 1.0]), 1.0, "foh")
    return np.asarray(lfilter(over.ravel(), under, samples - samples[0]) + samples[0])


@pytest.mark.slow
@pytest.mark.parametrize("samples_late", [1.5, 2.5])
def test_directions_are_simulated_of_records_whose_low_pass_is_undone(samples_late: float) -> None:
    clean = swung(servo(), TRUTH, PLACES, 5)
    rng = np.random.default_rng(7)
    read = {**clean.signals, "q_l": lagging(clean.signals["q_l"], samples_late)}
    noise = {**NOISE, "T": 0.01 * float(np.std(clean.signals["T"]))}
    read = {key: read[key] + level * rng.standard_normal(clean.n) for key, level in noise.items()}
    found = identify(servo(), Record(read, FS, "swing"))
    assert any("q_l is read through a low-pass" in one.what for one in found.checks.advice)
    for entry in found.parameters.physical:
        assert abs(entry.value - TRUTH[entry.name]) < 3.0 * entry.std
    # with directions of the low-passed reading: F_sm to 57 %, K to 1.3 and 3 %
    spread = {entry.name: entry.std / TRUTH[entry.name] for entry in found.parameters.physical}
    assert spread["F_sm"] < 0.05
    assert spread["K"] < 0.002
