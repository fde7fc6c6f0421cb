"""A chain held near its record moves alike in one stretch and in many, in memory and from channels."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from generated import emps300_qm_qc, emps_rigid_qm
from modelgen.errors import DataError
from modelgen.runtime.files.npy_channels import NpyChannels, open_npy
from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.options import Filters
from modelgen.runtime.iv import held_motion
from modelgen.runtime.iv.companion_simulation import run_beside
from modelgen.runtime.iv.held_motion import HeldMotion, SlowPart
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.records.channels import EditedChannels
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.motion import readings, true_signals
from modelgen.runtime.simulation.plant import make_plant
from modelgen.runtime.simulation.simulate import simulate

TWO = model_from_module(emps300_qm_qc)
RIGID = model_from_module(emps_rigid_qm)
TRUTH = dict(TWO.parameter_sets["table_1"])
FS = 5000.0


@pytest.fixture(scope="module")
def record() -> Record:
    """Turns and rests: the motor sticks in the dwells."""
    return simulate(TWO, TRUTH, "trapezoid", fs=FS, duration_s=2.0, oversample=2).record


def of_channels(record: Record) -> Record:
    return Record.over(EditedChannels(record, record.name, record.n))


def cut(monkeypatch: pytest.MonkeyPatch, size: int) -> None:
    monkeypatch.setattr(held_motion, "HELD_STRETCH", size)
    monkeypatch.setattr(held_motion, "HELD_REACHES", 0)


def test_stretches_follow_each_other_through_stick_and_slip(
    record: Record, monkeypatch: pytest.MonkeyPatch
) -> None:
    plant, choice = make_plant(TWO, TRUTH), choose_filter(TWO, (record,))
    whole = HeldMotion(plant, record, choice, true_signals)
    assert whole.count == 1
    one = whole.whole()
    cut(monkeypatch, 101)
    many = HeldMotion(plant, record, choice, true_signals)
    assert many.count == 99  # the last one has a sample more
    found = many.whole()
    # a border within a rest, and one within motion
    sticks = one["mode_m"][::101] == 0.0
    assert 5 < np.count_nonzero(sticks) < many.count - 5
    for key, samples in one.items():
        if key.startswith("mode"):
            assert np.count_nonzero(samples != found[key]) <= 2
        elif key.startswith(("q_", "v_")):
            np.testing.assert_allclose(found[key], samples, rtol=0.0, atol=1e-7 * np.ptp(samples))


def test_channels_and_memory_give_the_same_bits(record: Record, monkeypatch: pytest.MonkeyPatch) -> None:
    choice = choose_filter(TWO, (record,))
    cut(monkeypatch, 909)
    here = run_beside(TWO, TRUTH, record, choice)
    there = run_beside(TWO, TRUTH, of_channels(record), choice)
    assert here.source is here
    assert isinstance(there.source, held_motion.HeldChannels)
    # in any order, more often than stretches are kept
    for start, stop in ((6000, 9000), (10, 20), (499, 1501), (record.n - 1, record.n), (0, record.n)):
        for key in record.keys:
            np.testing.assert_array_equal(there.read(key, start, stop), here.read(key, start, stop))


@pytest.mark.parametrize("order", [0, 1, 2])
def test_what_is_followed_goes_on_at_a_border(order: int, monkeypatch: pytest.MonkeyPatch) -> None:
    t = np.arange(6000) / FS
    readings_of = {"a": 3.0 + np.sin(20.0 * t), "Gamma": np.zeros(6000)}
    record = Record(readings_of, FS)
    whole = SlowPart(record, "a", 2.0, order, 30.0).between(0, 6000, (0.0, 0.0))
    cut(monkeypatch, 1000)
    slow, sums, parts = SlowPart(record, "a", 2.0, order, 30.0), (0.0, 0.0), []
    for start in range(0, 6000, 1000):
        position, velocity, sums = slow.between(start, min(start + 1001, 6000), sums, 1000)
        parts.append((position[:1000], velocity[:1000]))
    for place in (0, 1):
        joined = np.concatenate([part[place] for part in parts])
        np.testing.assert_allclose(joined, whole[place], rtol=0.0, atol=1e-8 * np.ptp(whole[place]))


def test_where_a_motion_runs_away_is_told(record: Record, monkeypatch: pytest.MonkeyPatch) -> None:
    cut(monkeypatch, 4000)
    # a spring that pushes away: after 1 s nothing is finite any more
    plant, choice = make_plant(TWO, {**TRUTH, "K": -2.0}), choose_filter(TWO, (record,))
    motion = HeldMotion(plant, of_channels(record), choice, readings)
    motion.stretch(0)
    with pytest.raises(DataError, match=r"before 0\.\d+ s, counted from 0\.8 s"):
        motion.stretch(1)


def written(folder: Path, n: int) -> None:
    """Write a record of one body, n samples: it goes to and fro every four seconds, with friction."""
    rng, t = np.random.default_rng(0), np.arange(n) / FS
    v, a, q = np.zeros(n), np.zeros(n), np.zeros(n)
    for size, f in ((0.2, 0.25), (0.01, 2.3), (0.01, 3.1)):
        w = 2.0 * np.pi * f
        q -= size / w * np.cos(w * t)
        v += size * np.sin(w * t)
        a += size * w * np.cos(w * t)
    force = 90.0 * a + 200.0 * v + 20.0 * np.sign(v) + 1.0 + rng.standard_normal(n)
    for key, samples in zip(RIGID.channels, (q, force), strict=True):
        np.save(folder / f"{key}.npy", samples)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["auto", "iv"])
def test_memory_does_not_grow_with_samples_from_files(
    method: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # wide enough for chunks to be the same at both lengths
    filters = Filters(cutoff_hz=20.0, decimation=100, direction_cutoff_hz=40.0)
    peaks, lengths = [], []
    plain = NpyChannels.read

    def read(self: NpyChannels, key: str, start: int, stop: int) -> np.ndarray:
        lengths.append(min(stop, self.n) - start)
        return plain(self, key, start, stop)

    monkeypatch.setattr(NpyChannels, "read", read)
    for n in (20_000, 600_000, 1_200_000):  # the first loads the code
        folder = tmp_path / str(n)
        folder.mkdir()
        written(folder, n)
        source = open_npy({key: folder / f"{key}.npy" for key in RIGID.channels}, FS)
        tracemalloc.start()
        try:
            identify(RIGID, source, method=method, filters=filters)
            peaks.append(tracemalloc.get_traced_memory()[1])
        finally:
            tracemalloc.stop()
    # what one channel would take that is kept; rows, several times, take half of it. Peaks of equal runs
    # differ by 3 MB where two threads make their chunks.
    assert peaks[2] - peaks[1] < 8.0 * 600_000
    # no step reads all of a record at a time
    assert max(lengths) < 600_000
