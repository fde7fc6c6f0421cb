"""Lines at many changes of what they are made of, computed together: as one by one, in few calls."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from modelgen.runtime.diagnostics import noisy_lines
from modelgen.runtime.diagnostics.noisy_lines import changed

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
