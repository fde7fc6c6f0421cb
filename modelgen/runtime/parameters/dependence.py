"""Columns that move together: which combinations of their parameters the records see, in numbers and words.

The collinearity diagnostics of Belsley, Kuh and Welsch (1980, ch. 3): condition indexes of the columns scaled
to unit length, and the share of every parameter's variance that comes from the directions of a large one.
The columns in such a direction are regrouped as base parameters are (Gautier 1991): one of them is expressed
by the others, and what is left are combinations that the records do see.
"""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from modelgen.array_types import FloatArray, IntArray
from modelgen.errors import listed, signed_sum
from modelgen.runtime.advice import Advice
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.model.model import Model
from modelgen.runtime.parameters.grouped_reasons import parameters_in
from modelgen.runtime.parameters.parameter import Parameter
from modelgen.runtime.parameters.rounded import with_interval
from modelgen.runtime.parameters.thresholds import (
    GROWN_BY_DIGITS,
    HIGHEST_INDEX,
    KNOWN_SHARE,
    LARGEST_INDEX,
    MOST_DIGITS,
    PIVOT_SHARE,
    SMALLEST_SHARE,
    VARIANCE_SHARE,
)

INSEPARABLE = "cannot be distinguished in these records"
LISTED = 6  # columns of a group


@dataclass(frozen=True)
class ParameterSum:
    """A sum of parameters that the records see: `terms` pairs of coefficient and name, its value, its std."""

    terms: tuple[tuple[float, str], ...]
    value: float
    std: float

    @property
    def text(self) -> str:
        """The sum as one writes it, "J_c + 0.3 F_vc"."""
        sizes = ((c < 0.0, f"{abs(c):.{MOST_DIGITS}g} {name}".removeprefix("1 ")) for c, name in self.terms)
        return signed_sum(sizes)

    @property
    def known(self) -> bool:
        """Whether its 95 % interval is small against its value."""
        return self._half < KNOWN_SHARE * abs(self.value)

    @property
    def said(self) -> str:
        """The sum with its 95 % interval."""
        shown = with_interval(self.value, self.value - self._half, self.value + self._half)
        return f"{self.text} = {shown} (95 %)"

    @property
    def _half(self) -> float:
        return NormalDist().inv_cdf(0.975) * self.std


@dataclass(frozen=True)
class Dependence:
    """Columns that move together, their condition index, and the combinations of them that are seen."""

    columns: tuple[str, ...]
    condition_index: float
    combinations: tuple[ParameterSum, ...]

    @property
    def text(self) -> str:
        """What is seen of the columns, in words and numbers."""
        columns = joined(self.columns)
        if not self.combinations:
            return f"{columns} cannot be distinguished"
        verb = "is" if len(self.combinations) == 1 else "are"
        seen = joined(
            [f"{c.text} = {c.value:.4g} (standard deviation {c.std:.2g})" for c in self.combinations]
        )
        return f"{columns} move together: only {seen} {verb} seen"

    @property
    def index_said(self) -> str:
        """The condition index in words, to two digits: more of them are rounding where it is large."""
        return f"condition index {float(f'{self.condition_index:.2g}'):.0f}"

    def inseparable(self, because: str, model: Model | None = None) -> str:
        """Why its columns have no numbers of their own, and the sums of them that are known well.

        With a model composites are told by the parameters in them.
        """
        names = self.columns
        if model is not None and model.composites:
            formulas = [model.composites.get(name, name) for name in names]
            names = parameters_in(" ".join(formulas), model.parameters)
        told_of = {*names}
        known = [
            one.said for one in self.combinations if one.known and told_of.issuperset(n for _, n in one.terms)
        ]
        told = "; ".join([because, *([f"known is {joined(known)}"] if known else [])])
        return f"{listed(names, most=LISTED)} {INSEPARABLE} ({told})"


def dependences(fit: Fit, covariance: FloatArray, largest_index: float = LARGEST_INDEX) -> list[Dependence]:
    """Return the groups of columns that are nearly, or exactly, dependent; none where all is well.

    Parameters
    ----------
    fit : Fit
    covariance : array, shape (c, c)
        Of the fit's parameters, in SI.
    largest_index : float
        Condition index from which a direction counts.
    """
    scale, s, V = _scaled_directions(fit)
    index = s[0] / np.maximum(s, s[0] / (10.0 * HIGHEST_INDEX))
    weak = index > largest_index
    if not weak.any():
        return []
    variance = (V * index) ** 2
    share = variance[:, weak].sum(axis=1) / variance.sum(axis=1)
    involved = np.flatnonzero(share > VARIANCE_SHARE)
    if involved.size < 2:
        return []
    null = _echelon(V[np.ix_(involved, weak)].T)
    return [
        _dependence(fit, covariance, scale, involved[group], null[:, group], float(index[weak].max()))
        for group in _groups(null)
    ]


