"""Measured and rebuilt left-hand side of every row on every record, behind the estimate's own filter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.curves.thresholds import MOST_LAGS, Z_99
from modelgen.runtime.diagnostics.samples.leaps import without_leaps
from modelgen.runtime.identification.given_positions import rows_without
from modelgen.runtime.least_squares.delays import advanced
from modelgen.runtime.model.deflected_kernel import DeflectedKernel
from modelgen.runtime.model.model import Model
from modelgen.runtime.model.power.power_model import power_model
from modelgen.runtime.records.directions import with_directions
from modelgen.runtime.records.record import Record
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.rows.derived_channels import with_derived
from modelgen.runtime.rows.left_open.uncertain_turns import without_uncertain_turns
from modelgen.runtime.rows.observation import Observation, observe
from modelgen.runtime.rows.paper_rows import observe_paper
from modelgen.runtime.rows.row_block import RowBlock


@dataclass(frozen=True, eq=False)
class Rebuilt:
    """One row on one record: Y and W x, shape (grid,) each, NaN where masked; times in s."""

    record: str
    row: str
    unit: str
    start_s: float
    step_s: float
    measured: FloatArray
    rebuilt: FloatArray
    masked: int
    has_force: bool

    @property
    def residual(self) -> FloatArray:
        """Measured minus rebuilt, shape (grid,)."""
        return self.measured - self.rebuilt


@dataclass(frozen=True, eq=False)
class Autocorrelation:
    """Of a residual, lags 0 to the last; `bound` is that of 99 % of a white residual's."""

    values: FloatArray
    bound: float
    step_s: float


def rebuild(model: Model, records: Sequence[Record], estimate: Estimate) -> tuple[list[Rebuilt], FloatArray]:
    """Return every row on every record used, and the singular values of W with columns of unit length.

    The singular values have shape (columns,) and no unit. W is weighted as in the fit and holds the columns
    of the fit; records held out are left out. What was estimated besides the parameters, a ripple, say, is
    rebuilt with them where the estimate holds the residuals of its rows, which one from a file does not.
    """
    records = used_records(model, records, estimate)
    if not {entry.row for entry in estimate.fit.rows} & {row.name for row in model.rows}:
        model = power_model(model)
    filtering = estimate.fit.filtering
    records = with_derived(model, records)
    records = with_directions(model, records, dict(filtering.directions), filtering.direction_cutoff_hz)
    x = _solution(model, estimate)
    model = _about(model, estimate, x)
    weights = {(entry.record, entry.row): entry.weight for entry in estimate.fit.rows}
    residuals = _residuals(estimate)
    fitted = np.isfinite(estimate.base) | np.isin(model.base_parameters, list(estimate.parameters.nuisance))
    observation, used = _observed(model, records, estimate)
    found: list[Rebuilt] = []
    stacked: list[FloatArray] = []
    for block, left in zip(observation.dense().blocks, used.dense().blocks, strict=True):
        key = block.record_name, block.row_name
        if key not in weights:
            continue  # a row that this record was not allowed to feed
        record, own = records[block.record], residuals.get(key)
        if own is None or own.size != block.place.size:
            own = left.residual(x)
        found.append(_rebuilt(record, estimate, block, own))
        weight = weights[key]
        if np.isfinite(weight) and block.place.size:
            stacked.append(np.asarray(np.linalg.qr(weight * left.W[:, fitted], mode="r")))
    return found, _singular_values(stacked)


def _residuals(estimate: Estimate) -> dict[tuple[str, str], FloatArray]:
    """Return what the fit left of each row on each record, (n,) in its unit, where that was kept."""
    solved = [(entry.record, entry.row) for entry in estimate.fit.rows if entry.residual_rms is not None]
    kept = estimate.fit.residuals or ()
    return {key: left for key, (_, left) in zip(solved, kept, strict=False)}


def used_records(model: Model, records: Sequence[Record], estimate: Estimate) -> tuple[Record, ...]:
    """Return the records behind an estimate, without leaps, and the parts of those that were cut."""
    found = list[Record]()
    for record in records:
        parts = [part for part in without_leaps(model, [record]) if part.name in estimate.records]
        found += parts or ([record] if record.name in estimate.records else [])
    return tuple(found)


