"""Does friction depend on the direction of motion? A Wald test on columns that a symmetric model lacks.

Different viscous friction forward and backward adds (Fv_plus - Fv_minus) / 2 times |velocity| to a row, where
its sign() stands; different Coulomb friction adds a constant, which an offset takes up.
"""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.least_squares.projected_least_squares import two_stage
from modelgen.runtime.least_squares.wls import Fit
from modelgen.runtime.model.model import Feature, Model
from modelgen.runtime.records.channels import RecordChannels
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.record_rows import RecordRows, matched_rows
from modelgen.runtime.rows.standstill_speeds import NOTHING

FloatArray = npt.NDArray[np.float64]

# Preferred when the difference is this many standard deviations: a chance of 1 in 16 000.
SIGNIFICANT = 4.0


@dataclass(frozen=True)
class Asymmetry:
    """Half the difference of viscous friction forward and backward where `feature` acts, and its std."""

    feature: str
    value: float
    std: float

    @property
    def preferred(self) -> bool:
        """Whether friction that depends on the direction fits significantly better."""
        return abs(self.value) > SIGNIFICANT * self.std


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
        blocks = tuple(
            replace(block, W=np.column_stack([block.W, column]))
            for block, column in zip(fit.blocks, extra, strict=True)
        )
        Z = tuple(np.column_stack([r, column]) for r, column in zip(fit.regressors, extra, strict=True))
        larger = two_stage(replace(fit, columns=(*fit.columns, "asymmetry"), blocks=blocks), Z)
        if larger.solution.undetermined[-1]:
            continue
        variance = float(hac_covariance(larger)[-1, -1])
        value, std = float(larger.solution.x[-1]), float(np.sqrt(max(variance, 0.0)))
        found.append(Asymmetry(feature.key, value, std))
    return tuple(found)


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
    """Return whether a column in which the feature stands is refused."""
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
            rows = matched_rows(model, RecordChannels(record), choice, factor, drop, survey=NOTHING)
            signals[block.record] = _speed(rows, str(feature.of))
        columns.append(share * signals[block.record][block.place])
    return columns


def _speed(rows: RecordRows, key: str) -> FloatArray:
    """Return |velocity| behind the filter on the grid; zeros where the record brings the direction only."""
    signal = next(signal for signal in rows.plan.model.signals if signal.key == key)
    if signal.sensor is None:
        return np.zeros(len(rows.grid))
    return rows.feature(Feature("speed", "sign", of=key, times=key))
