"""RowTerms: the entries of one row of a model that are not zero, evaluated at samples kept."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.model.model import Model, Terms
from modelgen.runtime.rows.thresholds import LEAST_FORCE


@dataclass(frozen=True)
class RowTerms:
    """One row y = D x: the base parameters it touches, their terms, and those of y; all in SI."""

    row: int
    columns: tuple[int, ...]
    entries: tuple[Terms, ...]

    def fill(self, lines: FloatArray | Sequence[FloatArray], signals: Mapping[str, FloatArray]) -> None:
        """Fill in the columns touched, and y, one a line; lines and signals have shape (n,) each."""
        for line, terms in zip(lines, self.entries, strict=True):
            _sum_into(line, terms, signals)

    def evaluate(self, signals: Mapping[str, FloatArray]) -> FloatArray:
        """Return the same in a new array, shape (columns touched + 1, n)."""
        lines = np.empty((len(self.entries), len(signals["1"])))
        self.fill(lines, signals)
        return lines

    def mismatch(self, x: FloatArray) -> dict[str, float]:
        """Return the weights of signals and features in y - D x, x (SI) is (base parameters,)."""
        weights: dict[str, float] = {}
        for share, entry in zip((*(-x[list(self.columns)]), 1.0), self.entries, strict=True):
            for coefficient, key in entry:
                weights[key] = weights.get(key, 0.0) + float(share) * coefficient
        return weights


@lru_cache(maxsize=8)
def channels_of_keys(model: Model) -> dict[str, frozenset[str]]:
    """Return which channels each signal and feature is made of, directions of motion included."""
    channel = {signal.key: signal.channel for signal in model.signals}
    reads = {key: frozenset({name}) for key, name in channel.items()}
    for feature in model.features:
        of = [feature.of] if isinstance(feature.of, str) else [key for _, key in feature.of]
        keys = [*of, *([feature.times] if feature.times else [])]
        reads[feature.key] = frozenset(channel.get(key, key) for key in keys)
    return reads


@lru_cache(maxsize=8)
def channels_of_rows(model: Model) -> tuple[frozenset[str], ...]:
    """Return which channels each row is made of, directions of motion included."""
    reads = channels_of_keys(model)
    return tuple(
        frozenset(name for terms in row.entries for _, key in terms for name in reads.get(key, ()))
        for row in row_terms(model)
    )


def mismatch_terms(model: Model, x: FloatArray) -> tuple[dict[str, float], ...]:
    """Return `RowTerms.mismatch` of each row, x (SI) is (base parameters,)."""
    return tuple(terms.mismatch(x) for terms in row_terms(model))


@lru_cache(maxsize=8)
def row_terms(model: Model) -> tuple[RowTerms, ...]:
    """Return the terms of every row of a model."""
    return tuple(
        RowTerms(row, tuple(touched), (*touched.values(), model.measurement_columns[row]))
        for row, touched in enumerate(model.regressor_columns)
    )


def holds_force(model: Model, row: int, measured: float, forces: float) -> bool:
    """Tell whether a row balances a force: norms of its left side, and of all forces at the row's lever.

    Rows of an arm hold a force each, however small that of a wrist is against a shoulder's; some hold it as
    the column of a drive's gain.
    """
    return holds_gain(model, row) or measured > (0.0 if model.is_arm else LEAST_FORCE * forces)


def holds_gain(model: Model, row: int) -> bool:
    """Tell whether a force of the row is a column, of a drive's gain; the left side is what is known."""
    names = (model.base_parameters[column] for column in model.regressor_columns[row])
    return any(name in model.roles and model.roles[name].role == "gain" for name in names)


def _sum_into(line: FloatArray, terms: Terms, signals: Mapping[str, FloatArray]) -> None:
    """Fill a line with the sum of its terms; the usual short sums without temporaries."""
    if not terms:
        line[:] = 0.0
        return
    (coefficient, key), *rest = terms
    np.multiply(signals[key], coefficient, out=line)
    for coefficient, key in rest:
        if coefficient == 1.0:
            line += signals[key]
        elif coefficient == -1.0:
            line -= signals[key]
        else:
            line += coefficient * signals[key]
