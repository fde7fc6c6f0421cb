"""Delays that are given: only what leaves most of a record."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.errors import DataError
from modelgen.runtime.least_squares.known_delays import aligned
from modelgen.runtime.records.record import Record
from tests.runtime.two_mass_records import SMALL


def record_of(seconds: float) -> Record:
    samples = np.sin(np.arange(round(seconds * 1000.0)) / 50.0)
    return Record(dict.fromkeys(SMALL.channels, samples), 1000.0, f"of {seconds:g} s")


@pytest.mark.parametrize("late", [0.6, -1.0])
def test_a_delay_that_leaves_little_of_a_record_is_named_with_the_largest_that_does_not(late: float) -> None:
    records = [record_of(8.0), record_of(2.0)]
    words = rf"Gamma_m: is {late:g} s late, and of 2 s is 2 s long; give s, .* 0\.5 at most"
    with pytest.raises(DataError, match=words):
        aligned(SMALL, records, {"Gamma_m": late}, (), by_default=True)
    known, wanted = aligned(SMALL, records, {"Gamma_m": 0.49}, (), by_default=True)
    assert (len(known), wanted) == (2, ())
