"""Columns that depend on earlier ones, by sparse elimination in exact rationals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

from modelgen.symbolic.equations.signals import Exact, quotient

#: where a coefficient stands in a column: (row, signal)
Place = TypeVar("Place", bound=tuple[Any, Any])


def exact_dependencies(columns: Sequence[Mapping[Place, Exact]]) -> dict[int, dict[int, Exact]]:
    """Write every column that depends on earlier ones as their exact combination (sparse elimination)."""
    pivots: dict[Place, tuple[dict[Place, Exact], dict[int, Exact]]] = {}
    dependent: dict[int, dict[int, Exact]] = {}
    for index, column in enumerate(columns):
        vector = dict(column)
        recipe: dict[int, Exact] = {index: 1}
        for place in sorted(column):  # fill-in can only meet pivots whose own entries are still in `vector`
            _eliminate(vector, recipe, place, pivots)
        pending = [place for place in vector if place in pivots]
        while pending:
            _eliminate(vector, recipe, min(pending), pivots)
            pending = [place for place in vector if place in pivots]
        if vector:
            pivots[min(vector)] = (vector, recipe)
        else:
            dependent[index] = {i: -factor for i, factor in sorted(recipe.items()) if i != index}
    return dependent


def _eliminate(
    vector: dict[Place, Exact],
    recipe: dict[int, Exact],
    place: Place,
    pivots: Mapping[Place, tuple[dict[Place, Exact], dict[int, Exact]]],
) -> None:
    if place not in pivots or place not in vector:
        return
    pivot, made_of = pivots[place]
    factor = -quotient(vector[place], pivot[place])
    for key, value in pivot.items():
        vector[key] = vector.get(key, 0) + factor * value
        if not vector[key]:
            del vector[key]
    for index, value in made_of.items():
        recipe[index] = recipe.get(index, 0) + factor * value
        if not recipe[index]:
            del recipe[index]
