"""Instrumental variables: X = (Z^T W)^-1 Z^T Y with Z from a noise-free run of the model beside the record.

Noise in the columns of W biases least squares, the more the higher the derivatives. Z is the same rows behind
the same filters, at the same samples, built from a simulation with the present estimate: it correlates with
the motion and not with the noise (Janot, Vandanjon and Gautier 2014). Estimate and simulation are repeated
until they agree.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, IdentifiabilityError
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.iv.companion_simulation import Loop, possible, run_beside
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.least_squares.projected_least_squares import two_stage
from modelgen.runtime.model.model import Model
from modelgen.runtime.parameters.physical_parameters import Covariances, physical_parameters
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.record_rows import matched_rows
from modelgen.runtime.rows.row_terms import row_terms
from modelgen.runtime.rows.standstill_speeds import NOTHING

ROUNDS = 20
# Converged: no parameter moves by more than this share of its standard deviation, or of its value.
SMALL_MOVE = 0.01
SMALL_CHANGE = 1e-6
# Rows hold no more exactly than to this share of their largest term.
EXACTNESS = 1e-3


@dataclass(frozen=True, eq=False)
class Setting:
    """What the model is run beside."""

    model: Model
    records: Sequence[Record]
    choice: FilterChoice
    drop: int = 0
    loop: Loop | None = None


def fit_iv(start: Fit, setting: Setting) -> Fit:
    """Iterate instruments and estimate from a least-squares fit until the estimate stands still.

    Raises
    ------
    IdentifiabilityError
        When the iteration diverges, or does not come to rest.
    DataError
        When the model cannot be simulated.
    """
    fit, moves = start, list[float]()
    for _ in range(ROUNDS):
        following = iv_round(fit, setting)
        move = _largest_move(fit, following)
        fit = following
        moves.append(move)
        if move < 1.0:
            return replace(fit, notes=_iv_notes(len(moves)))
    raise diverged(
        f"after {ROUNDS} rounds an estimate still moves by {SMALL_MOVE * moves[-1]:.2g} standard deviations"
    )


def iv_round(fit: Fit, setting: Setting) -> Fit:
    """Return the fit with instruments from the given one: one round of the iteration."""
    following = solve_with(fit, instruments(fit, setting))
    if not np.all(np.isfinite(following.solution.x)):
        raise diverged("its estimate is not finite")
    return following


def starting_at(fit: Fit, start: Fit) -> Fit:
    """Return the fit with the solution of another one to the same columns."""
    if fit.columns != start.columns:
        return fit
    residuals = tuple(block.residual(start.solution.x) for block in fit.blocks)
    return replace(fit, solution=start.solution, residuals=residuals)


def diverged(what: str) -> IdentifiabilityError:
    """Return the error that tells that the iteration of instruments failed."""
    remedy = "use method wls, give better first values by another cutoff_hz, or check the model"
    return IdentifiabilityError.at("method iv", f"does not converge: {what}", remedy)


def instruments(fit: Fit, setting: Setting) -> tuple[FloatArray, ...]:
    """Return for every block of the fit its rows built from the simulation, shape (n, columns) each."""
    return instruments_at(fit, setting, simulation_parameters(setting.model, fit))


def instruments_at(fit: Fit, setting: Setting, values: Mapping[str, float]) -> tuple[FloatArray, ...]:
    """Return the same from a simulation with these physical parameters (SI).

    Raises
    ------
    IdentifiabilityError
        When the simulation fails, or does not move what a column needs.
    """
    try:
        Z = _simulated_rows(fit, setting, possible(setting.model, values))
    except DataError as error:
        raise diverged(f"its simulation fails ({error.problems[0].what})") from error
    still = [name for name, size in zip(fit.columns, _norms(Z), strict=True) if size == 0.0]
    if still:
        raise diverged(f"its simulation does not move what {', '.join(still)} needs")
    return Z


def _simulated_rows(fit: Fit, setting: Setting, parameters: Mapping[str, float]) -> tuple[FloatArray, ...]:
    model, choice = setting.model, setting.choice
    place = {model.base_parameters.index(name): index for index, name in enumerate(fit.columns)}
    touched = [terms.columns for terms in row_terms(model)]
    runs: dict[int, tuple[FloatArray, ...]] = {}
    found = []
    for block in fit.blocks:
        if block.record not in runs:
            record = run_beside(model, parameters, setting.records[block.record], choice, setting.loop)
            factor = choice.decimation[block.record]
            rows = matched_rows(model, record, choice, factor, setting.drop, survey=NOTHING)
            runs[block.record] = rows.lines()
        Z = np.zeros((len(block.place), len(fit.columns)))
        lines = runs[block.record][block.row][:-1]
        for column, line in zip(touched[block.row], lines, strict=True):
            if column in place:
                Z[:, place[column]] = line[block.place]
        found.append(Z)
    return tuple(found)


def solve_with(fit: Fit, Z: tuple[FloatArray, ...]) -> Fit:
    """Return the instrumental-variable fit with weights from the residuals.

    No residual counts as smaller than what sampling and filters allow: a load row that is nearly exact would
    outweigh the forces, which alone fix the scale.
    """
    tiny = float(np.finfo(float).tiny)
    weights = []
    for block, residual in zip(fit.blocks, fit.residuals, strict=True):
        samples = np.sqrt(max(len(residual), 1))
        least = EXACTNESS * block.terms_norm(fit.solution.x) / samples
        weights.append(1.0 / max(float(np.linalg.norm(residual) / samples), least, tiny))
    return two_stage(replace(fit, weights=tuple(weights), notes=()), Z)


def simulation_parameters(
    model: Model, fit: Fit, covariance_of: Callable[[Fit], FloatArray] = hac_covariance
) -> dict[str, float]:
    """Return physical parameters for the simulation, nuisances of the fit included; 0 for what it lacks.

    Where there are more composites than physical parameters, `covariance_of` weighs them.
    """
    base = fit.all_parameters(model.base_parameters)
    try:
        found = dict(model.physical_from_base(base))
    except np.linalg.LinAlgError as error:
        raise diverged("no physical parameters belong to its estimate") from error
    if model.composites:
        covariance = covariance_of(fit)
        nothing = np.zeros_like(covariance)
        zero = dict.fromkeys(fit.absent, "absent")
        with_gaps = base.copy()
        with_gaps[[model.base_parameters.index(name) for name in fit.absent]] = np.nan
        covariances = Covariances(covariance, covariance, nothing, covariance)
        better, _ = physical_parameters(model, with_gaps, covariances, zero, {})
        found |= {entry.name: entry.value for entry in better}
    return {name: found.get(name, 0.0) for name in model.parameters}


def _norms(Z: tuple[FloatArray, ...]) -> FloatArray:
    return np.asarray(np.sqrt(np.sum([np.sum(z**2, axis=0) for z in Z], axis=0)))


def _largest_move(before: Fit, after: Fit) -> float:
    """Return how far the estimate moved: the largest share of what counts as standing still."""
    spread = np.sqrt(np.maximum(np.diag(hac_covariance(after)), 0.0))
    small = np.maximum(SMALL_MOVE * spread, SMALL_CHANGE * np.abs(after.solution.x))
    move = np.abs(after.solution.x - before.solution.x)
    return float(np.max(move / np.maximum(small, np.finfo(float).tiny)))


def _iv_notes(rounds: int) -> tuple[str, ...]:
    return (f"instruments and estimate agreed after {rounds} rounds",)
