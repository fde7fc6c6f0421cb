"""A record is checked once, whole, and cannot change afterwards."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from generated import emps_rigid_qm
from modelgen.errors import DataError, ModelgenError
from modelgen.runtime.records.record import Record

RAMP = np.arange(5.0)


def complaint(signals: Any, fs: Any = 1000.0, **labels: Any) -> str:
    with pytest.raises(DataError) as caught:
        Record(signals, fs, **labels)
    assert len(caught.value.problems) == 1, str(caught.value)
    return str(caught.value)


def test_sizes() -> None:
    record = Record({"q_m": RAMP, "Gamma_m": -RAMP}, 500, name="chirp", tag="chirp")
    assert (record.n, record.dt, record.duration_s) == (5, 0.002, 0.01)
    assert type(record.fs) is float
    assert repr(record) == "Record(name='chirp', tag='chirp', fs=500.0, n=5, channels=['q_m', 'Gamma_m'])"


@given(arrays(np.float32, (2, 9), elements=st.floats(-1e6, 1e6, width=32)))
def test_signals_are_read_only_copies(readings: np.ndarray[Any, Any]) -> None:
    given_values = readings.copy()
    source = {"q_m": readings[0, ::2], "a_c": readings[1, ::-2]}
    record = Record(source, 1000.0)
    readings[:] = 7.0
    source["q_m"] = readings[0]
    np.testing.assert_array_equal(record.signals["q_m"], given_values[0, ::2])
    np.testing.assert_array_equal(record.signals["a_c"], given_values[1, ::-2])
    for values in record.signals.values():
        assert values.dtype == np.float64
        assert values.flags.c_contiguous
        assert not values.flags.writeable
    with pytest.raises(TypeError):
        record.signals["q_m"] = RAMP  # type: ignore[index]


def test_integers_and_lists_are_numbers() -> None:
    record = Record({"q_m": [1, 2, 3], "Gamma_m": np.array([1, 2, 3], dtype=np.uint16)}, np.float32(50.0))
    np.testing.assert_array_equal(record.signals["q_m"], record.signals["Gamma_m"])


@pytest.mark.parametrize("fs", [0.0, -1.0, float("nan"), float("inf"), "1000", None, True, 1j, [1000.0]])
def test_fs_must_be_a_positive_number(fs: Any) -> None:
    assert "give a frequency from 1e-09 to 1e+09 Hz" in complaint({"q_m": RAMP}, fs)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (np.array([1.0, None]), "has data type object"),
        (RAMP.astype(complex), "has data type complex128"),
        (RAMP > 1.0, "has data type bool"),
        (["1", "2"], "has data type <U1"),
        (RAMP[:, None], "has shape (5, 1)"),
        (np.float64(3.0), "has shape ()"),
        ([[1.0], [1.0, 2.0]], "is no rectangular array"),
        (RAMP[:1], "has 1 sample(s)"),
        (RAMP[:0], "has 0 sample(s)"),
        ([0.0, np.nan, 0.0, np.inf], "sample 1: is nan (2 of 4 samples are not finite)"),
        (np.ma.masked_greater(RAMP, 2.5), "sample 3: is masked (2 of 5 samples are not finite)"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_a_bad_channel_is_named(values: Any, words: str) -> None:
    message = complaint({"q_m": values}, name="run 1")
    assert message.startswith("run 1")
    assert words in message


def test_lengths_must_agree() -> None:
    message = complaint({"q_m": RAMP, "a_c": RAMP[:-1]})
    assert "channels differ in length: q_m 5, a_c 4" in message


def test_there_must_be_channels_and_labels() -> None:
    assert "has no channels" in complaint({})
    assert "has no channels" in complaint([RAMP])
    assert "key is 3" in complaint({3: RAMP})
    assert "name is ''" in complaint({"q_m": RAMP}, name="")
    assert "tag is 7" in complaint({"q_m": RAMP}, tag=7)


def test_every_mistake_is_reported_at_once() -> None:
    with pytest.raises(DataError) as caught:
        Record({"q_m": [0.0, np.nan], "a_c": RAMP > 1.0, "Gamma_m": RAMP}, -1.0)
    assert [problem.where for problem in caught.value.problems] == [
        "record: fs",
        "record: channel q_m, sample 1",
        "record: channel a_c",
        "record",
    ]


def test_select() -> None:
    record = Record({"q_m": RAMP, "a_c": 2 * RAMP, "Gamma_m": 3 * RAMP}, 1000.0, name="run", tag="chirp")
    part = record.select(["Gamma_m", "q_m"])
    assert list(part.signals) == ["Gamma_m", "q_m"]
    assert (part.fs, part.name, part.tag) == (1000.0, "run", "chirp")
    with pytest.raises(DataError, match="has no channel Gama_m; did you mean Gamma_m") as caught:
        record.select(["q_m", "Gama_m", "x"])
    assert len(caught.value.problems) == 2


def test_equality() -> None:
    record = Record({"q_m": RAMP}, 1000.0)
    assert record == Record({"q_m": list(RAMP)}, 1000)
    assert record != Record({"q_m": RAMP + 1e-15}, 1000.0)
    assert record != Record({"q_m": RAMP}, 1001.0)
    assert record != Record({"q_c": RAMP}, 1000.0)
    assert record != Record({"q_m": RAMP}, 1000.0, tag="chirp")
    assert record != "record"


def test_a_record_can_be_sent_and_copied() -> None:
    record = Record({"q_m": RAMP, "a_c": -RAMP}, 1000.0, name="run", tag="chirp")
    assert pickle.loads(pickle.dumps(record)) == record
    assert copy.deepcopy(record) == record


def test_ten_samples_are_a_record_but_no_experiment() -> None:
    samples = np.linspace(0.0, 1.0, 10) ** 2
    keys = [signal["sensor"] or signal["actuator"] for signal in emps_rigid_qm.SIGNALS]
    record = Record(dict.fromkeys(keys, samples), fs=100.0, name="short")
    with pytest.raises(ModelgenError, match=r"short|records"):
        emps_rigid_qm.identify([record])
    assert np.array_equal(samples, np.linspace(0.0, 1.0, 10) ** 2)
