"""Base parameters of an arm: the smallest set of combinations that its rows can distinguish.

The combinations come in closed form from the changes of the parameters that no row can see
(`unseen_changes`). That there are no others, and that every factor is right, is proven for each arm by
elimination on its regressor at random points of a prime field: no tolerance is involved.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from random import Random
from typing import Any

from modelgen.errors import ModelError, listed, shortened
from modelgen.spec.arms.arm import LINK_PARAMETERS
from modelgen.symbolic.arms.arm_rows import ArmRows
from modelgen.symbolic.arms.exact_regrouping import Recipe, regrouping
from modelgen.symbolic.arms.expressions.evaluation import residues
from modelgen.symbolic.arms.expressions.prime_field import PRIME, echelon, fraction_of, residue
from modelgen.symbolic.arms.length_field import (
    combination_text,
    factor_residue,
    factor_value,
    length_elements,
)
from modelgen.symbolic.arms.payload_changes import payload_changes, payload_keys
from modelgen.symbolic.arms.unseen_changes import Change, Key, unseen_changes

#: of the random points at which base parameters are proven
SEED = 2002
#: characters of a combination in the reason of a parameter
LONGEST_REASON = 200
UNSEEN = "no motion of the arm shows it"


@dataclass(frozen=True)
class ArmBaseParameter:
    """A column that is kept: the sum of factor * parameter that multiplies it."""

    combination: tuple[tuple[str, Any], ...]

    @property
    def name(self) -> str:
        """Return the combination as text, with named lengths as they are called."""
        return combination_text(self.combination)

    def factors(self, lengths: Mapping[str, float]) -> dict[str, float]:
        """Return the factor of every parameter as a number, at values of the named lengths [m]."""
        return {name: factor_value(factor, lengths) for name, factor in self.combination}


@dataclass(frozen=True)
class ArmBaseModel:
    """Rows of an arm with their base parameters.

    Attributes
    ----------
    rows
        With all columns.
    base
        The base parameters.
    columns
        The column of each of them in `rows`: that of its first parameter.
    identifiable
        Parameters that are base parameters by themselves.
    absent
        For every other parameter that is not known, why it cannot be estimated.
    """

    rows: ArmRows
    base: tuple[ArmBaseParameter, ...]
    columns: tuple[int, ...]
    identifiable: tuple[str, ...]
    absent: Mapping[str, str]

    @property
    def regrouped(self) -> frozenset[str]:
        """Parameters that stand in no base parameter's first place, and are not known."""
        kept = {self.rows.columns[column] for column in self.columns}
        return frozenset(set(self.rows.columns) - kept - set(self.rows.spec.known))


def arm_base_model(rows: ArmRows) -> ArmBaseModel:
    """Find the base parameters of an arm's rows; known parameters are no part of them.

    Raises
    ------
    ModelError
        If nothing is left to estimate, or lengths with names have values at which columns depend on each
        other that are independent otherwise.
    """
    wanted = [column for column, name in enumerate(rows.columns) if name not in rows.spec.known]
    recipes = dependencies(rows, wanted)
    kept = [column for column in wanted if column not in recipes]
    if not kept:
        raise ModelError.at(
            rows.spec.source, "no parameter is left to be estimated", "take at least one out of [known]"
        )
    combinations: dict[int, list[tuple[str, Any]]] = {c: [(rows.columns[c], Fraction(1))] for c in kept}
    for dependent, recipe in recipes.items():
        for column, factor in recipe.items():
            combinations[column].append((rows.columns[dependent], factor))
    base = tuple(ArmBaseParameter(tuple(combinations[column])) for column in kept)
    alone = tuple(b.combination[0][0] for b in base if len(b.combination) == 1)
    return ArmBaseModel(rows, base, tuple(kept), alone, _absent(rows, wanted, base, alone))


