"""What filters make of a channel is made once for all records that hold the same samples of it."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.runtime.records.channels import Edit
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.chunk import made_once

RECORD = Record({"q": np.arange(50.0), "f": np.ones(50)}, 100.0)


def test_an_edited_record_shares_what_was_made_of_the_channels_that_are_the_same() -> None:
    record = Record(RECORD.signals, RECORD.fs)
    of_q, of_f = (made_once(record, key, "how", lambda: np.zeros(3)) for key in ("q", "f"))
    edited = record.edited({"f": Edit("f", lambda samples, _: 2.0 * samples), "g": np.ones(50)})
    assert made_once(edited, "q", "how", lambda: np.ones(3)) is of_q
    assert made_once(edited, "q", "otherwise", lambda: np.ones(3))[0] == 1.0
    for key in ("f", "g"):
        found = made_once(edited, key, "how", lambda: np.ones(3))
        assert found is not of_f
        assert found[0] == 1.0
    # what is made later of the same samples is shared as well
    later = made_once(edited, "q", "later", lambda: np.ones(3))
    assert made_once(record, "q", "later", lambda: np.zeros(3)) is later
    # so is what is known of the samples
    assert edited.facts.spectrum("q") is record.facts.spectrum("q")
    assert edited.facts.extent("f").peak == 2.0 * record.facts.extent("f").peak
    record.facts.forget_filtered()
    assert made_once(edited, "q", "how", lambda: np.ones(3)) is not of_q


def test_records_that_are_read_in_stretches_or_are_long_keep_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    stretched = Record.over(RECORD)
    first = made_once(stretched, "q", "how", lambda: np.zeros(3))
    assert made_once(stretched, "q", "how", lambda: np.zeros(3)) is not first
    monkeypatch.setattr("modelgen.runtime.rows.chunk.MOST_FILTERED", 49)
    first = made_once(RECORD, "q", "how", lambda: np.zeros(3))
    assert made_once(RECORD, "q", "how", lambda: np.zeros(3)) is not first
