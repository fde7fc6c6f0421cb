"""Any finite samples are refused with their place, or examined without a warning, and left as they were."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from generated import emps300_qm_ac
from modelgen.errors import DataError
from modelgen.runtime.diagnostics.samples.suspicious_samples import suspicions
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.records.record import Record
from tests.fuzz.test_specs import FUZZ

MODEL = model_from_module(emps300_qm_ac)
WITHIN = (
    st.sampled_from([0.0, 1.0, -1.0, 1e-300, 5e-324, 1e30, -1e30])
    | st.floats(-1e30, 1e30)
    | st.integers(-3, 3).map(float)
)
ANY = WITHIN | st.sampled_from([1e308, -1e308]) | st.floats(allow_nan=False, allow_infinity=False)


@st.composite
def channels(draw: st.DrawFn) -> dict[str, npt.NDArray[np.float64]]:
    n, numbers = draw(st.integers(2, 40)), draw(st.sampled_from([WITHIN, ANY]))
    return {key: draw(arrays.arrays(np.float64, n, elements=numbers)) for key in MODEL.channels}


@pytest.mark.slow
@FUZZ
@given(channels())
def test_any_samples(signals: dict[str, npt.NDArray[np.float64]]) -> None:
    try:
        record = Record(signals, 1000.0, "fuzz")
    except DataError as error:
        assert all(problem.where.startswith("fuzz: channel ") for problem in error.problems)
        sizes = [np.abs(samples).max() for samples in signals.values()]
        assert max(sizes) > 1e30 or any(0.0 < size < 1e-100 for size in sizes)
        return
    for advice in suspicions(MODEL, [record]):
        assert advice.where.startswith("fuzz, ")
        assert advice.sentence.isprintable()
    assert all(np.array_equal(record.signals[key], signals[key]) for key in signals)
