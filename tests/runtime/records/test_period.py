"""The lag after which a record repeats itself, of short records and of long ones."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.runtime.records import period
from modelgen.runtime.records.period import first_lag
from modelgen.runtime.records.record import Record

RNG = np.random.default_rng(11)


def repeated(lag: int, n: int) -> Record:
    """A force that repeats itself, with a little noise."""
    smooth = np.convolve(RNG.standard_normal(3 * lag), np.ones(20) / 20.0, "same")[:lag]
    return Record({"F": np.resize(smooth, n) + 0.005 * RNG.standard_normal(n)}, 1000.0, "run")


@pytest.mark.parametrize("lag", [301, 523, 1000])
@pytest.mark.parametrize("whole", [1 << 18, 3000, 1000], ids=["short", "long", "very long"])
def test_a_lag_is_found_to_the_sample(monkeypatch: pytest.MonkeyPatch, lag: int, whole: int) -> None:
    monkeypatch.setattr(period, "WHOLE", whole)
    record = repeated(lag, 5000)
    found = first_lag(record, "F", float(np.mean(record.signals["F"])))
    # means of neighbours repeat themselves after a multiple of what is no multiple of theirs
    assert found is not None and found % lag == 0
    assert found == lag or whole < record.n


@pytest.mark.parametrize("lag", [1240, 1249, 1260, 2000])
def test_longer_lags_than_a_quarter_of_the_record_are_none(lag: int) -> None:
    # the last parts of the record come round and meet its first ones where a transform is too short
    record = repeated(lag, 5000)
    found = first_lag(record, "F", float(np.mean(record.signals["F"])))
    assert found == (lag if 4 * lag < 5000 else None)
