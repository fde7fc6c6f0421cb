"""Records that are logged far faster than rows need are looked at as means, over all of their time."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from modelgen.errors import IdentifiabilityError
from modelgen.runtime.files.npy_channels import open_npy
from modelgen.runtime.identification import default_method
from modelgen.runtime.identification.cutoffs.thinner_records import beyond_means, thinner
from modelgen.runtime.identification.explanation import explain_stretches
from modelgen.runtime.identification.explanation.explained import Begun
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import Auto
from modelgen.runtime.identification.options import CheckOptions, Filters
from modelgen.runtime.identification.task import Task, prepared
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.simulate import simulate
from tests.runtime.two_mass_records import SMALL, assert_truth_inside

# a mode of 4 Hz
SLOW = {"J_m": 1e-3, "F_vm": 5e-3, "F_sm": 0.02, "J_c": 2e-3, "F_vmc": 4e-3, "K": 0.5}
FS, SAMPLES = 20_000.0, 10_007


def job_of(record: Record, cutoff_hz: float) -> Job:
    return prepared(SMALL, record, Auto(), Filters(cutoff_hz=cutoff_hz), CheckOptions()).job


def waves(name: str = "log", rate: float = 20.0) -> Record:
    t = np.arange(SAMPLES) / FS
    return Record({key: np.sin((rate + place) * t) for place, key in enumerate(SMALL.channels)}, FS, name)


def test_all_channels_are_means_about_the_same_instants() -> None:
    job = job_of(waves(), 50.0)
    means = thinner(job)
    assert means is not None
    (before,), (after,) = job.records, means.records
    factor = round(before.fs / after.fs)
    assert factor == 20  # twenty a period of 50 Hz
    assert after.n == SAMPLES // factor
    # without what a mean takes off: the readings themselves, between two samples, to fourth order
    middle = np.arange(3, after.n - 3) * factor + 0.5 * (factor - 1)
    for key in SMALL.channels:
        read = np.interp(middle, np.arange(SAMPLES), before.signals[key])
        np.testing.assert_allclose(after.signals[key][3:-3], read, atol=1e-6)
    # the rows keep their rate
    assert means.choice.decimation[0] * factor == pytest.approx(job.choice.decimation[0], abs=factor)
    assert thinner(means) is None


def on_files(record: Record, folder: Path) -> Record:
    files = {key: folder / f"{key}.npy" for key in record.keys}
    for key, path in files.items():
        np.save(path, record.signals[key])
    return Record.over(open_npy(files, record.fs, record.name))


def test_records_are_as_they_are_where_filters_leave_no_room() -> None:
    assert thinner(job_of(waves(), 500.0)) is None


def test_means_of_files_are_those_of_memory_however_they_are_read(tmp_path: Path) -> None:
    means, read = (thinner(job_of(one, 50.0)) for one in (waves(), on_files(waves(), tmp_path)))
    assert means is not None
    assert read is not None
    assert means.choice == read.choice
    (here,), (there,) = means.records, read.records
    assert not there.in_memory
    assert (here.fs, here.n, here.keys) == (there.fs, there.n, there.keys)
    edges = [0, 1, 2, 77, here.n - 1, here.n]
    for key in here.keys:
        parts = [there.read(key, start, stop) for start, stop in pairwise(edges)]
        np.testing.assert_array_equal(np.concatenate(parts), here.signals[key])


def test_means_are_made_anew_where_another_cutoff_is_decided_on() -> None:
    chosen, decided = (
        prepared(SMALL, waves(), Auto(), Filters(cutoff_hz=hertz), CheckOptions()) for hertz in (50.0, 150.0)
    )
    means = thinner(chosen.job)
    assert means is not None
    low = replace(chosen, records=means.records, choice=means.choice, job=means)
    assert beyond_means(chosen, low) is None
    assert beyond_means(chosen, decided) is None  # of all samples
    wider = beyond_means(chosen, replace(low, choice=replace(low.choice, cutoff_hz=150.0)))
    assert wider is not None
    assert wider.choice.cutoff_hz == wider.job.choice.cutoff_hz == 150.0
    again = thinner(wider.job)
    assert again is not None
    assert again.records[0].fs > 2.0 * means.records[0].fs


@pytest.mark.parametrize(("cutoff_hz", "asked"), [(50.0, 1), (500.0, 2)])
def test_whole_records_decide_where_stretches_find_nothing_and_not_after_means_of_all_time(
    cutoff_hz: float, asked: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(explain_stretches, "SEARCHED", SAMPLES // 2)
    task = prepared(SMALL, waves(), Auto(), Filters(cutoff_hz=cutoff_hz), CheckOptions())
    lengths: list[int] = []

    def nothing(one: Task) -> Begun:
        lengths.append(sum(record.n for record in one.records))
        raise IdentifiabilityError.at("records", "tell nothing", "move")

    with pytest.raises(IdentifiabilityError):
        explain_stretches.decided_by_stretches(task, task, nothing, lambda begun: begun)
    assert len(lengths) == asked
    assert lengths[0] < SAMPLES


def slow_record() -> Record:
    noise = {"q_m": 1e-4, "q_c": 1e-4, "Gamma_m": 1e-3}
    return simulate(SMALL, SLOW, "chirp", fs=10_000.0, duration_s=8.0, noise=noise).record


@pytest.mark.slow
def test_a_slow_chain_on_files_is_what_it_is_in_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(explain_stretches, "SEARCHED", 8192)
    record = slow_record()
    here, there = identify(SMALL, record), identify(SMALL, on_files(record, tmp_path))
    assert here.params.keys() == there.params.keys()
    assert here.not_identifiable == there.not_identifiable
    assert here.fit.notes == there.fit.notes
    for name, value in here.params.items():
        assert there.params[name] == pytest.approx(value, abs=1e-9 * here.bse[name])
        assert there.bse[name] == pytest.approx(here.bse[name], rel=1e-6)


@pytest.mark.slow
def test_a_slow_chain_that_is_logged_fast_is_decided_on_all_of_its_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Stretches of 8192 samples in all are 0.8 of its 8 s."""
    monkeypatch.setattr(explain_stretches, "SEARCHED", 8192)
    tried: list[float] = []
    of_chain = default_method._of_chain

    def spied(task: Task, method: Auto) -> object:
        tried.extend(one.duration_s for one in task.job.records)
        return of_chain(task, method)

    monkeypatch.setattr(default_method, "_of_chain", spied)
    record = slow_record()
    estimate = identify(SMALL, record)
    assert tried == pytest.approx([8.0], rel=1e-2)
    assert_truth_inside(estimate, SLOW)
    assert max(one.std / SLOW[one.name] for one in estimate.parameters.physical) < 0.05
