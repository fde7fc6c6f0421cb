"""Which other equations hold only the signals of a row: whether its coefficients are unique.

Along a motion every combination of the equations of motion with polynomials in s is zero. If another
combination lives on the signals of a row, any multiple of it can be added without changing what the row
measures: its coefficients cannot be distinguished. The combinations that live on given signals are the null
space of a matrix; its reduced echelon form gives the ones that are unique on the signals they need. All this
is decided at a random point of an exact field (a prime field, or the rationals), so no tolerance is involved.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from sympy.polys.rings import PolyElement

from modelgen.symbolic.elimination.polynomials import Place, by_order
from modelgen.symbolic.equations.identifiability import value_at
from modelgen.symbolic.equations.sensor_span import add_scaled
from modelgen.symbolic.equations.signals import Signal

#: a derivative in a row: (table, coordinate or force or constant, order); tables as in `Tables`
Slot = tuple[str, Any, int]
#: what one equation is multiplied by: (body, power of s)
Multiplier = tuple[str, int]


class Tables(Protocol):
    """What equations and rows have in common: polynomials in s by what they multiply."""

    @property
    def coordinates(self) -> Mapping[Place, PolyElement]: ...  # noqa: D102
    @property
    def forces(self) -> Mapping[str, PolyElement]: ...  # noqa: D102
    @property
    def constants(self) -> Mapping[Signal, PolyElement]: ...  # noqa: D102
    @property
    def cubes(self) -> Mapping[Signal, PolyElement]: ...  # noqa: D102


@dataclass(frozen=True)
class Combination:
    """A combination of equations at a random point: its multipliers, and what it leaves by slot."""

    multipliers: Mapping[Multiplier, Any]
    slots: Mapping[Slot, Any]

    def cleared(self, slot: Slot, pivot: Combination) -> Combination:
        """Subtract the multiple of another combination that leaves nothing in a slot."""
        if slot not in self.slots:
            return self
        factor = -self.slots[slot] / pivot.slots[slot]
        return Combination(
            add_scaled(self.multipliers, pivot.multipliers, factor),
            add_scaled(self.slots, pivot.slots, factor),
        )


def slots(tables: Tables) -> Iterator[tuple[Slot, PolyElement]]:
    """Yield every derivative in an equation or a row with its coefficient.

    The derivative of a constant is zero: away from reversals, that of sign() as well.
    """
    for name in ("coordinates", "forces", "cubes"):
        for key, poly in getattr(tables, name).items():
            yield from (((name, key, order), value) for order, value in by_order(poly))
    for signal, poly in tables.constants.items():
        yield from ((("constants", signal, 0), value) for order, value in by_order(poly) if not order)


class TooManyDigits(Exception):
    """Rational numbers have grown so long that to go on would take minutes."""


def combinations_on(
    allowed: Collection[Slot],
    equations: Mapping[str, Mapping[Slot, Any]],
    one: Any,
    highest: int,
    constants: bool,
    bits: int | None = None,
) -> list[Combination]:
    """Return a basis of the combinations of equations that leave allowed slots only.

    Parameters
    ----------
    allowed : collection of Slot
    equations : mapping of str to mapping of Slot to number
        By body, as elements of a field; see `at_point`.
    one : number
        The field's one.
    highest : int
        The highest power of s that multiplies an equation.
    constants : bool
        Whether constants count; in a row that is differentiated they do not.
    bits : int, optional
        How long rational numbers may become.

    Raises
    ------
    TooManyDigits
    """
    pivots: dict[Slot, Combination] = {}
    found = []
    for body, equation in equations.items():
        for power in range(highest + 1):
            combination = Combination({(body, power): one}, dict(raised(equation, power, constants)))
            while lead := next((slot for slot in combination.slots if slot in pivots), None):
                combination = combination.cleared(lead, pivots[lead])
                if bits is not None and _bits(combination) > bits:
                    raise TooManyDigits
            lead = next((slot for slot in combination.slots if slot not in allowed), None)
            if lead is None:
                found.append(combination)
            else:
                pivots[lead] = combination
    return found


def _bits(combination: Combination) -> int:
    """Return the length of one of its numbers; all are about as long."""
    value = next(iter(combination.slots.values()), 0)
    return int(value.numerator).bit_length() + int(value.denominator).bit_length()


def raised(equation: Mapping[Slot, Any], power: int, constants: bool) -> Iterator[tuple[Slot, Any]]:
    """Yield the slots of an equation that is multiplied by a power of s."""
    for (table, key, order), value in equation.items():
        if table != "constants":
            yield (table, key, order + power), value
        elif constants and not power:
            yield (table, key, 0), value


def unique_on_their_slots(
    basis: Iterable[Combination], badness: Callable[[Slot], tuple[Any, ...]]
) -> list[Combination]:
    """Return the reduced echelon form of a basis: each has slots that no other combination has.

    The slots of highest badness are cleared first; the best combination comes first: without the worst slots.
    """
    rows = list(basis)
    done: list[Combination] = []
    for slot in sorted({slot for row in rows for slot in row.slots}, key=badness, reverse=True):
        pivot = next((row for row in rows if slot in row.slots), None)
        if pivot is not None:
            rows = [row.cleared(slot, pivot) for row in rows if row is not pivot]
            done = [*(row.cleared(slot, pivot) for row in done), pivot]
    return done[::-1]


def closest(row: Mapping[Slot, Any], basis: Iterable[Combination], kept: Slot) -> list[Slot]:
    """Return the slots that a row gives up so that it becomes unique and its coefficients change least.

    Elimination with complete pivoting on the combinations in units of the row's own coefficients.

    Parameters
    ----------
    row : mapping of Slot to number
        Its coefficients, none of them zero, at the point of the basis, over an ordered field.
    basis : iterable of Combination
        All that lives on the row's slots, the row itself included.
    kept : Slot
        The slot that fixes the scale: it is not given up.
    """
    left = [{slot: value / row[slot] for slot, value in combination.slots.items()} for combination in basis]
    own = dict.fromkeys(row, row[kept] / row[kept])
    left = [add_scaled(scaled, own, -scaled[kept]) if kept in scaled else scaled for scaled in left]
    given_up = []
    while left := [scaled for scaled in left if scaled]:
        largest = [max(map(abs, scaled.values())) for scaled in left]
        slot, pivot = max(
            ((slot, scaled, top) for scaled, top in zip(left, largest, strict=True) for slot in scaled),
            key=lambda found: (abs(found[1][found[0]]) / found[2], found[0][2], str(found[0])),
        )[:2]
        given_up.append(slot)
        left = [
            add_scaled(scaled, pivot, -scaled[slot] / pivot[slot]) if slot in scaled else scaled
            for scaled in left
            if scaled is not pivot
        ]
    return given_up


def at_point(
    tables: Iterable[tuple[Slot, PolyElement]], point: Mapping[str, Any], field: Any
) -> dict[Slot, Any]:
    """Evaluate coefficients at a point of a field; those that vanish there are left out."""
    return {slot: number for slot, value in tables if (number := value_at(value, point, field))}