def dependencies(
    rows: ArmRows, wanted: Sequence[int], changes: Sequence[Change] | None = None
) -> dict[int, Recipe]:
    """Write every wanted column that depends on earlier ones by those that are kept, proven exactly.

    `changes` that no row can see are found from the arm if they are not given. What they leave out is
    restored from the residues, where the fractions are short enough.
    """
    spec = rows.spec
    elements = length_elements(spec.lengths)
    if changes is None:
        changes = list(unseen_changes(spec, elements, rows.has_base, rows.apart))
        changes += payload_changes(spec, changes)
    places = _places(rows, wanted)
    held = {column for _, column in rows.entries}
    changes = [*changes, *({key: Fraction(1)} for key, c in places.items() if c not in held)]
    random = Random(SEED)
    drawn = {name: random.randrange(1, PRIME) for name in spec.lengths}
    proof = _Proof(rows, wanted, drawn)
    found = regrouping(changes, places)
    if not proof.confirms(found):
        keys = {column: key for key, column in places.items()}
        restored = proof.restored(keys, [c for c in proof.recipes if c not in found])
        found = regrouping([*changes, *restored], places)
        if not proof.confirms(found):
            missing = [rows.columns[c] for c in proof.recipes if c not in found]
            raise ModelError.at(
                spec.source,
                f"no exact combination was found for {listed(missing, most=5)}",
                "write its lengths as numbers, and lengths and angles with fewer digits",
            )
    values = {name: residue(Fraction(str(v))) for name, v in spec.lengths.items() if v is not None}
    if spec.lengths and len(values) == len(spec.lengths):
        special = _Proof(rows, wanted, values)
        lost = [rows.columns[c] for c in special.recipes if c not in found]
        if lost:
            raise ModelError.at(
                f"{spec.source}: lengths",
                f"at these values more columns depend on others than in general: {listed(lost, most=5)}",
                "write the lengths that are zero, or equal, as numbers",
            )
    return found


class _Proof:
    """Which columns depend on which, modulo the prime, at residues of the lengths."""

    def __init__(self, rows: ArmRows, wanted: Sequence[int], lengths: Mapping[str, int]) -> None:
        matrix, leading = echelon(residue_regressor(rows, wanted, lengths))
        self.lengths = lengths
        kept = [wanted[column] for column in leading]
        self.recipes: dict[int, dict[int, int]] = {}
        for place, column in enumerate(wanted):
            if column not in kept:
                entries = zip(kept, matrix[:, place].tolist(), strict=True)
                self.recipes[column] = {other: value for other, value in entries if value}

    def confirms(self, found: Mapping[int, Recipe]) -> bool:
        """Return whether these are all dependent columns, and every factor is right."""
        exact = {
            dependent: {column: factor_residue(factor, self.lengths) for column, factor in recipe.items()}
            for dependent, recipe in found.items()
        }
        return exact == self.recipes

    def restored(self, keys: Mapping[int, Key], missing: Sequence[int]) -> list[Change]:
        """Return the changes of missing columns with their factors as fractions, where these are short."""
        changes = []
        for column in missing:
            factors = {other: fraction_of(value) for other, value in self.recipes[column].items()}
            change: Change = {keys[other]: -f for other, f in factors.items() if f is not None}
            if len(change) == len(factors):
                changes.append({**change, keys[column]: Fraction(1)})
        return changes


def _places(rows: ArmRows, wanted: Sequence[int]) -> dict[Key, int]:
    """Return the column of every wanted parameter, by its place in the arm."""
    of_link = {
        name: (joint.name, kind)
        for joint in rows.spec.joints
        for name, kind in zip(joint.link, LINK_PARAMETERS, strict=False)
    }
    of_link |= payload_keys(rows.spec)
    names = [(rows.columns[column], column) for column in wanted]
    return {of_link.get(name, ("", name)): column for name, column in names}


def _absent(
    rows: ArmRows, wanted: Sequence[int], base: Sequence[ArmBaseParameter], alone: Sequence[str]
) -> dict[str, str]:
    inside: dict[str, list[ArmBaseParameter]] = {rows.columns[column]: [] for column in wanted}
    for parameter in base:
        for name, _ in parameter.combination:
            inside[name].append(parameter)
    return {name: _reason(name, own, rows.lost) for name, own in inside.items() if name not in alone}


def _reason(name: str, inside: Sequence[ArmBaseParameter], lost: Mapping[str, str]) -> str:
    """Return why a parameter has no value of its own: the sum that it begins, or what those begin with."""
    if not inside:
        return lost.get(name, UNSEEN)
    first = [parameter.combination[0][0] for parameter in inside]
    if first == [name]:
        return f"only in combination: {shortened(inside[0].name, LONGEST_REASON)}"
    return f"only in combination, in those of {listed(first)}"


def residue_regressor(rows: ArmRows, columns: Sequence[int], lengths: Mapping[str, int]) -> list[list[int]]:
    """Return the named columns at random points of the field, one list a row and sample.

    There are so many samples that the row of the first joint alone, which sees every link, decides the rank.
    """
    place = {column: k for k, column in enumerate(columns)}
    keys = [key for key in rows.entries if key[1] in place]
    samples = len(columns) + 8 if len(rows.names) < 4 else 3 * len(columns) // len(rows.names) + 8
    values = residues(rows.graph, [rows.entries[key] for key in keys], samples, SEED, lengths)
    matrix = [[[0] * len(columns) for _ in rows.names] for _ in range(samples)]
    for (row, column), found in zip(keys, values, strict=True):
        for sample, value in zip(matrix, found.values, strict=True):
            sample[row][place[column]] = value
    return [row for sample in matrix for row in sample]
