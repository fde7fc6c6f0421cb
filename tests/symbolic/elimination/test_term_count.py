"""The number of terms that is counted before an elimination bounds, and mostly is, that of its rows."""

from __future__ import annotations

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modelgen.errors import ModelError
from modelgen.spec.load import parse_spec
from modelgen.symbolic.elimination.elimination import eliminated_rows
from modelgen.symbolic.elimination.length_limit import LengthLimit
from modelgen.symbolic.elimination.polynomials import by_order, choose_coordinates
from modelgen.symbolic.elimination.term_count import TermCounter
from modelgen.symbolic.equations.newton import motion_equations
from modelgen.symbolic.equations.sensor_span import Sensing
from tests.symbolic.graphs import bipartite, graph, mesh, ring, star
from tests.symbolic.random_chains import random_spec


def counted_and_made(text: str) -> list[tuple[int, int, int, int]]:
    """Return counted and real terms, of the row and of its longest coefficient, of every row of a chain."""
    spec = parse_spec(text, "chain.toml")
    motion = motion_equations(spec)
    sensing = Sensing.of(spec, spec.sensor_sets["set"])
    coordinates = choose_coordinates([body.name for body in spec.bodies], sensing)
    counter = TermCounter(spec, motion.equations, coordinates)
    found = []
    try:
        for row in eliminated_rows(motion, coordinates, LengthLimit(motion, coordinates, "chain")):
            tables = (row.coordinates, row.forces, row.constants)
            real = [len(value) for table in tables for poly in table.values() for _, value in by_order(poly)]
            # a body whose multiplier is zero is no longer among those of the row
            if len(row.bodies) == len(row.eliminated) + 1:
                count = counter.row(row.bodies, row.eliminated)
                found.append((count.total, sum(real), count.longest, max(real)))
    except ModelError:
        pass
    return found


@pytest.mark.slow
@settings(max_examples=60)
@given(st.integers(0, 10**9))
def test_a_count_is_never_too_small(seed: int) -> None:
    for counted, real, counted_longest, longest in counted_and_made(random_spec(random.Random(seed), 5)):
        assert counted >= real
        assert counted_longest >= longest


@pytest.mark.parametrize(
    "text",
    [
        graph(mesh(5), 5, [4], damping=False),
        graph(mesh(4), 4, [3]),
        graph(ring(4), 4, [3], ground=True),
        graph(star(4), 4, [1], damping=False),
        graph(bipartite(2, 2), 4, [3], damping=False),
    ],
)
def test_forests_are_counted_exactly_where_all_is_eliminated_but_one(text: str) -> None:
    found = counted_and_made(text)
    assert found
    for counted, real, counted_longest, longest in found:
        assert (counted, counted_longest) == (real, longest)
