"""Columns that are zero in most blocks of rows."""

import numpy as np
import pytest

from modelgen.runtime.numerics.block_column import BlockColumn, block_column
from modelgen.runtime.numerics.regressor import Regressors


def test_blocks_without_a_part_are_zeros():
    column = BlockColumn({2: np.array([3.0]), 0: np.array([1.0, 2.0])}, [2, 3, 1])
    assert [part.tolist() for part in column] == [[1.0, 2.0], [0.0, 0.0, 0.0], [3.0]]
    assert column[-1].tolist() == [3.0]
    assert [part.tolist() for part in column[1:]] == [[0.0, 0.0, 0.0], [3.0]]
    assert list(column.parts) == [0, 2]
    with pytest.raises(IndexError):
        column[3]


def test_blocks_of_zeros_are_left_out_of_arrays():
    column = block_column([np.zeros(2), np.array([0.0, 4.0])])
    assert {index: part.tolist() for index, part in column.parts.items()} == {1: [0.0, 4.0]}
    assert block_column(column) is column
    assert column.changed(np.negative)[1].tolist() == [0.0, -4.0]


def test_a_block_is_joined_by_the_columns_that_it_sees_only():
    R = Regressors((np.ones((2, 1)), np.ones((3, 1))), (np.array([0]), np.array([1])), None, 2)
    arrays = [[np.zeros(2), np.array([1.0, 2.0, 3.0])], [np.array([4.0, 5.0]), np.zeros(3)]]
    joined = R.joined(arrays)
    assert [places.tolist() for places in joined.places] == [[0, 3], [1, 2]]
    more = np.stack([np.concatenate(one) for one in arrays], axis=1)
    dense = np.hstack([np.concatenate(R.dense().samples), more])
    assert np.array_equal(np.concatenate(joined.dense().samples), dense)
