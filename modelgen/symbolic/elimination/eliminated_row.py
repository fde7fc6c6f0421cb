"""A row of an elimination: a sum of equations times polynomials in s, free of the unseen coordinates."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TypeVar

from sympy.polys.rings import PolyElement

from modelgen.symbolic.elimination.polynomials import Place, PolynomialSystem
from modelgen.symbolic.equations.signals import Signal

Key = TypeVar("Key")


@dataclass(frozen=True)
class EliminatedRow:
    """sum of polynomial * coordinate = sum of polynomial * force - constants, free of unseen coordinates."""

    bodies: tuple[str, ...]
    eliminated: tuple[str, ...]
    coordinates: Mapping[Place, PolyElement]
    forces: Mapping[str, PolyElement]
    constants: Mapping[Signal, PolyElement]
    cubes: Mapping[Signal, PolyElement]

    @property
    def order(self) -> int:
        """The highest derivative of a coordinate."""
        return max(int(poly.degree(0)) for poly in self.coordinates.values())


def weighted_sum(
    system: PolynomialSystem, weights: Mapping[str, PolyElement], eliminated: tuple[str, ...]
) -> EliminatedRow:
    """Return the sum of the equations of bodies, each times its weight."""
    parts = [(system.equations[body], weight) for body, weight in weights.items()]
    return EliminatedRow(
        tuple(weights),
        eliminated,
        _combine((equation.coordinates, weight) for equation, weight in parts),
        _combine((equation.forces, weight) for equation, weight in parts),
        _combine((equation.constants, weight) for equation, weight in parts),
        _combine((equation.cubes, weight) for equation, weight in parts),
    )


def _combine(parts: Iterable[tuple[Mapping[Key, PolyElement], PolyElement]]) -> dict[Key, PolyElement]:
    total: dict[Key, PolyElement] = {}
    for table, weight in parts:
        for key, value in table.items():
            term = value * weight
            total[key] = total[key] + term if key in total else term
    return {key: value for key, value in total.items() if value}
