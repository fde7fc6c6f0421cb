"""Arrays that are made once, as long as there is room for them."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.runtime.numerics.recent_arrays import RecentArrays


def test_what_is_asked_for_again_is_made_once_and_the_newest_stay() -> None:
    made: list[str] = []
    arrays = RecentArrays(2 * 80)

    def ask(key: str) -> np.ndarray:
        return arrays.of(key, lambda: (made.append(key), np.arange(10.0))[1])

    first = ask("a")
    assert ask("a") is first
    ask("b")
    ask("a")
    ask("c")  # no room for three: "b" was asked for longest ago
    ask("a")
    ask("b")
    assert made == ["a", "b", "c", "b"]
    arrays.clear()
    assert ask("a") is not first


def test_what_is_larger_than_the_room_is_not_kept_and_nobody_changes_what_is() -> None:
    arrays = RecentArrays(79)
    large = arrays.of("large", lambda: np.zeros(10))
    assert arrays.of("large", lambda: np.ones(10))[0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        large[0] = 1.0
