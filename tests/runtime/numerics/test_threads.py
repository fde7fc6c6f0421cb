"""A process uses the cores that it may use; one that was started as one of many uses one."""

from __future__ import annotations

import multiprocessing
import os

import pytest

from modelgen.runtime.numerics.threads import usable_threads


def test_a_thread_for_every_core_that_may_be_used(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: {0, 2, 5}, raising=False)
    assert usable_threads() == 3
    monkeypatch.delattr(os, "sched_getaffinity")
    monkeypatch.setattr(os, "cpu_count", lambda: 7)
    assert usable_threads() == 7


def test_a_worker_process_has_one() -> None:
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        assert pool.apply(usable_threads) == 1