def _scaled_directions(fit: Fit) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the lengths of the weighted columns, and singular values and vectors of them at unit length."""
    W = fit.triangle[:, :-1]
    scale = np.linalg.norm(W, axis=0)
    _, s, Vt = np.linalg.svd(W / np.where(scale > 0.0, scale, 1.0))
    return scale, s, Vt.T


def _echelon(null: FloatArray) -> FloatArray:
    """Return the same directions (rows), each with a column of its own that is 1 in it and 0 in the others.

    Where the columns are involved in fewer dependences than there are directions, these come out as zeros and
    are left out.
    """
    rows = null.copy()
    done: list[int] = []
    for _ in range(min(rows.shape)):
        left = [k for k in range(len(rows)) if k not in done]
        size = np.abs(rows[left])
        if size.max() < SMALLEST_SHARE:
            break
        place, pivot = _pivot(size)
        row = left[place]
        rows[row] /= rows[row, pivot]
        others = [k for k in range(len(rows)) if k != row]
        rows[others] -= np.outer(rows[others, pivot], rows[row])
        done.append(row)
    return np.asarray(rows[done])


def _pivot(size: FloatArray) -> tuple[int, int]:
    """Return row and column of the pivot: of the first column that is no small one, its largest entry."""
    columns = np.flatnonzero(size.max(axis=0) > PIVOT_SHARE * size.max())
    column = int(columns[0])
    return int(np.argmax(size[:, column])), column


def _groups(null: FloatArray) -> list[IntArray]:
    """Return the columns of each set that shares dependences, as arrays of indexes; single ones left out."""
    touched = np.abs(null) > SMALLEST_SHARE
    group = np.arange(null.shape[1])
    for row in touched:
        members = np.flatnonzero(row)
        if members.size:
            group[np.isin(group, group[members])] = group[members].min()
    found = [np.flatnonzero(group == label).astype(np.int64) for label in np.unique(group)]
    return [members for members in found if members.size > 1]


def _dependence(
    fit: Fit, covariance: FloatArray, scale: FloatArray, columns: IntArray, null: FloatArray, index: float
) -> Dependence:
    """Return one group; `null` holds its directions in echelon form, on columns of unit length."""
    null = null[np.any(np.abs(null) > SMALLEST_SHARE, axis=1)]
    pivots = [int(np.flatnonzero(np.abs(row - 1.0) < 1e-9)[0]) for row in null]
    combinations = []
    for k, column in enumerate(columns):
        if k in pivots:
            continue
        # x_k and, for every pivot p, -n_k / n_p x_p: n x_k and n x_p may change together without being seen
        gradient = np.zeros(len(fit.columns))
        gradient[column] = 1.0
        for row, p in zip(null, pivots, strict=True):
            if abs(row[k]) > SMALLEST_SHARE:
                gradient[columns[p]] = -float(row[k]) * scale[columns[p]] / scale[column]
        # as one writes it: in the model's order, the first without a factor
        gradient /= gradient[np.flatnonzero(gradient)[0]]
        gradient = _in_few_digits(gradient, covariance)
        terms = tuple((float(gradient[place]), fit.columns[place]) for place in np.flatnonzero(gradient))
        combinations.append(
            ParameterSum(terms, float(gradient @ fit.solution.x), _deviation(gradient, covariance))
        )
    names = tuple(fit.columns[int(column)] for column in columns)
    return Dependence(names, index, tuple(combinations))


def _in_few_digits(gradient: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return factors of as few digits as leave the sum as well known: value and text are then of one sum."""
    limit = GROWN_BY_DIGITS * _deviation(gradient, covariance)
    for digits in range(2, MOST_DIGITS):
        rounded = np.array([float(f"{factor:.{digits}g}") for factor in gradient])
        if _deviation(rounded, covariance) <= limit:
            return rounded
    return np.array([float(f"{factor:.{MOST_DIGITS}g}") for factor in gradient])


def _deviation(gradient: FloatArray, covariance: FloatArray) -> float:
    return float(np.sqrt(max(float(gradient @ covariance @ gradient), 0.0)))


def joined(words: Sequence[str]) -> str:
    """Return words as one lists them: "a, b and c"."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def dependence_advice(
    found: Sequence[Dependence], parameters: Sequence[Parameter], percent: float, refused: Container[str]
) -> tuple[Advice, ...]:
    """Return one advice for each group of columns that makes a parameter uncertain: what is seen of them.

    `refused` are columns that have no number because of such a group.
    """
    uncertain = {entry.name for entry in parameters if entry.relative_std >= percent}
    return tuple(
        Advice(
            "dependent columns",
            group.text,
            f"({_closeness(group)})",
            "give one of them as known, sense more (modelgen show --sensors all), or move differently",
        )
        for group in found
        if any(name in uncertain or name in refused for name in group.columns)
    )


def _closeness(group: Dependence) -> str:
    exact = group.condition_index > HIGHEST_INDEX
    return "exactly dependent" if exact else group.index_said
