"""Which records threads share when effects are worked out."""

from __future__ import annotations

import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from modelgen.runtime.files.npy_channels import open_npy
from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import METHODS
from modelgen.runtime.iv.effect_rows import (
    _moved_rows,
    _over_records,
    effect_rows,
    rows_of,
    simulated_records,
)
from modelgen.runtime.iv.instrumental_variables import Setting
from modelgen.runtime.iv.model_errors import effects_of
from modelgen.runtime.iv.pushed_rows import PushedRows
from modelgen.runtime.records.record import Record
from tests.runtime.two_mass_records import SMALL, two_mass_records


def test_records_in_files_have_a_thread_each(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("modelgen.runtime.numerics.threads.usable_threads", lambda: 2)
    samples = np.sin(0.1 * np.arange(100))
    np.save(tmp_path / "q.npy", samples)
    here, there = (
        Record({"q": samples}, 100.0, "here"),
        Record.over(open_npy({"q": tmp_path / "q.npy"}, 100.0)),
    )
    for record, apart in ((here, False), (there, True)):
        found = list(_over_records(lambda index: (index, threading.get_ident()), [1, 0], [record, record]))
        assert [index for index, _ in found] == [1, 0]
        assert all((worker != threading.get_ident()) == apart for _, worker in found)


def test_a_body_at_rest_keeps_its_direction_whatever_an_effect_adds() -> None:
    """Its speed is rounding: the least addition would turn it, and Coulomb friction with it."""
    records = tuple(two_mass_records(noise=1e-3))
    job = Job(SMALL, records, choose_filter(SMALL, records))
    fit, setting = METHODS["wls"].run(job)[1], Setting(SMALL, records, job.choice)
    (push,) = (one for one in effects_of(SMALL, ("m", "c"), records) if one.name == "quadratic friction on m")
    moving = simulated_records(fit, setting)
    resting = []
    for one in moving:
        middle = one.record.n // 2
        held = {key: np.r_[np.full(middle, samples[middle]), samples[middle:]]
                for key, samples in one.record.signals.items()}  # fmt: skip
        resting.append(replace(one, record=one.record.edited(held)))
    whole, rest = (effect_rows(fit, setting, one, (push,))[0] for one in (moving, resting))
    for place in range(len(fit.blocks)):
        assert np.max(np.abs(rest[place])) < 1.01 * np.max(np.abs(whole[place])) + 1e-12


def test_what_changes_nothing_turns_nothing() -> None:
    """In a simulation at rest an effect is zero: there is no multiple of it to form a direction with."""
    (record, *_) = records = tuple(two_mass_records())
    setting = Setting(SMALL, records, choose_filter(SMALL, records))
    pushes = PushedRows(rows_of(setting, record, 0))
    sign = next(one for one in SMALL.features if one.function == "sign")
    read = {signal.channel for signal in SMALL.signals if signal.key == sign.of}
    nothing = {key: np.zeros(record.n) for key in read}
    assert not np.any(_moved_rows(pushes, record, [{sign.key: 1.0}], nothing, read, {sign.key}))
