"""Any finite samples are examined without an error or a warning of NumPy's, and are left as they were."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from generated import emps300_qm_ac
from modelgen.runtime.diagnostics.suspicious_samples import suspicions
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.records.record import Record
from tests.fuzz.test_specs import FUZZ

MODEL = model_from_module(emps300_qm_ac)
NUMBER = (
    st.sampled_from([0.0, 1.0, -1.0, 1e-300, 5e-324, 1e308, -1e308])
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.integers(-3, 3).map(float)
)


@st.composite
def channels(draw: st.DrawFn) -> dict[str, npt.NDArray[np.float64]]:
    n = draw(st.integers(2, 40))
    return {key: draw(arrays.arrays(np.float64, n, elements=NUMBER)) for key in MODEL.channels}


@FUZZ
@given(channels())
def test_any_samples(signals: dict[str, npt.NDArray[np.float64]]) -> None:
    record = Record(signals, 1000.0, "fuzz")
    for advice in suspicions(MODEL, [record]):
        assert advice.where.startswith("fuzz, ")
        assert advice.sentence.isprintable()
    assert all(np.array_equal(record.signals[key], signals[key]) for key in signals)
