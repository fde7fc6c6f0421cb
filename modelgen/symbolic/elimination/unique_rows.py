"""Rows of an elimination whose coefficients are unique: no other combination can be added to them.

A row from the minors is kept where no other combination of the equations has only its signals. Otherwise as
many of its signals as there are other combinations are eliminated, and the remaining row is unique.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

from sympy import QQ

from modelgen.spec.chain import ChainSpec
from modelgen.symbolic.elimination.ambiguity import (
    Combination,
    Slot,
    TooManyDigits,
    at_point,
    closest,
    combinations_on,
    slots,
    unique_on_their_slots,
)
from modelgen.symbolic.elimination.eliminated_row import EliminatedRow, weighted_sum
from modelgen.symbolic.elimination.elimination import unseen_by_equation
from modelgen.symbolic.elimination.length_limit import LengthLimit
from modelgen.symbolic.elimination.multipliers import TooLong, exact_multipliers
from modelgen.symbolic.elimination.polynomials import Coordinates, by_order, polynomial_system
from modelgen.symbolic.equations.identifiability import (
    FIELD,
    PRIME,
    add_modular,
    random_point,
    random_values,
    reduce_modular,
)
from modelgen.symbolic.equations.newton import Equation, MotionEquations
from modelgen.symbolic.equations.sensor_span import Sensing

#: More multipliers than this make coefficients that no one could read or check: such a row is passed over.
MOST_MULTIPLIERS = 24
#: Bits of the rational numbers that decide which coefficients are small; six bodies take some hundred.
LONGEST_NUMBER = 1500
#: Damping against stiffness and inertia where it is decided which coefficients are small.
LIGHT = QQ(1, 1000)


class UniqueRows:
    """Chooses rows for one set of coordinates; `sensing` gives how often each will be differentiated."""

    def __init__(self, motion: MotionEquations, coordinates: Coordinates, sensing: Sensing) -> None:
        self.motion = motion
        self.coordinates = coordinates
        self.sensing = sensing
        self._point = random_values(motion.spec, FIELD)
        self._light = _lightly_damped(motion.spec)
        self._neighbours = {equation.body: equation.bodies for equation in motion.equations}
        self._too_long: set[tuple[Any, ...]] = set()
        self._s = random_point(["s derivative"])["s derivative"]

    def choose(self, candidates: Iterable[EliminatedRow], limit: LengthLimit) -> Iterator[EliminatedRow]:
        """Yield independent unique rows, as many as there are more equations than unseen coordinates.

        Raises
        ------
        ModelError
            If the candidates give too few.
        """
        unseen = unseen_by_equation(self.motion, self.coordinates)
        holders = {body for body, held in unseen.items() if held}
        missing = len(holders) - len(self.coordinates.unseen)
        pivots: dict[str, dict[str, int]] = {}
        additions = 0
        for candidate in candidates:
            if not missing:
                return
            near = self._near(candidate)
            own = (len(near) * (candidate.order - 1)) ** 2
            limit.refuse_unlike(additions + missing * own)
            additions += own
            for combination, make in self._versions(candidate, near):
                vector = self._of_bodies(combination, holders)
                reduce_modular(vector, pivots)
                row = make() if vector else None
                if row is not None:
                    pivots[next(iter(vector))] = vector
                    missing -= 1
                    yield row
                    break
                limit.refuse_failed(len(self._too_long), missing)
        if missing:
            limit.refuse_missing(len(self._too_long))

    def _versions(
        self, candidate: EliminatedRow, nearby: Sequence[Equation]
    ) -> Iterator[tuple[Combination, Callable[[], EliminatedRow | None]]]:
        """Yield what is unique on the signals of a candidate, best first, and how it is made."""
        constants = not self._differentiated(candidate)
        near = polynomial_system(self.motion.spec, nearby, self.coordinates)
        allowed = dict(slots(candidate))

        def basis_at(point: Mapping[str, Any], field: Any, bits: int | None = None) -> list[Combination]:
            equations = {body: at_point(slots(e), point, field) for body, e in near.equations.items()}
            return combinations_on(allowed, equations, field.one, candidate.order - 2, constants, bits)

        basis = basis_at(self._point, FIELD)
        if len(basis) == 1:
            yield basis[0], lambda: candidate
            return
        counting = ((slot, value) for slot, value in allowed.items() if constants or slot[0] != "constants")
        own = at_point(counting, self._light, QQ)
        rank = _highest_first(candidate)
        kept = min(own, key=rank)
        lowest = unique_on_their_slots(basis, rank)
        try:
            given_up = closest(own, basis_at(self._light, QQ, LONGEST_NUMBER), kept)
            nearest = unique_on_their_slots(basis, lambda slot: (slot in given_up, *rank(slot)))[:1]
        except TooManyDigits:
            nearest = []
        for combination in (*nearest, *lowest):
            if len(combination.multipliers) <= MOST_MULTIPLIERS:
                yield combination, partial(self._exact, combination, candidate, constants)

    def _of_bodies(self, combination: Combination, bodies: Collection[str]) -> dict[str, int]:
        """Return the multipliers of some bodies' equations as polynomials at a random s."""
        vector: dict[str, int] = {}
        for (body, power), value in combination.multipliers.items():
            if body in bodies:
                add_modular(vector, {body: pow(self._s, power, PRIME)}, int(value))
        return vector

    def _exact(
        self, combination: Combination, candidate: EliminatedRow, constants: bool
    ) -> EliminatedRow | None:
        """Return a combination in exact polynomials, or None if they are too long."""
        # what is unique on its signals is the same from whichever candidate it comes
        key = (frozenset(combination.multipliers), frozenset(combination.slots), constants)
        if key in self._too_long:
            return None
        wanted = {body for body, _ in combination.multipliers}
        equations = [equation for equation in self.motion.equations if equation.body in wanted]
        system = polynomial_system(self.motion.spec, equations, self.coordinates)
        tables = {body: dict(slots(equation)) for body, equation in system.equations.items()}
        try:
            found = exact_multipliers(tuple(combination.multipliers), combination.slots, tables, constants)
        except TooLong:
            self._too_long.add(key)
            return None
        s, zero = system.ring.gens[0], system.ring.zero
        weights = {
            body: sum((value * s**power for (of, power), value in found.items() if of == body), zero)
            for body in system.equations
        }
        return weighted_sum(system, weights, candidate.eliminated)

    def _differentiated(self, row: EliminatedRow) -> bool:
        """Return whether the sensors give the row only after a differentiation, which removes constants."""
        return any(
            self.sensing.level(dict(functional), order) != 0
            for (_, functional), poly in row.coordinates.items()
            for order, _ in by_order(poly)
        )

    def _near(self, row: EliminatedRow) -> list[Equation]:
        """Return the equations that hold no other signals than those of a row.

        A multiplier's degree falls by one at least from a body to the next that is not in the row.
        """
        reached = dict.fromkeys([*row.bodies, *(body for _, f in row.coordinates for body, _ in f)])
        frontier = list(reached)
        for _ in range(row.order - 2):
            frontier = [n for body in frontier for n in self._neighbours[body] if n not in reached]
            reached.update(dict.fromkeys(frontier))
        return [equation for equation in self.motion.equations if equation.body in reached]


def _lightly_damped(spec: ChainSpec) -> dict[str, Any]:
    """Return rational values as machines have them: what damps is small against what swings."""
    point = random_values(spec, QQ)
    for parameter in spec.parameters:
        if parameter.name not in spec.known:
            size = LIGHT if parameter.role in ("damping", "viscous") else 1
            point[parameter.name] = QQ(int(point[parameter.name]) % 1000 + 500, 1000) * size
    return point


def _highest_first(row: EliminatedRow) -> Callable[[Slot], tuple[Any, ...]]:
    """Give up the highest derivatives first, constants late, and last the force that fixes the scale."""
    lowest = min((order for poly in row.forces.values() for order, _ in by_order(poly)), default=0)

    def badness(slot: Slot) -> tuple[Any, ...]:
        table, key, order = slot
        needed = 0 if table == "forces" and order == lowest else 1 if table == "constants" else 2
        return needed, order, table == "coordinates", str(key)

    return badness
