"""Does friction depend on the direction of motion? A Wald test on columns that a symmetric model lacks.

Different viscous friction forward and backward adds (Fv_plus - Fv_minus) / 2 times |velocity| to a row, where
its sign() stands; different Coulomb friction adds a constant, which an offset takes up.
"""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import dataclass

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.diagnostics.thresholds import SIGNIFICANT_ASYMMETRY
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import long_run_covariance
from modelgen.runtime.least_squares.thresholds import RANK_TOLERANCE
from modelgen.runtime.model.model import Feature, Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.record_rows import RecordRows, matched_rows
from modelgen.runtime.rows.standstill_speeds import NOTHING


@dataclass(frozen=True)
class Asymmetry:
    """Half the difference of viscous friction forward and backward where `feature` acts, and its std."""

    feature: str
    value: float
    std: float

    @property
    def preferred(self) -> bool:
        """Whether friction that depends on the direction fits significantly better."""
        return abs(self.value) > SIGNIFICANT_ASYMMETRY * self.std


def asymmetries(
    fit: Fit,
    model: Model,
    records: Sequence[Record],
    choice: FilterChoice,
    drop: int = 0,
    refused: Container[str] = (),
) -> tuple[Asymmetry, ...]:
    """Test every sign() of a sensed velocity in the rows of a fit, except for columns that are refused."""
    found = []
    for feature in model.features:
        if feature.function != "sign" or not isinstance(feature.of, str):
            continue
        if _is_refused(model, feature, refused):
            continue
        extra = _columns(fit, model, records, choice, drop, feature)
        if not any(np.any(column) for column in extra):
            continue
        one = _one_more(fit, extra)
        if one is not None:
            found.append(Asymmetry(feature.key, *one))
    return tuple(found)


def _one_more(fit: Fit, extra: Sequence[FloatArray]) -> tuple[float, float] | None:
    """Return value and standard deviation of one more column of a fit; None where others hold it already.

    What the regressors leave of the column is what it is fitted with (Frisch and Waugh 1933): nothing else
    has to be solved again.
    """
    regressors = [fit.regressor(index) for index in range(len(fit.blocks))]
    parts = list(zip(fit.weights, regressors, extra, strict=True))
    shared = np.zeros(len(fit.columns))
    for weight, (regressor, place), column in parts:
        shared[place] += weight**2 * (regressor.T @ column)
    share = fit.solution.inverse @ shared
    left = [column - regressor @ share[place] for _, (regressor, place), column in parts]
    power = sum(w**2 * float(own @ own) for w, own in zip(fit.weights, left, strict=True))
    whole = sum(w**2 * float(column @ column) for w, _, column in parts)
    if power <= RANK_TOLERANCE * whole:
        return None
    own_residuals = zip(fit.weights, left, fit.residuals, strict=True)
    value = sum(w**2 * float(own @ residual) for w, own, residual in own_residuals) / power
    series: dict[int, FloatArray] = {}
    for block, weight, residual, own, column in zip(
        fit.blocks, fit.weights, fit.residuals, left, extra, strict=True
    ):
        rest = residual - value * (column - block.W @ block.own(share))
        psi = series.setdefault(block.record, np.zeros((block.grid, 1)))
        psi[block.place, 0] += weight**2 * own * rest / power
    r = sum(len(residual) for residual in fit.residuals)
    variance = float(long_run_covariance(list(series.values()))[0, 0]) * r / (r - len(fit.columns) - 1)
    return value, float(np.sqrt(max(variance, 0.0)))


def asymmetry_notes(found: Sequence[Asymmetry]) -> tuple[str, ...]:
    """Return one sentence for every friction that is better called asymmetric."""
    return tuple(
        f"friction behind {one.feature} depends on the direction of motion: viscous friction forward and "
        f"backward differ by {2.0 * one.value:.3g} (standard deviation {2.0 * one.std:.2g}); a body with "
        'friction = "asymmetric" fits better'
        for one in found
        if one.preferred
    )


def _is_refused(model: Model, feature: Feature, refused: Container[str]) -> bool:
    """Return whether a column that holds the feature is refused."""
    return any(
        model.base_parameters[column] in refused
        for row in model.regressor_columns
        for column, terms in row.items()
        if any(key == feature.key for _, key in terms)
    )


def _columns(
    fit: Fit, model: Model, records: Sequence[Record], choice: FilterChoice, drop: int, feature: Feature
) -> list[FloatArray]:
    """Return |velocity| behind the filter for every block, where the row holds the sign; else zeros."""
    signals: dict[int, FloatArray] = {}
    columns = []
    for block in fit.blocks:
        share = sum(
            coefficient
            for terms in model.regressor_columns[block.row].values()
            for coefficient, key in terms
            if key == feature.key
        )
        if not share:
            columns.append(np.zeros(block.place.size))
            continue
        if block.record not in signals:
            record, factor = records[block.record], choice.decimation[block.record]
            rows = matched_rows(model, record, choice, factor, drop, survey=NOTHING)
            signals[block.record] = _speed(rows, str(feature.of))
        columns.append(share * signals[block.record][block.place])
    return columns


def _speed(rows: RecordRows, key: str) -> FloatArray:
    """Return |velocity| behind the filter on the grid; zeros where the record brings the direction only."""
    signal = next(signal for signal in rows.plan.model.signals if signal.key == key)
    if signal.sensor is None:
        return np.zeros(len(rows.grid))
    return rows.feature(Feature("speed", "sign", of=key, times=key))
