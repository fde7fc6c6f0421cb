"""Elimination: rows without the coordinates that no sensor reads.

Take one more equation than there are unseen coordinates in them; the maximal minors of their columns for
those coordinates are polynomials in s that cancel the unseen coordinates (Cramer's rule), and dividing by
their common factor makes the row of lowest order. Every measured body whose equation holds unseen
coordinates gives one such row with the equations of the unseen bodies themselves; where an unseen group has
several measured neighbours, other choices of equations may need fewer derivatives and are tried as well.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import reduce
from itertools import combinations

from sympy.polys.rings import PolyElement

from modelgen.errors import ModelError
from modelgen.progress import counted
from modelgen.symbolic.elimination.common_factor import common_factor, exact_quotient
from modelgen.symbolic.elimination.eliminated_row import EliminatedRow, weighted_sum
from modelgen.symbolic.elimination.length_limit import Choice, LengthLimit
from modelgen.symbolic.elimination.polynomials import Coordinates, PolynomialSystem, polynomial_system, unit
from modelgen.symbolic.equations.newton import Equation, MotionEquations

#: Alternative choices of equations are tried up to this many; beyond, each measured body's own row is kept.
MOST_CHOICES = 64
#: Around an unseen group, all seen coordinates but one may be eliminated, too, if they are no more than this.
MOST_SEEN = 3


def eliminated_rows(
    motion: MotionEquations, coordinates: Coordinates, limit: LengthLimit
) -> Iterator[EliminatedRow]:
    """Yield rows for all equations that hold unseen coordinates, those to be preferred first.

    Raises
    ------
    ModelError
        If too many unseen coordinates would have to be eliminated at once, in rows that are too long, or
        something nonlinear.
    """
    unseen = unseen_by_equation(motion, coordinates)
    choices, alone = (
        list(_choices(coordinates.unseen, unseen, limit)),
        list(_alone(motion, coordinates, unseen)),
    )
    short = set(limit.short([*choices, *alone], {body for body, held in unseen.items() if held}))
    equation_of = {equation.body: equation for equation in motion.equations}

    def rows(choices: Iterable[Choice]) -> Iterator[EliminatedRow]:
        for bodies, others in counted([choice for choice in choices if choice in short], "rows eliminated"):
            # A ring of its own for every row: the cost of a polynomial grows with the generators of its ring.
            system = polynomial_system(motion.spec, [equation_of[body] for body in bodies], coordinates)
            row = _eliminate(system, bodies, others, limit.where)
            if row is not None:
                yield row

    # Rows that a force enters come first: they fix the scale of their parameters.
    found = list(rows(choices))
    yield from sorted(found, key=lambda row: (not row.forces, row.order, len(row.bodies)))
    yield from rows(alone)


def unseen_by_equation(motion: MotionEquations, coordinates: Coordinates) -> dict[str, frozenset[str]]:
    """Return the unseen coordinates that every body's equation holds."""
    return {equation.body: frozenset(_unseen_in(equation, coordinates)) for equation in motion.equations}


def _unseen_in(equation: Equation, coordinates: Coordinates) -> Iterator[str]:
    reached = {functional for body in equation.bodies for functional, _ in coordinates.table[body]}
    return (body for body in coordinates.unseen if unit(body) in reached)


def _choices(
    bodies: Sequence[str], unseen: Mapping[str, frozenset[str]], limit: LengthLimit
) -> Iterator[Choice]:
    """Yield (equations, unseen coordinates in them), one equation more than coordinates."""
    order = {body: index for index, body in enumerate(unseen)}
    groups = _groups(bodies, unseen.values())
    group_of = {body: group for group in groups for body in group}
    tried: dict[tuple[str, ...], tuple[str, ...]] = {}
    for body, held in unseen.items():
        if held and body not in group_of:
            inside = sorted({b for other in held for b in group_of[other]}, key=order.__getitem__)
            limit.refuse_many(inside)
            tried.setdefault(tuple(sorted([*inside, body], key=order.__getitem__)), tuple(inside))
    for group in groups:
        pool = [body for body, held in unseen.items() if held and held <= frozenset(group)]
        for equations in _few(combinations(pool, len(group) + 1)):
            tried.setdefault(equations, group)
    yield from tried.items()


