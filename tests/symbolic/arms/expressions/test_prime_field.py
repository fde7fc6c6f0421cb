from __future__ import annotations

import random
from fractions import Fraction

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from modelgen.symbolic.arms.expressions.prime_field import PRIME, Residues, echelon, fraction_of, residue

ELEMENT = st.integers(0, PRIME - 1) | st.sampled_from([0, 1, PRIME - 1, PRIME - 2, 1 << 60, (1 << 31) - 1])


@given(st.lists(st.tuples(ELEMENT, ELEMENT), min_size=1, max_size=5))
def test_residues_compute_in_the_field(pairs: list[tuple[int, int]]) -> None:
    left, right = Residues([a for a, _ in pairs]), Residues([b for _, b in pairs])
    assert (left + right).values == [(a + b) % PRIME for a, b in pairs]
    assert (left * right).values == [a * b % PRIME for a, b in pairs]
    assert (left + -left).values == [0] * len(pairs)
    if all(a for a, _ in pairs):
        assert (left * (1 / left)).values == [1] * len(pairs)


def exact_echelon(rows: list[list[int]]) -> tuple[list[list[int]], list[int]]:
    """Gauss and Jordan in plain integers."""
    rows, leading = [list(row) for row in rows], []
    for column in range(len(rows[0])):
        done = len(leading)
        pivot = next((r for r in range(done, len(rows)) if rows[r][column]), None)
        if pivot is None:
            continue
        rows[done], rows[pivot] = rows[pivot], rows[done]
        inverse = pow(rows[done][column], -1, PRIME)
        rows[done] = [x * inverse % PRIME for x in rows[done]]
        for r in range(len(rows)):
            if r != done and rows[r][column]:
                factor = rows[r][column]
                rows[r] = [(x - factor * y) % PRIME for x, y in zip(rows[r], rows[done], strict=True)]
        leading.append(column)
    return rows[: len(leading)], leading


@given(st.integers(0, 10**9))
def test_echelon_form_is_that_of_plain_integers(seed: int) -> None:
    rng = random.Random(seed)
    height, width, rank = rng.randint(1, 9), rng.randint(1, 9), rng.randint(1, 5)
    basis = [[rng.choice([0, 1, PRIME - 1, rng.randrange(PRIME)]) for _ in range(width)] for _ in range(rank)]
    rows = []
    for _ in range(height):
        weights = [rng.choice([0, rng.randrange(PRIME)]) for _ in basis]
        sums = [sum(w * x for w, x in zip(weights, c, strict=True)) for c in zip(*basis, strict=True)]
        rows.append([x % PRIME for x in sums])
    matrix, leading = echelon(rows)
    wanted, places = exact_echelon(rows)
    assert leading == places
    assert matrix.dtype == np.uint64 and matrix.tolist() == wanted


@given(st.integers(-(10**8), 10**8), st.integers(1, 10**8))
def test_a_fraction_comes_back_from_its_residue(top: int, bottom: int) -> None:
    value = Fraction(top, bottom)
    assert fraction_of(residue(value)) == value
