"""Base parameters: the smallest set of combinations that the rows can distinguish.

As Gautier (1991): draw a random regressor, decompose it by QR, and regroup the dependent columns on the
independent ones, beta = x_1 + R_1^-1 R_2 x_2. Exact elimination on the rows themselves gives the same
regrouping in exact rationals; both must agree in rank and in every factor, and the rationals are kept.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import ModelError, signed_sum
from modelgen.symbolic.equations.equation_sums import exact_levers
from modelgen.symbolic.equations.identifiability import identifiable_parameters
from modelgen.symbolic.equations.row import IdentificationRows
from modelgen.symbolic.equations.signals import Exact, short_text
from modelgen.symbolic.exact_dependencies import exact_dependencies

SEED = 2002
#: |R_ii| below this fraction of |R_11| counts as zero; the random columns have unit scale.
RANK_TOLERANCE = 1e-9
#: A factor of the numerical regrouping may differ from its exact rational by this share.
REGROUPING_TOLERANCE = 1e-6
#: The dense QR costs (number of parameters)^3; longer chains rely on the exact elimination alone.
LARGEST_QR = 600
#: Python 3.11 and 3.12 read no sum of more than 2985 terms; nor does anyone else.
LONGEST_SUM = 2500
#: Squares of it, times parameters of any size, are floating point numbers still.
LARGEST_FACTOR = 10**50
#: A sum of more parameters is shown by its first ones.
LONGEST_SHOWN = 40


@dataclass(frozen=True)
class BaseParameter:
    """A column of the reduced regressor: the sum of factor * physical parameter that multiplies it."""

    combination: tuple[tuple[str, Exact], ...]

    @property
    def name(self) -> str:
        """Return the combination as text, for example ``O_m + 1/2*O_c``; long factors to six digits."""
        return signed_sum(
            (f < 0, name if abs(f) == 1 else f"{short_text(f if f > 0 else -f)}*{name}")
            for name, f in self.combination
        )


@dataclass(frozen=True)
class BaseModel:
    """Rows with their base parameters: what a module is generated from.

    `absent` maps every physical parameter that cannot be identified to the reason.
    """

    rows: IdentificationRows
    base: tuple[BaseParameter, ...]
    identifiable: tuple[str, ...]
    absent: Mapping[str, str]


def base_model(rows: IdentificationRows) -> BaseModel:
    """Find the base parameters of the rows, and the physical parameters that they determine.

    Raises
    ------
    ModelError
        If nothing is left to estimate.
    """
    wanted = [p.name for p in rows.spec.parameters if p.name not in rows.spec.known]
    _refuse_extreme(rows)
    columns = _columns(rows)
    present = [name for name in (*wanted, *rows.composites) if name in columns]
    if not present:
        raise ModelError.at(
            f"{rows.spec.source}: sensors.{rows.sensor_set}",
            "no parameter is left to be estimated",
            "take at least one parameter out of [known]",
        )
    base = regroup(rows, present)
    _refuse_long(rows, base)
    identifiable = _identifiable(rows, wanted, base)
    return BaseModel(rows, base, identifiable, _reasons(rows, wanted, base, identifiable))


def _identifiable(
    rows: IdentificationRows, wanted: Sequence[str], base: Sequence[BaseParameter]
) -> tuple[str, ...]:
    if not rows.composites:
        alone = {b.combination[0][0] for b in base if len(b.combination) == 1}
        return tuple(name for name in wanted if name in alone)
    columns = [[(rows.composites.get(name, name), factor) for name, factor in b.combination] for b in base]
    return identifiable_parameters(wanted, columns)


def _reasons(
    rows: IdentificationRows,
    wanted: Sequence[str],
    base: Sequence[BaseParameter],
    identifiable: Sequence[str],
) -> dict[str, str]:
    """Return the reason for every parameter that is not identifiable, with the combinations that hold it."""
    inside: dict[str, list[str]] = {name: [] for name in wanted}
    for parameter in base:
        own = _shown(parameter)
        for column, _ in parameter.combination:
            composite = rows.composites.get(column)
            for name in (column,) if composite is None else composite.parameters:
                inside[name].append(own)
    return {
        name: f"only in combination: {', '.join(inside[name])}" if inside[name] else _why_absent(rows)
        for name in wanted
        if name not in identifiable
    }


def _shown(parameter: BaseParameter) -> str:
    """Return the combination as text; each of a thousand in one sum need not name all the others."""
    count = len(parameter.combination)
    if count <= LONGEST_SHOWN:
        return parameter.name
    return f"{BaseParameter(parameter.combination[:3]).name} + ... ({count} parameters)"


def _refuse_extreme(rows: IdentificationRows) -> None:
    """Refuse coefficients that floating point numbers could not hold, nor be multiplied with."""
    sizes = [abs(Fraction(term.coefficient)) for row in rows.rows for term in row.terms]
    for composite in rows.composites.values():
        for poly in (composite.numerator, composite.denominator):
            sizes += [abs(Fraction(int(c.numerator), int(c.denominator))) for c in poly.coeffs()]
    sizes += map(Fraction, exact_levers(rows.spec).values())
    extreme = next(
        (size for size in sizes if size and not Fraction(1, LARGEST_FACTOR) <= size <= LARGEST_FACTOR), None
    )
    if extreme is not None:
        bits = extreme.numerator.bit_length() - extreme.denominator.bit_length()
        raise ModelError.at(
            f"{rows.spec.source}: sensors.{rows.sensor_set}",
            f"gear ratios multiply to about 1e{round(0.30103 * bits)}; 1e-50 to 1e50 can be computed with",
            "check for gear ratios that are extremely large or small",
        )


def _refuse_long(rows: IdentificationRows, base: Sequence[BaseParameter]) -> None:
    """Refuse sums that Python could not read: of parameters in a base parameter, of terms in a column."""
    where = f"{rows.spec.source}: sensors.{rows.sensor_set}"
    for parameter in base:
        count = len(parameter.combination)
        if count > LONGEST_SUM:
            raise ModelError.at(
                where,
                f"{count:,} parameters act as one sum, {_shown(parameter)}; a model holds at most "
                f"{LONGEST_SUM:,}",
                "describe them as one element with one parameter, or take them into [known]",
            )
    for row in rows.rows:
        count = max(Counter(term.parameter for term in row.terms).values(), default=0)
        if count > LONGEST_SUM:
            raise ModelError.at(
                where,
                f"the row {row.name[:60]} adds {count:,} signals in one column; a model holds at most "
                f"{LONGEST_SUM:,}",
                "lump bodies, or split the chain where both sides of a link are measured",
            )


def regroup(rows: IdentificationRows, names: Sequence[str]) -> tuple[BaseParameter, ...]:
    """Return the base parameters of the named columns, the first independent columns in their order."""
    columns = _columns(rows)
    exact = exact_dependencies([columns[name] for name in names])
    independent = [i for i in range(len(names)) if i not in exact]
    if len(names) <= LARGEST_QR:
        numerical = _numerical_dependencies(rows, names)
        if not _agree(numerical, exact):
            raise ModelError.at(
                f"{rows.spec.source}: sensors.{rows.sensor_set}",
                f"the numerical rank of the random regressor ({len(names) - len(numerical)}) and the exact "
                f"rank ({len(independent)}) of its {len(names)} columns disagree",
                "check for gear ratios that are extremely large or small",
            )
    combinations: dict[int, list[tuple[str, Exact]]] = {i: [(names[i], 1)] for i in independent}
    for dependent, recipe in exact.items():
        for i, factor in recipe.items():
            combinations[i].append((names[dependent], factor))
    return tuple(BaseParameter(tuple(combinations[i])) for i in independent)


def _numerical_dependencies(rows: IdentificationRows, names: Sequence[str]) -> dict[int, dict[int, float]]:
    """Return the dependent columns of a random regressor and how they regroup, R_1^-1 R_2."""
    from scipy.linalg import qr, solve_triangular

    regressor = random_regressor(rows, names)
    scale = np.linalg.norm(regressor, axis=0)  # gear ratios spread the columns over many powers of ten
    regressor = regressor / scale
    pivoted = np.abs(np.diag(qr(regressor, mode="r", pivoting=True)[0]))
    rank = int(np.sum(pivoted > RANK_TOLERANCE * pivoted[0]))
    if rank == len(names):
        return {}
    # A second QR in the order of the spec keeps the first of every group of dependent columns as its base.
    diagonal = np.abs(np.diag(qr(regressor, mode="r")[0]))
    independent = [int(i) for i in np.flatnonzero(diagonal > RANK_TOLERANCE * pivoted[0])]
    dependent = [i for i in range(len(names)) if i not in independent]
    upper = qr(regressor[:, independent + dependent], mode="r")[0]
    size = len(independent)
    recipes = solve_triangular(upper[:size, :size], upper[:size, size:])
    return {
        column: {
            independent[k]: float(value) * scale[column] / scale[independent[k]]
            for k, value in enumerate(recipes[:, n])
            if abs(value) > RANK_TOLERANCE
        }
        for n, column in enumerate(dependent)
    }


def _agree(numerical: Mapping[int, Mapping[int, float]], exact: Mapping[int, Mapping[int, Exact]]) -> bool:
    """Return whether the numerical regrouping equals the exact rationals but for rounding."""
    if numerical.keys() != exact.keys():
        return False
    for column, recipe in exact.items():
        found = numerical[column]
        if found.keys() != recipe.keys():
            return False
        if any(abs(found[i] / float(factor) - 1.0) > REGROUPING_TOLERANCE for i, factor in recipe.items()):
            return False
    return True


def random_regressor(rows: IdentificationRows, names: Sequence[str], seed: int = SEED) -> FloatArray:
    """Return a regressor at random values of every signal and feature, shape (samples * rows, names)."""
    keys = sorted({term.key for row in rows.rows for term in row.terms})
    place, column = {key: i for i, key in enumerate(keys)}, {name: i for i, name in enumerate(names)}
    widest = max(len({term.parameter for term in row.terms}) for row in rows.rows)
    samples = max(widest, 2 * len(names) // len(rows.rows)) + 8
    values = np.random.default_rng(seed).standard_normal((samples, len(keys)))
    if "1" in place:
        values[:, place["1"]] = 1.0
    regressor = np.zeros((samples, len(rows.rows), len(names)))
    for index, row in enumerate(rows.rows):
        for term in row.terms:
            if term.parameter in column:
                regressor[:, index, column[term.parameter]] += (
                    float(term.coefficient) * values[:, place[term.key]]
                )
    return regressor.reshape(-1, len(names))


def _columns(rows: IdentificationRows) -> dict[str, dict[tuple[int, str], Exact]]:
    columns: dict[str, dict[tuple[int, str], Exact]] = {}
    for index, row in enumerate(rows.rows):
        for term in row.terms:
            if term.parameter is not None:
                columns.setdefault(term.parameter, {})[index, term.key] = term.coefficient
    return columns


def _why_absent(rows: IdentificationRows) -> str:
    highest = min(row.differentiated for row in rows.rows)
    return (
        f"it is constant between reversals and every row that holds it is differentiated (at least {highest} "
        "times) for these sensors; add a position or velocity sensor"
    )
