"""Lines at many changes of what they are made of, computed together: as one by one, in few calls."""

from __future__ import annotations

import tracemalloc
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from modelgen.runtime.diagnostics import noisy_lines
from modelgen.runtime.diagnostics.noisy_lines import NoisyLines, changed

READ = dict[tuple[str, int], np.ndarray]


def lines(values: Mapping[tuple[str, int], np.ndarray]) -> dict[str, np.ndarray]:
    q, v = values["q", 0], values["q", 1]
    return {"square": q * v**2, "late": np.sin(q) + values.get(("late", 0), 0.0)}


@pytest.mark.parametrize(("together", "calls"), [(1, 7), (150, 3), (8192, 1)])
def test_changes_made_together_are_those_made_one_by_one(
    monkeypatch: pytest.MonkeyPatch, together: int, calls: int
) -> None:
    monkeypatch.setattr(noisy_lines, "CHANGED_TOGETHER", together)
    rng, made = np.random.default_rng(1), list[int]()
    values: READ = {("q", order): rng.standard_normal(50) for order in (0, 1)}
    changes: list[READ] = [{("q", k % 2): np.array(0.1 * k)} for k in range(5)]
    changes += [{("q", 0): rng.standard_normal(50), ("late", 0): np.array(2.0)}, {}]

    def counted(known: Mapping[tuple[str, int], np.ndarray]) -> dict[str, np.ndarray]:
        made.append(len(known["q", 0]))
        return lines(known)

    found = changed(counted, ("square", "late"), values, changes)
    assert len(made) == calls
    for place, one in enumerate(changes):
        known = {read: values.get(read, 0.0) + one.get(read, 0.0) for read in {**values, **one}}
        for key, line in lines(known).items():
            np.testing.assert_allclose(found[key][place], line, rtol=1e-15)


def test_slopes_take_the_memory_of_those_that_are_not_zero(monkeypatch: pytest.MonkeyPatch) -> None:
    # arms of six joints have hundreds of lines and readings, and each line is made of few
    count, samples = 150, 400
    names = [f"line {k}" for k in range(count)]
    values: READ = {(f"q{k}", 0): np.linspace(1.0, 2.0, samples) for k in range(count)}

    def squares(_: object, values: READ) -> dict[str, np.ndarray]:
        return {name: (k + 1.0) * values[f"q{k}", 0] ** 2 for k, name in enumerate(names)}

    monkeypatch.setattr(noisy_lines, "formed", squares)
    kernel: Any = SimpleNamespace(keys=names)
    tracemalloc.start()
    try:
        found = NoisyLines(kernel, values, {channel for channel, _ in values}).slopes()
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    # all of them would take 144 MB, and lines at both ends of their steps twice that
    assert peak < 60e6
    for k, name in enumerate(names):
        assert list(found[name]) == [(f"q{k}", 0)]
        np.testing.assert_allclose(found[name][f"q{k}", 0], 2.0 * (k + 1.0) * values[f"q{k}", 0], rtol=1e-8)
