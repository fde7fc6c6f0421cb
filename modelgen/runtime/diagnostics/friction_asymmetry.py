"""Does friction depend on the direction of motion? A Wald test on columns that a symmetric model lacks.

Different viscous friction forward and backward adds (Fv_plus - Fv_minus) / 2 times |velocity| to a row, where
its sign() stands; different Coulomb friction adds a constant, which an offset takes up.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from modelgen.array_types import FloatArray, IntArray
from modelgen.runtime.diagnostics.thresholds import SIGNIFICANT_ASYMMETRY
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.least_squares.fit import Fit, FittedStretch
from modelgen.runtime.least_squares.hac_covariance import long_run_covariance
from modelgen.runtime.least_squares.thresholds import RANK_TOLERANCE
from modelgen.runtime.model.model import Feature, Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.record_rows import unmasked_rows
from modelgen.runtime.rows.remade_rows import RemadeFeature
from modelgen.runtime.rows.row_block import STRETCH

# values of a column at points of a grid, from (n,) to (n,)
Column = Callable[[IntArray], FloatArray]


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
        if _is_refused(model, feature.key, refused):
            continue
        extra = _columns(fit, model, records, choice, drop, feature)
        if not any(extra):
            continue
        one = _one_more(fit, extra)
        if one is not None:
            found.append(Asymmetry(feature.key, *one))
    return tuple(found)


def _one_more(fit: Fit, extra: Sequence[Column | None]) -> tuple[float, float] | None:
    """Return value and standard deviation of one more column of a fit; None where others hold it already.

    What the regressors leave of the column is what it is fitted with (Frisch and Waugh 1933): nothing else
    has to be solved again.
    """
    shared, whole = np.zeros(len(fit.columns)), 0.0
    for index, one, column in _columns_in_stretches(fit, extra):
        weight = fit.weights[index] ** 2
        shared += weight * one.regressor.across(column)
        whole += weight * float(column @ column)
    share = fit.solution.inverse @ shared
    power = value = 0.0
    for index, one, column in _columns_in_stretches(fit, extra):
        weight, left = fit.weights[index] ** 2, column - one.regressor.times(share)
        power += weight * float(left @ left)
        value += weight * float(left @ one.residual)
    if power <= RANK_TOLERANCE * whole:
        return None
    value /= power
    series = [partial(_influence, fit, extra, of, share, (value, power)) for of in fit.by_record.values()]
    r = fit.count
    variance = float(long_run_covariance(series)[0, 0]) * r / (r - len(fit.columns) - 1)
    return value, float(np.sqrt(max(variance, 0.0)))


def _columns_in_stretches(
    fit: Fit, extra: Sequence[Column | None]
) -> Iterator[tuple[int, FittedStretch, FloatArray]]:
    """Yield the stretches of every block, its number first, with the further column there, shape (n,)."""
    for index, (block, of) in enumerate(zip(fit.blocks, extra, strict=True)):
        if of is None:  # a column of zeros neither shares anything nor leaves anything
            continue
        for start in range(0, block.grid, STRETCH):
            one = fit.between(index, start, start + STRETCH)
            yield index, one, of(one.part.place)


def _influence(
    fit: Fit,
    extra: Sequence[Column | None],
    blocks: Sequence[int],
    share: FloatArray,
    found: tuple[float, float],
) -> Iterator[FloatArray]:
    """Yield what each instant of one record contributes to the error of the further parameter, (n, 1)."""
    value, power = found
    grid = fit.blocks[blocks[0]].grid
    for start in range(0, grid, STRETCH):
        psi = np.zeros((min(start + STRETCH, grid) - start, 1))
        for index in blocks:
            block, of = fit.blocks[index], extra[index]
            part, regressor, residual = fit.between(index, start, start + STRETCH)
            column = of(part.place) if of else np.zeros(len(part.place))
            left = column - regressor.times(share)
            rest = residual - value * (column - part.W @ block.own(share))
            psi[part.place - start, 0] += fit.weights[index] ** 2 * left * rest / power
        yield psi


def asymmetry_notes(
    found: Sequence[Asymmetry], model: Model, refused: Container[str] = ()
) -> tuple[str, ...]:
    """Return one sentence for every friction that is better called asymmetric and has a number."""
    return tuple(
        f"friction behind {one.feature} depends on the direction of motion: viscous friction forward and "
        f"backward differ by {2.0 * one.value:.3g} (standard deviation {2.0 * one.std:.2g}); a body with "
        'friction = "asymmetric" fits better'
        for one in found
        if one.preferred and not _is_refused(model, one.feature, refused)
    )


def _is_refused(model: Model, feature: str, refused: Container[str]) -> bool:
    """Return whether a column that holds the feature is refused."""
    return any(
        model.base_parameters[column] in refused
        for row in model.regressor_columns
        for column, terms in row.items()
        if any(key == feature for _, key in terms)
    )


def _columns(
    fit: Fit, model: Model, records: Sequence[Record], choice: FilterChoice, drop: int, feature: Feature
) -> list[Column | None]:
    """Return |velocity| behind the filter for every block whose row holds the sign, at points of its grid."""
    speeds: dict[int, FloatArray | RemadeFeature] = {}
    columns: list[Column | None] = []
    signal = next(signal for signal in model.signals if signal.key == feature.of)
    for block in fit.blocks:
        share = sum(
            coefficient
            for terms in model.regressor_columns[block.row].values()
            for coefficient, key in terms
            if key == feature.key
        )
        # a channel that brings the direction alone has no speed
        if not share or signal.sensor is None:
            columns.append(None)
            continue
        if block.record not in speeds:
            record, factor = records[block.record], choice.decimation[block.record]
            rows = unmasked_rows(model, record, choice, factor, drop)
            speed = Feature("speed", "sign", of=str(feature.of), times=str(feature.of))
            speeds[block.record] = rows.feature(speed) if block.in_memory else RemadeFeature(rows, speed)
        columns.append(partial(_scaled, share, speeds[block.record]))
    return columns


def _scaled(share: float, speed: FloatArray | RemadeFeature, place: IntArray) -> FloatArray:
    return np.asarray(share * speed[place])
