"""Records that are edited, cut and read in stretches, against the same in memory."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modelgen.errors import DataError
from modelgen.runtime.least_squares.time_shifts import hold, on_one_clock, shift
from modelgen.runtime.records.channels import Edit, read_continued
from modelgen.runtime.records.record import Record

RNG = np.random.default_rng(3)
RECORD = Record({"q": RNG.normal(size=300).cumsum(), "F": RNG.normal(size=300)}, 100.0, "run", "chirp")
EDITS = {
    "F": shift("F", 1.7),
    "late": shift("F", -6.25),
    "held": hold("F"),
    "mirrored": Edit("q", lambda samples, _: -samples),
    "slow": on_one_clock("F", 0.03, RECORD),
    "fast": on_one_clock("q", -0.02, RECORD),
    "given": np.arange(300.0),
}


@settings(max_examples=60)
@given(st.sampled_from([*EDITS, "q"]), st.integers(0, 299), st.integers(1, 300), st.integers(0, 40))
def test_any_stretch_is_that_of_the_whole(key: str, start: int, length: int, cut: int) -> None:
    whole = RECORD.edited(EDITS)
    over = Record.over(RECORD, "chirp").edited(EDITS)
    stop = min(start + length, 300)
    np.testing.assert_array_equal(over.read(key, start, stop), whole.read(key, start, stop))
    np.testing.assert_array_equal(over.signals[key], whole.signals[key])
    parts = [one.part(cut, 300 - cut, "part") for one in (whole, over)]
    assert [part.n for part in parts] == [300 - 2 * cut] * 2
    np.testing.assert_array_equal(parts[1].signals[key], parts[0].signals[key])


def test_it_says_what_it_is() -> None:
    over = Record.over(RECORD, "chirp")
    assert (over.keys, over.n, over.fs, over.name, over.tag) == (("q", "F"), 300, 100.0, "run", "chirp")
    assert over == RECORD
    assert pickle.loads(pickle.dumps(over)) == RECORD
    assert "Gamma" not in over.signals
    with pytest.raises(KeyError):
        over.signals["Gamma"]
    assert over.edited({}) is over


def test_facts_of_a_record_do_not_depend_on_where_it_is() -> None:
    over = Record.over(RECORD)
    for key in RECORD.keys:
        assert over.facts.extent(key) == RECORD.facts.extent(key)
        assert over.facts.spectrum(key).noise == RECORD.facts.spectrum(key).noise
    extent = RECORD.facts.extent("q")
    samples = RECORD.signals["q"]
    assert (extent.least, extent.greatest) == (samples.min(), samples.max())
    assert extent.mean == pytest.approx(samples.mean())


def test_a_long_record_is_looked_at_where_it_is_active(monkeypatch: pytest.MonkeyPatch) -> None:
    """An experiment of one minute in a log of an hour, behind noise of the sensors all the time."""
    monkeypatch.setattr("modelgen.runtime.records.record_facts.WHOLE", 4096)
    n, first, last = 60_000, 30_700, 34_000
    t = np.arange(n) / 100.0
    moves = (t >= first / 100.0) & (t < last / 100.0)
    rng = np.random.default_rng(0)
    signals = {
        "q": np.sin(2.0 * np.pi * 3.0 * t) * moves + 1e-4 * rng.normal(size=n),
        "F": np.cos(2.0 * np.pi * 3.0 * t) * moves,
        "temperature": rng.normal(size=n),
    }
    facts = Record(signals, 100.0).facts
    assert all(first - 1024 < part.start and part.stop < last + 1024 for part in facts.parts)
    assert facts.spectrum("q").moves
    # where it is active throughout, stretches are spread evenly
    even = Record({"q": np.sin(t), "F": np.cos(t)}, 100.0).facts
    assert [part.start // 10_000 for part in even.parts] == [0, 1, 3, 5]
    assert {part.stop - part.start for part in even.parts} == {1024}
    still = Record({"q": np.zeros(n), "F": np.ones(n)}, 100.0).facts
    assert len(still.parts) == 1


class Named:
    """A source with one label or number that cannot be used."""

    keys = ("q",)

    def __init__(self, name: str = "run", fs: float = 10.0, n: int = 5) -> None:
        self.name, self.fs, self.n = name, fs, n

    def read(self, channel: str, start: int, stop: int) -> np.ndarray:
        return np.zeros(stop - start)


@pytest.mark.parametrize(
    ("source", "message"),
    [
        (Named(name="a\x1b[2J"), "record: name is"),
        (Named(fs=np.inf), "run: fs: is inf"),
        (Named(n=1), r"run: has 1 sample\(s\)"),
    ],
)
def test_labels_and_numbers_are_checked(source: Named, message: str) -> None:
    with pytest.raises(DataError, match=message):
        Record.over(source)


def test_a_record_is_continued_by_its_odd_mirror_image() -> None:
    source = Record({"q": np.array([1.0, 2.0, 4.0, 8.0])}, 1.0)
    got = read_continued(source, "q", -2, 6)
    np.testing.assert_array_equal(got, [-2.0, 0.0, 1.0, 2.0, 4.0, 8.0, 12.0, 14.0])
    np.testing.assert_array_equal(read_continued(source, "q", 1, 3), [2.0, 4.0])


def test_what_is_not_edited_is_not_copied_and_what_is_new_is_checked() -> None:
    found = RECORD.edited({"F": np.zeros(300)})
    assert found.signals["q"] is RECORD.signals["q"]
    with pytest.raises(DataError, match="channels differ in length"):
        RECORD.edited({"F": np.zeros(299)})
    with pytest.raises(DataError, match="sample 7"):
        RECORD.edited({"F": np.where(np.arange(300) == 7, np.nan, 0.0)})
