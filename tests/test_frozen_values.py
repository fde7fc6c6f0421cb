"""Frozen values: nothing in them can be changed, and they come back from a pickle as they were."""

from __future__ import annotations

import pickle
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modelgen.array_types import FloatArray
from modelgen.frozen_values import FrozenValues

FINITE = st.floats(allow_nan=False, width=64)


@dataclass(frozen=True, eq=False)
class Values(FrozenValues):
    """One of each kind."""

    array: FloatArray
    table: Mapping[str, float]
    name: str = "x"


@given(st.lists(FINITE), st.dictionaries(st.text(), FINITE), st.text())
def test_what_was_given_is_copied_and_locked(
    numbers: list[float], table: dict[str, float], name: str
) -> None:
    array, given_table = np.array(numbers), dict(table)
    values = Values(array, given_table, name)
    array[:] = 0.0
    given_table["new"] = 1.0
    for one in (values, pickle.loads(pickle.dumps(values))):
        assert one.array.tolist() == numbers
        assert (dict(one.table), one.name) == (table, name)
        assert not one.array.flags.writeable
        with pytest.raises(TypeError):
            one.table["new"] = 1.0


def test_what_nobody_can_change_is_not_copied() -> None:
    array = np.arange(3.0)
    array.flags.writeable = False
    assert Values(array, {}).array is array
    behind = np.arange(4.0)
    view = behind[1:]
    view.flags.writeable = False
    values = Values(view, {})
    behind[:] = 7.0
    assert values.array.tolist() == [1.0, 2.0, 3.0]
