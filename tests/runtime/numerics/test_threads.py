"""A process uses the cores that it may use; one that was started as one of many uses one."""

from __future__ import annotations

import multiprocessing
import os
import platform
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from modelgen.runtime.numerics.threads import WAITING, each, give_back_freed, meanwhile, usable_threads


def test_a_thread_for_every_core_that_may_be_used(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: {0, 2, 5}, raising=False)
    assert usable_threads() == 3
    monkeypatch.delattr(os, "sched_getaffinity")
    monkeypatch.setattr(os, "cpu_count", lambda: 7)
    assert usable_threads() == 7


def test_a_worker_process_has_one() -> None:
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        assert pool.apply(usable_threads) == 1


@pytest.mark.parametrize("cores", [{0}, {0, 1}])
def test_what_another_thread_works_on_is_made_once(cores: set[int], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: cores, raising=False)
    made: list[int] = []

    def work() -> int:
        made.append(threading.get_ident())
        return 7

    found = meanwhile(work)
    assert [found(), found()] == [7, 7]
    assert len(made) == 1
    assert (made[0] == threading.get_ident()) == (len(cores) == 1)


def test_what_goes_wrong_in_another_thread_is_told_to_who_asks() -> None:
    found = meanwhile(lambda: 1 // 0)
    with pytest.raises(ZeroDivisionError):
        found()


@pytest.mark.parametrize("cores", [{0}, {0, 1, 2}])
def test_each_item_is_worked_on_in_its_order(cores: set[int], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: cores, raising=False)
    # what a thread calls in turn would wait for a thread for ever
    inner = each(lambda k: sum(each(lambda i: i * k, range(4), 4)), range(20), 20)
    assert list(inner) == [6 * k for k in range(20)]


def test_few_results_are_ahead_of_the_one_that_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: {0, 1}, raising=False)
    begun: list[int] = []

    def items() -> Iterator[int]:
        for k in range(100):
            begun.append(k)
            yield k

    found = each(lambda k: k, items(), 100)
    assert next(found) == 0
    assert len(begun) <= 2 * WAITING
    found.close()  # type: ignore[attr-defined]
    assert len(begun) <= 2 * WAITING


def test_an_item_that_goes_wrong_ends_all(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: {0, 1}, raising=False)
    with pytest.raises(ZeroDivisionError):
        list(each(lambda k: 1 // (3 - k), range(50), 50))
    assert list(each(lambda k: -k, range(3), 3)) == [0, -1, -2]


def _resident_pages() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1])


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="other C libraries are not asked")
def test_freed_memory_is_given_back() -> None:
    held = [np.ones(1 << 13) for _ in range(1000)]  # 64 MB of arrays that are too small for maps of their own
    del held[:-1]  # what stands behind them keeps the rest from going by itself
    before = _resident_pages()
    give_back_freed()
    assert before - _resident_pages() > 10_000  # of 4 kB
    assert held[0].sum() == 1 << 13