def _alone(
    motion: MotionEquations, coordinates: Coordinates, unseen: Mapping[str, frozenset[str]]
) -> Iterator[Choice]:
    """Yield choices that leave one coordinate of those around an unseen group: seen ones go as well.

    Their orders are high, but little can be added to such a row: once the whole chain is around the group, it
    is the transfer from the forces.
    """
    held = {equation.body: equation.bodies for equation in motion.equations}
    for group in _groups(coordinates.unseen, unseen.values()):
        reached, around = set(group), {other for body in group for other in held[body]}
        while around != reached:
            reached, around = around, {other for body in around for other in held[body]}
            bodies = tuple(body for body in held if body in reached)
            seen = [body for body in bodies if body not in group]
            if len(seen) > MOST_SEEN or not all(
                unit(body) in coordinates.measured and unseen[body] <= set(group) for body in seen
            ):
                break
            if len(seen) > 1:
                for kept in seen:
                    yield bodies, (*group, *(body for body in seen if body != kept))


def _few(choices: Iterable[tuple[str, ...]]) -> list[tuple[str, ...]]:
    listed = [choice for _, choice in zip(range(MOST_CHOICES + 1), choices, strict=False)]
    return listed if len(listed) <= MOST_CHOICES else []


def _groups(bodies: Sequence[str], held_together: Iterable[frozenset[str]]) -> list[tuple[str, ...]]:
    """Group unseen bodies that are tied to each other by their own equations."""
    parent = {body: body for body in bodies}

    def root(body: str) -> str:
        while parent[body] != body:
            body = parent[body]
        return body

    for held in held_together:
        first, *rest = sorted(held) or [""]
        for other in rest:
            parent[root(other)] = root(first)
    groups: dict[str, list[str]] = {}
    for body in bodies:
        groups.setdefault(root(body), []).append(body)
    return [tuple(group) for group in groups.values()]


def _eliminate(
    system: PolynomialSystem, equations: tuple[str, ...], unseen: tuple[str, ...], where: str
) -> EliminatedRow | None:
    zero = system.ring.zero
    columns = [
        [system.equations[body].coordinates.get(("", unit(other)), zero) for other in unseen]
        for body in equations
    ]
    multipliers = []
    for skipped in range(len(equations)):
        minor = _determinant([row for index, row in enumerate(columns) if index != skipped], zero)
        multipliers.append(-minor if skipped % 2 else minor)
    if not any(multipliers):
        return None
    common = reduce(common_factor, [m for m in multipliers if m])
    weights = {body: exact_quotient(m, common) for body, m in zip(equations, multipliers, strict=True) if m}
    _refuse_nonlinear(system, weights, unseen, where)
    return weighted_sum(system, weights, unseen)


def _determinant(matrix: list[list[PolyElement]], zero: PolyElement) -> PolyElement:
    """Expand by the first row, skipping zeros: the matrices are small and sparse."""
    if not matrix:
        return zero + 1
    total = zero
    for column, entry in enumerate(matrix[0]):
        if entry:
            rest = [row[:column] + row[column + 1 :] for row in matrix[1:]]
            term = entry * _determinant(rest, zero)
            total = total - term if column % 2 else total + term
    return total


def _refuse_nonlinear(
    system: PolynomialSystem, weights: Mapping[str, PolyElement], unseen: Sequence[str], where: str
) -> None:
    for body in weights:
        equation = system.equations[body]
        if equation.cubes:
            raise ModelError.at(
                where,
                f"the cubic stiffness at {body} would have to be eliminated with {', '.join(unseen)}",
                f"add a position sensor on {', '.join(unseen)}",
            )
        for kind, functional in equation.coordinates:
            if kind and functional[0][0] in unseen:
                raise ModelError.at(
                    where,
                    f"the asymmetric viscous friction of {functional[0][0]} would have to be eliminated",
                    f"add a sensor on {functional[0][0]}, or make its friction symmetric",
                )
