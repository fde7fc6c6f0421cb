"""Cut-offs whose filters would leave nothing of a record."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.errors import DataError
from modelgen.runtime.filter_choice.filter_choice import choose_filter, least_order
from modelgen.runtime.filter_choice.record_length import (
    decimation_for,
    end_samples,
    fitting_cutoff,
    samples_needed,
    shorter_ways,
)
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.records.record import Record
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


def needed_by(record: Record, cutoff_hz: float, factor: int, drop: int) -> int:
    edge = end_samples(RIGID, 4, cutoff_hz, record.fs)
    return max(0, drop - edge) + samples_needed(RIGID, 4, cutoff_hz, record.fs, factor)


@pytest.mark.parametrize(
    ("n", "cutoff_hz", "factor", "drop"),
    [
        (300, 2.0, 200, 0),  # too low a cut-off
        (900, 40.0, 400, 0),  # too few samples kept
        (900, 40.0, 10, 850),  # too many dropped
        (30, 400.0, 1, 0),  # too short for any
        (60, 490.0, 1, 0),  # next to half the sampling frequency a filter is long, too
    ],
)
def test_a_record_that_is_too_short_is_told_only_ways_that_suffice(
    n: int, cutoff_hz: float, factor: int, drop: int
) -> None:
    record = rigid_record(swings((0.3, 0.3)), noise=1e-7).part(0, n, "short")
    assert record.n < needed_by(record, cutoff_hz, factor, drop)
    ways = shorter_ways(RIGID, record.source, 4, cutoff_hz, factor, drop).split(" or ")
    assert ways.pop(0) == "give a longer record"
    for way in ways:
        if "drop" in way:
            assert record.n >= needed_by(record, cutoff_hz, factor, 0)
        elif "decimation" in way:
            assert record.n >= needed_by(record, cutoff_hz, int(way.split()[3]), drop)
        else:
            hertz = float(way.split()[3])
            kept = (
                decimation_for(record.fs, hertz) if factor == decimation_for(record.fs, cutoff_hz) else factor
            )
            assert record.n >= needed_by(record, hertz, kept, drop)


def test_each_way_is_told_where_it_suffices() -> None:
    record = rigid_record(swings((0.3, 0.3)), noise=1e-7)
    source = record.part(0, 900, "short").source
    assert "decimation of" in shorter_ways(RIGID, source, 4, 40.0, 400, 0)
    assert "drop fewer" in shorter_ways(RIGID, source, 4, 40.0, decimation_for(source.fs, 40.0), 850)
    low = decimation_for(source.fs, 2.0)
    assert "a cut-off of" in shorter_ways(RIGID, source, 4, 2.0, low, 0)


def test_the_number_of_samples_that_is_asked_for_suffices() -> None:
    record = rigid_record(swings((0.3, 0.3)), noise=1e-7)
    with pytest.raises(DataError, match=r"at least (\d+) samples") as raised:
        choose_filter(RIGID, [record.part(0, 20, "short")])
    fewest = int(str(raised.value).rpartition("at least ")[2].split()[0])
    others = np.geomspace(0.01, 0.4, 200) * record.fs
    order = least_order(RIGID)
    enough = [samples_needed(RIGID, order, hz, record.fs, decimation_for(record.fs, hz)) for hz in others]
    assert min(enough) <= 1.1 * fewest and fewest >= 50
