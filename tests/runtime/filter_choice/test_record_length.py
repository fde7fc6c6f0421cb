"""Cut-offs whose filters would leave nothing of a record."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.filter_choice.record_length import (
    decimation_for,
    end_samples,
    fitting_cutoff,
    samples_needed,
)
from modelgen.runtime.identification.identify import identify
from tests.runtime.rigid_motion import RIGID, TRUTH, rigid_record, swings


def test_a_cutoff_that_fits_stays_and_one_that_does_not_leaves_half_of_the_record() -> None:
    record = rigid_record(swings((0.3, 0.3)), noise=1e-7)
    assert fitting_cutoff(RIGID, [record], 20.0, 4) == (20.0, [])
    for low in (0.2, 0.1):
        cutoff, (said,) = fitting_cutoff(RIGID, [record], low, 4)
        factor = decimation_for(record.fs, cutoff)
        needed = samples_needed(RIGID, 4, cutoff, record.fs, factor)
        assert needed == pytest.approx(0.5 * record.n, rel=0.02)
        assert f"Cut-off {cutoff:.4g} Hz in place of {low:.4g} Hz" in said and record.name in said


def test_a_short_record_of_slow_motion_is_identified_by_default() -> None:
    slow = rigid_record(swings((0.2, 0.25), (0.05, 0.6)), noise=1e-7)
    cutoff = choose_filter(RIGID, [slow]).cutoff_hz
    n = int(2.0 * end_samples(RIGID, 4, cutoff, slow.fs))
    short = slow.part(0, n, "short")
    found = identify(RIGID, [short])
    assert any("half of them are left" in one for one in choose_filter(RIGID, [short]).sentences)
    for entry in found.parameters.physical:
        assert np.isfinite(entry.std)
        assert abs(entry.value - TRUTH[entry.name]) < 4.0 * entry.std
