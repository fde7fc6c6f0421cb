"""Instrumental variables: X = (Z^T W)^-1 Z^T Y with Z from a noise-free simulation of the model.

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
from modelgen.runtime.iv.companion_simulation import Loop, run_beside
from modelgen.runtime.iv.divergence import diverged, refuse_few, refuse_runaway, simulation_failed
from modelgen.runtime.iv.effect import Effect
from modelgen.runtime.iv.thresholds import (
    FORESEEN,
    LATER_MOVE,
    LEAST_RESIDUAL,
    NEAR,
    NEAR_SHARE,
    ROUNDS,
    SHRINKING,
    SMALL_CHANGE,
    SMALL_MOVE,
    STILL_ROUNDS,
    VANISHED_ROW,
)
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.least_squares.projected_least_squares import two_stage
from modelgen.runtime.model.model import Model
from modelgen.runtime.parameters.nearest_parameters import nearest_parameters
from modelgen.runtime.parameters.physical_parameters import Covariances, physical_parameters
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.record_rows import unmasked_rows
from modelgen.runtime.rows.row_terms import RowTerms
from modelgen.runtime.simulation.plant import possible


@dataclass(frozen=True, eq=False)
class Setting:
    """The records, filters and controller that the model is simulated with.

    `guessed` are the directions of motion in the records that no sensor gives and no user: those of others.
    Steps in physical parameters estimate `effects` as well; they begin at `sizes`. With `closer`, friction
    that rows drop turns as `other_directions` say.
    """

    model: Model
    records: Sequence[Record]
    choice: FilterChoice
    drop: int = 0
    loop: Loop | None = None
    guessed: tuple[str, ...] = ()
    effects: tuple[Effect, ...] = ()
    sizes: tuple[float, ...] = ()
    closer: bool = False


def fit_iv(start: Fit, setting: Setting) -> Fit:
    """Iterate instruments and estimate until the estimate stands still.

    Parameters
    ----------
    start : Fit
        To these rows: by least squares, or with the solution of a fit at other settings. The noise-free
        records of the latter serve here as well, unless the estimate turns out far from it.
    setting : Setting

    Raises
    ------
    IdentifiabilityError
        When the iteration diverges, or does not come to rest.
    DataError
        When the model cannot be simulated.
    """
    fit, moves, runs = start, list[float](), start.simulated
    for _ in range(ROUNDS):
        following = iv_round(fit, setting, runs)
        near = runs is not None and _is_near(following, start)
        if not near:
            moves.append(_largest_move(fit, following))
        if near or _stands_still(moves):
            told = f"instruments and estimate agreed after {len(moves) + near} rounds"
            return replace(following, notes=(told,))
        fit, runs = following, None
    raise diverged(
        f"after {ROUNDS} rounds an estimate still moves by {SMALL_MOVE * moves[-1]:.2g} standard deviations",
        fit,
        setting.model,
    )


def iv_round(fit: Fit, setting: Setting, runs: Mapping[int, Record] | None = None) -> Fit:
    """Return the fit with instruments from the given one, or from noise-free records that there are.

    Where its simulation leads nowhere, it is simulated without what the rows do not tell (`_told`).

    Raises
    ------
    IdentifiabilityError
        When that leads nowhere either, or samples are too few.
    """
    refuse_few(fit, 0, setting.model)
    if runs is not None:
        return _round(fit, setting, runs)
    model = setting.model
    try:
        return _round(fit, setting, simulated(fit, setting, simulation_parameters(model, fit)))
    except IdentifiabilityError:
        held = _told(fit)
        if held is fit:
            raise
        return _round(fit, setting, simulated(fit, setting, simulation_parameters(model, held)))


def _told(fit: Fit) -> Fit:
    """Return a fit without what its rows do not tell: sums of terms more uncertain than all terms together.

    Friction that cannot be told from an offset may come out as anything, of either sign.
    """
    solution = fit.solution
    x = solution.scale * solution.x
    variances, V = np.linalg.eigh(np.outer(solution.scale, solution.scale) * hac_covariance(fit))
    loose = V[:, variances > float(x @ x)]
    if not loose.shape[1]:
        return fit
    return replace(fit, solution=replace(solution, x=(x - loose @ (loose.T @ x)) / solution.scale))


def _round(fit: Fit, setting: Setting, runs: Mapping[int, Record]) -> Fit:
    following = two_stage(weighed(fit), instruments(fit, setting, runs))
    refuse_runaway(following.columns, following.solution.x, fit, setting.model)
    return replace(following, simulated=runs)


def simulated(fit: Fit, setting: Setting, values: Mapping[str, float]) -> Mapping[int, Record]:
    """Return what a simulation with these physical parameters (SI) gives in place of each record of the fit.

    Raises
    ------
    IdentifiabilityError
        When the simulation fails.
    """
    model, choice = setting.model, setting.choice
    parameters = possible(model, values)
    try:
        return {
            index: run_beside(model, parameters, setting.records[index], choice, setting.loop)
            for index in dict.fromkeys(block.record for block in fit.blocks)
        }
    except DataError as error:
        raise simulation_failed(error, fit, model) from error


def instruments(fit: Fit, setting: Setting, runs: Mapping[int, Record]) -> tuple[FloatArray, ...]:
    """Return for every block of the fit its columns built from the simulation, in SI, (n, k) each.

    Raises
    ------
    IdentifiabilityError
        When the simulation does not move what a column needs.
    """
    model, choice = setting.model, setting.choice
    every = [model.base_parameters.index(name) for name in fit.columns]
    found: list[FloatArray] = [np.zeros(0)] * len(fit.blocks)
    for record, indices in fit.by_record.items():
        rows = unmasked_rows(model, runs[record], choice, choice.decimation[record], setting.drop)
        blocks = [fit.blocks[index] for index in indices]
        asked = []
        for index, block in zip(indices, blocks, strict=True):
            own = tuple(every[column] for column in fit.touched(index))
            entries = dict(zip(rows.terms[block.row].columns, rows.terms[block.row].entries, strict=False))
            asked.append(RowTerms(block.row, own, tuple(entries.get(column, ()) for column in own)))
        try:
            made = rows.lines(asked, [block.place for block in blocks])
        except DataError as error:  # of a record that is read in stretches the simulation is made now
            raise simulation_failed(error, fit, model) from error
        for index, lines in zip(indices, made, strict=True):
            found[index] = lines
    power = np.zeros(len(fit.columns))
    for index, lines in enumerate(found):
        power[fit.touched(index)] += [float(line @ line) for line in lines]
    still = [name for name, size in zip(fit.columns, power, strict=True) if size == 0.0]
    if still:
        raise diverged(f"its simulation does not move what {', '.join(still)} needs", fit, model)
    return tuple(lines.T for lines in found)


def weighed(fit: Fit) -> Fit:
    """Return the fit with weights from its residuals.

    No residual counts as smaller than a share of its largest term: the forces, which alone fix the scale,
    would be lost beside a load row that is exact.

    Raises
    ------
    IdentifiabilityError
        When the parameters of a row without a force have shrunk to nothing: zero solves it, too.
    """
    tiny = float(np.finfo(float).tiny)
    weights = []
    for block, residual in zip(fit.blocks, fit.residuals, strict=True):
        samples = float(np.sqrt(max(len(residual), 1)))
        largest = block.terms_norm(fit.solution.x) / samples
        if not block.has_force and largest < VANISHED_ROW * block.force_scale:
            what = f"all parameters of row {block.row_name} go to zero, which solves a row without a force"
            raise diverged(f"{what}; noise of the sensors in {block.record_name} hides its motion")
        least = LEAST_RESIDUAL * largest
        weights.append(1.0 / max(float(np.linalg.norm(residual) / samples), least, tiny))
    return replace(fit, weights=tuple(weights), notes=())


def simulation_parameters(
    model: Model, fit: Fit, covariance_of: Callable[[Fit], FloatArray] = hac_covariance
) -> dict[str, float]:
    """Return physical parameters (SI) for the simulation, nuisances of the fit included; 0 for what it lacks.

    Where there are more composites than physical parameters, `covariance_of`, shape (c, c), weighs them.
    """
    base = fit.all_parameters(model.base_parameters)
    if model.is_arm:  # its sums say all that moves it
        return dict(zip(model.base_parameters, base.tolist(), strict=True))
    if fit.carried is not None and fit.carried.at is not None:
        known = dict(zip(model.parameters, fit.carried.at.tolist(), strict=True))
        # unless something was taken off since: the way back from sums is long
        if np.array_equal(model.base_from_physical(known), base):
            return known
    if not model.composites:
        found = dict(model.physical_from_base(base))
    else:
        nearest = nearest_parameters(model, base)
        if not nearest:
            raise diverged("no physical parameters belong to its estimate", fit, model)
        found = {name: nearest[0][name] for name in model.identifiable}
        covariance = covariance_of(fit)
        nothing = np.zeros_like(covariance)
        zero = dict.fromkeys(fit.absent, "absent")
        with_gaps = base.copy()
        with_gaps[[model.base_parameters.index(name) for name in fit.absent]] = np.nan
        covariances = Covariances(covariance, covariance, nothing, covariance)
        better = physical_parameters(model, with_gaps, covariances, zero, {}).parameters
        found |= {entry.name: entry.value for entry in better}
    return {name: found.get(name, 0.0) for name in model.parameters}


def _largest_move(before: Fit, after: Fit) -> float:
    """Return how far the estimate moved: the largest share of what counts as standing still."""
    spread = np.sqrt(np.maximum(np.diag(hac_covariance(after)), 0.0))
    small = np.maximum(SMALL_MOVE * spread, SMALL_CHANGE * np.abs(after.solution.x))
    move = np.abs(after.solution.x - before.solution.x)
    return float(np.max(move / np.maximum(small, np.finfo(float).tiny)))


def _stands_still(moves: Sequence[float]) -> bool:
    """Tell whether the estimate has come to rest, or the next round would hardly show otherwise.

    The rounds shrink the moves by about the same share each, but for directions that jump from sample to
    sample: after many rounds more counts as rest.
    """
    if moves[-1] < (1.0 if len(moves) <= STILL_ROUNDS else LATER_MOVE / SMALL_MOVE):
        return True
    share = moves[-1] / moves[-2] if len(moves) > 1 else 1.0
    return share < SHRINKING and moves[-1] * share / (1.0 - share) < FORESEEN


def _is_near(fit: Fit, start: Fit) -> bool:
    """Tell whether a simulation with the start's parameters gives as good instruments as one with the fit's.

    Instruments that are off by some share cost a little efficiency, and leave the estimate consistent.
    """
    move = np.abs(fit.solution.x - start.solution.x)
    far = move > NEAR_SHARE * np.abs(start.solution.x)
    # what noise may do to these is looked at only where there are any
    return not far.any() or bool(np.all(move[far] ** 2 <= NEAR**2 * np.diag(hac_covariance(fit))[far]))
