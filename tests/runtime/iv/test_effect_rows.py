"""Which records threads share when effects are worked out."""

from __future__ import annotations

import threading
from pathlib import Path

import numpy as np
import pytest

from modelgen.runtime.files.npy_channels import open_npy
from modelgen.runtime.iv.effect_rows import _over_records
from modelgen.runtime.records.record import Record


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
