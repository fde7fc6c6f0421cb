"""Records that are logged far faster than rows need are looked at as means, over all of their time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from modelgen.runtime.files.npy_channels import open_npy
from modelgen.runtime.identification import default_method
from modelgen.runtime.identification.cutoffs.thinner_records import thinner
from modelgen.runtime.identification.explanation import explain_stretches
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


def ramp() -> Record:
    t = np.arange(SAMPLES) / FS
    return Record({key: np.sin((20.0 + place) * t) for place, key in enumerate(SMALL.channels)}, FS, "log")


def test_all_channels_are_means_about_the_same_instants() -> None:
    job = job_of(ramp(), 50.0)
    means = thinner(job)
    assert means is not None
    (before,), (after,) = job.records, means.records
    factor = round(before.fs / after.fs)
    assert factor == 20  # twenty a period of 50 Hz
    assert after.n == SAMPLES // factor
    for key in SMALL.channels:
        np.testing.assert_allclose(after.signals[key][3], before.signals[key][3 * factor : 4 * factor].mean())
    # the rows keep their rate
    assert means.choice.decimation[0] * factor == pytest.approx(job.choice.decimation[0], abs=factor)
    assert thinner(means) is None


def test_records_are_as_they_are_where_filters_leave_no_room_or_samples_are_on_a_file(tmp_path: Path) -> None:
    assert thinner(job_of(ramp(), 500.0)) is None
    record, files = ramp(), {}
    for key, samples in record.signals.items():
        files[key] = tmp_path / f"{key}.npy"
        np.save(files[key], samples)
    assert thinner(job_of(Record.over(open_npy(files, FS, "log")), 50.0)) is None


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
    noise = {"q_m": 1e-4, "q_c": 1e-4, "Gamma_m": 1e-3}
    record = simulate(SMALL, SLOW, "chirp", fs=10_000.0, duration_s=8.0, noise=noise).record
    estimate = identify(SMALL, record)
    assert tried == pytest.approx([8.0], rel=1e-2)
    assert_truth_inside(estimate, SLOW)
    assert max(one.std / SLOW[one.name] for one in estimate.parameters.physical) < 0.05
