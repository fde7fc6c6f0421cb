"""Eliminations that are too long are refused in advance, with the number of their terms."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from modelgen.errors import ModelError, listed
from modelgen.symbolic.elimination.multipliers import MOST_TERMS
from modelgen.symbolic.elimination.polynomials import Coordinates, Functional, unit
from modelgen.symbolic.elimination.term_count import TermCount, TermCounter
from modelgen.symbolic.equations.identifiability import (
    FIELD,
    PRIME,
    add_modular,
    modular,
    random_point,
    random_values,
    reduce_modular,
)
from modelgen.symbolic.equations.newton import MotionEquations

#: More unseen coordinates than this are not eliminated at once: each adds two derivatives to the rows.
LARGEST_ELIMINATION = 4
#: Python 3.11 and 3.12 read no sum of more than 2985 terms: a module with such a coefficient is lost.
LONGEST_COEFFICIENT = 2500
#: What all eliminations of a sensor set may multiply: a quarter of a microsecond and eight bytes each.
MOST_FACTORS = 20_000_000
#: What may be added up to see whether rows are unique, over all of them: sixty microseconds each.
MOST_ADDITIONS = 300_000
#: Coefficients that are counted at most, in three seconds; what is longer than that is too long in any case.
MOST_COUNTED = 200_000
#: So many ways to make a row may fail where others were left out, or for every row; each takes half a second.
MOST_FAILED = 3

#: equations, and the coordinates in them that the row eliminates
Choice = tuple[tuple[str, ...], tuple[str, ...]]


class LengthLimit:
    """What can be eliminated for one choice of coordinates, and what is said where something cannot."""

    def __init__(self, motion: MotionEquations, coordinates: Coordinates, where: str) -> None:
        self._motion = motion
        self._coordinates = coordinates
        self.where = where
        self._neighbours = {equation.body: equation.bodies for equation in motion.equations}
        self._counter = TermCounter(motion.spec, motion.equations, coordinates)
        self._too_long: ModelError | None = None

    def refuse_many(self, inside: Sequence[str]) -> None:
        """Refuse more than LARGEST_ELIMINATION unseen coordinates.

        Raises
        ------
        ModelError
        """
        if len(inside) > LARGEST_ELIMINATION:
            power = self._counter.decimal_power(inside)
            raise ModelError.at(
                self.where,
                f"{len(inside)} bodies that hang together have no sensor ({listed(inside)}); at most "
                f"{LARGEST_ELIMINATION} can be eliminated: the determinant of these has more than 10^{power} "
                "terms",
                self._remedy(),
            )

    def short(self, choices: Sequence[Choice], holders: Collection[str]) -> list[Choice]:
        """Return the choices that are short enough, in their order; `holders` have unseen coordinates.

        Raises
        ------
        ModelError
            If some are too long, and the others cannot give as many independent rows as there are more
            equations than unseen coordinates.
        """
        counts: dict[Choice, TermCount] = {}
        for choice in choices:
            if self._counter.counted <= MOST_COUNTED:
                counts[choice] = self._counter.row(*choice)
        found, factors = set(), 0
        for choice in sorted(counts, key=lambda choice: counts[choice].factors):
            factors += counts[choice].factors
            if factors <= MOST_FACTORS and counts[choice].longest <= LONGEST_COEFFICIENT:
                found.add(choice)
        kept = [choice for choice in choices if choice in found]
        missing = len(holders) - len(self._coordinates.unseen)
        if len(kept) < len(choices):
            count = _together(counts.values())
            more = "" if len(counts) == len(choices) else "more than "
            unseen = listed(self._coordinates.unseen)
            self._too_long = ModelError.at(
                self.where,
                f"the rows without a sensor on {unseen} would have {more}{count.total:,} terms, "
                f"{count.longest:,} of them in one coefficient, and {count.factors:,} factors to multiply; "
                f"at most {LONGEST_COEFFICIENT:,} terms in a coefficient and {MOST_FACTORS:,} factors can be "
                "derived",
                self._remedy(),
            )
            if self._independent(kept, holders) < missing:
                raise self._too_long
        return kept

    def refuse_failed(self, failed: int, left: int) -> None:
        """Refuse where so many ways have failed, and so many rows are missing still.

        Raises
        ------
        ModelError
        """
        if self._too_long is not None and failed >= MOST_FAILED:
            raise self._too_long
        if failed >= MOST_FAILED * (4 + left):
            self.refuse_missing(failed)

    def refuse_missing(self, failed: int) -> None:
        """Refuse where rows are missing and there is no way left to make them.

        Raises
        ------
        ModelError
        """
        if self._too_long is not None:
            raise self._too_long
        unseen = listed(self._coordinates.unseen)
        raise ModelError.at(
            self.where,
            f"without a sensor on {unseen} the coefficients of the rows cannot be distinguished"
            + (
                f" ({failed} sums of rows have more than {MOST_TERMS} terms in a multiplier)"
                if failed
                else ""
            ),
            f"add a sensor on one of {unseen}" + (", or on all" if len(self._coordinates.unseen) > 1 else ""),
        )

    def refuse_unlike(self, additions: int) -> None:
        """Refuse where too much would have to be added up to see whether rows are unique.

        Raises
        ------
        ModelError
        """
        if additions > MOST_ADDITIONS:
            unseen = listed(self._coordinates.unseen)
            raise ModelError.at(
                self.where,
                f"the rows without a sensor on {unseen} take {additions:,} additions to know whether they "
                f"are unique; at most {MOST_ADDITIONS:,} are done",
                f"add a position sensor on {unseen}",
            )

    def _independent(self, choices: Sequence[Choice], holders: Collection[str]) -> int:
        """Return the number of independent combinations of the holders' equations, at a random point."""
        point = random_values(self._motion.spec, FIELD)
        s = random_point(["s derivative"])["s derivative"]
        entries: dict[str, dict[Functional, int]] = {}
        for equation in self._motion.equations:
            row = entries.setdefault(equation.body, {})
            for parameter, signal, coefficient in equation.terms:
                if signal.kind == "coordinate" and parameter is not None:
                    value = modular(coefficient) * int(point[parameter]) * pow(s, signal.order, PRIME)
                    for functional, weight in self._coordinates.table[signal.name]:
                        add_modular(row, {functional: modular(weight)}, value)
        pivots: dict[str, dict[str, int]] = {}
        for bodies, others in choices:
            vector = _cancelling(bodies, {unit(other) for other in others}, entries)
            vector = {body: value for body, value in vector.items() if body in holders}
            reduce_modular(vector, pivots)
            if vector:
                pivots[next(iter(vector))] = vector
        return len(pivots)

    def _remedy(self) -> str:
        """Return position sensors with which all is short: on the unseen, less those that may stay so."""
        if any(len(table) > 1 for table in self._coordinates.table.values()):
            return f"add a position sensor on {listed(self._coordinates.unseen)}"
        left_out: set[str] = set()
        done: dict[frozenset[str], TermCount] = {}
        enough = self._counter.counted + MOST_COUNTED
        for body in self._coordinates.unseen:
            group = self._group(body, left_out)
            if group is None or self._counter.counted > enough:
                continue
            others = {other: count for other, count in done.items() if not other & group}
            count = self._own_rows(group)
            factors = count.factors + sum(other.factors for other in others.values())
            if count.longest <= LONGEST_COEFFICIENT and factors <= MOST_FACTORS:
                done = {**others, group: count}
                left_out.add(body)
        wanted = [body for body in self._coordinates.unseen if body not in left_out]
        return f"add a position sensor on {listed(wanted)}"

    def _group(self, body: str, unseen: Collection[str]) -> frozenset[str] | None:
        """Return the unseen bodies that equations would tie to a body; None if they are too many."""
        group, frontier = {body}, [body]
        while frontier:
            here = frontier.pop()
            for equation in self._neighbours[here]:
                for other in self._neighbours[equation]:
                    if other in unseen and other not in group:
                        group.add(other)
                        frontier.append(other)
                        if len(group) > LARGEST_ELIMINATION:
                            return None
        return frozenset(group)

    def _own_rows(self, group: frozenset[str]) -> TermCount:
        """Count the rows of the seen neighbours of a group with the equations of the group itself."""
        inside = tuple(body for body in self._neighbours if body in group)
        around = dict.fromkeys(
            other for body in inside for other in self._neighbours[body] if other not in group
        )
        counts: list[TermCount] = []
        for body in around:
            if sum(count.factors for count in counts) <= MOST_FACTORS:
                counts.append(self._counter.row((*inside, body), inside))
        return _together(counts)


def _together(counts: Collection[TermCount]) -> TermCount:
    """Return the counts of rows together."""
    return TermCount(
        sum(count.total for count in counts),
        max((count.longest for count in counts), default=0),
        sum(count.factors for count in counts),
    )


def _cancelling(
    bodies: Sequence[str], columns: Collection[Functional], entries: dict[str, dict[Functional, int]]
) -> dict[str, int]:
    """Return the multipliers, modulo PRIME, that cancel columns of equations; empty if there are several."""
    pivots: dict[object, dict[object, int]] = {}
    found: list[dict[str, int]] = []
    for body in bodies:
        vector: dict[object, int] = {("equation", body): 1}
        vector.update({key: value for key, value in entries[body].items() if key in columns})
        reduce_modular(vector, pivots)
        lead = next((key for key in vector if key in columns), None)
        if lead is None:
            found.append({str(key[1]): value for key, value in vector.items()})  # type: ignore[index]
        else:
            pivots[lead] = vector
    return found[0] if len(found) == 1 else {}