def autocorrelation(residual: FloatArray, step_s: float) -> Autocorrelation | None:
    """Return the autocorrelation of a residual without its masked samples; None where there is none.

    Parameters
    ----------
    residual : array, shape (n,)
        In the unit of the row; NaN where a sample is masked.
    step_s : float
        Time between two samples in s.
    """
    kept = np.isfinite(residual)
    count = int(kept.sum())
    if count < 20:
        return None
    centred = np.where(kept, residual - residual[kept].mean(), 0.0)
    lags = min(MOST_LAGS, count // 4)
    size = 1 << int(np.ceil(np.log2(2 * residual.size)))
    spectrum = np.abs(np.fft.rfft(centred, size)) ** 2
    products = np.fft.irfft(spectrum, size)[: lags + 1]
    if products[0] <= 0.0:
        return None
    return Autocorrelation(products / products[0], Z_99 / float(np.sqrt(count)), step_s)


def _observed(model: Model, records: Sequence[Record], estimate: Estimate) -> tuple[Observation, Observation]:
    """Return the rows at the samples that the estimate used, delays that it found compensated.

    Whether samples near a reversal were used depends on the method and its substitute: the counts show it.
    The second ones leave forces open as those of the estimate did.
    """
    moved, choice = [advanced(record, estimate.delays) for record in records], estimate.fit.filtering
    if estimate.fit.method == "pham2002":
        found = observe_paper(model, moved, choice)
        return found, found
    used = {(entry.record, entry.row): entry.used for entry in estimate.fit.rows}
    ways: tuple[tuple[bool | Literal["open"], bool], ...]
    # the last are rows to which friction that they drop was added
    ways = (("open", False), (True, False), (False, False), (False, True))
    for way, friction in ways:
        observation = observe(model, moved, choice, turns=way, friction=friction)
        turns = way is not False
        counts = {(block.record_name, block.row_name): len(block.place) for block in observation.blocks}
        if all(counts[key] == used[key] for key in counts.keys() & used.keys()):
            break
    return observation, without_uncertain_turns(observation, model, moved, choice, 0, turns)


def _solution(model: Model, estimate: Estimate) -> FloatArray:
    """Return the base parameters with nuisances in their place; a column that is absent counts nothing."""
    x = np.array(estimate.base, dtype=float)
    for index, name in enumerate(model.base_parameters):
        if not np.isfinite(x[index]):
            x[index] = estimate.parameters.nuisance.get(name, 0.0)
    return x


def _about(model: Model, estimate: Estimate, x: FloatArray) -> Model:
    """Return the model with rows that hold positions which springs give linear about x, shape (columns,).

    Without these rows where the estimate is of the others alone.
    """
    kernel = model.kernel
    if not isinstance(kernel, DeflectedKernel):
        return model
    used = {entry.row for entry in estimate.fit.rows}
    if used.isdisjoint(model.rows[row].name for row in kernel.rows):
        return rows_without(model, kernel)
    return replace(model, kernel=kernel.at(x, sampled=not estimate.fit.filtering.between))


def _rebuilt(record: Record, estimate: Estimate, block: RowBlock, left: FloatArray) -> Rebuilt:
    """Return a block as it was identified, which leaves the residual `left`, shape (n,), in its unit.

    Forces that rows leave open are rebuilt as they have to be.
    """
    factor = estimate.fit.filtering.decimation[block.record]
    measured, rebuilt = np.full(block.grid, np.nan), np.full(block.grid, np.nan)
    measured[block.place] = block.Y
    rebuilt[block.place] = block.Y - left
    return Rebuilt(
        record.name,
        block.row_name,
        block.unit,
        block.start / record.fs,
        factor / record.fs,
        measured,
        rebuilt,
        block.masked,
        block.has_force,
    )


def _singular_values(triangles: Sequence[FloatArray]) -> FloatArray:
    if not triangles:
        return np.empty(0)
    W = np.concatenate(triangles)
    norms = np.linalg.norm(W, axis=0)
    return np.asarray(np.linalg.svd(W / np.where(norms > 0.0, norms, 1.0), compute_uv=False))
