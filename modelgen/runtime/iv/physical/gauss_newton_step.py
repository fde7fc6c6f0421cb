"""One step of `physical_iv`: rows linear at the present parameters, made white, solved with instruments.

What else is asked of the estimate enters here, where the rows are linear: Huber's weights (of white samples,
by their residual in this step), and bounds (a parameter at its bound is zero and its column leaves).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.runtime.iv.divergence import simulation_failed
from modelgen.runtime.iv.effect_rows import effect_rows, followed_records, simulated_with
from modelgen.runtime.iv.freed_effects import Grown, corrected, less_effects, quiet_rows
from modelgen.runtime.iv.instrumental_variables import Setting, instruments, simulated
from modelgen.runtime.iv.physical.friction_rows import (
    adds_friction,
    instruments_with_friction,
    with_friction,
)
from modelgen.runtime.iv.thresholds import FARTHEST
from modelgen.runtime.least_squares.delays import delay_rates
from modelgen.runtime.least_squares.efficient_weights import block_whiteners
from modelgen.runtime.least_squares.fit import CarriedOver, Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance, influence
from modelgen.runtime.least_squares.huber import huber, huber_notes
from modelgen.runtime.least_squares.projected_least_squares import two_stage
from modelgen.runtime.least_squares.thresholds import WHITENING_ORDER
from modelgen.runtime.least_squares.wls import refit
from modelgen.runtime.model.model import Model
from modelgen.runtime.parameters.bounds import bounded_physical, parameters_of
from modelgen.runtime.records.record import Record


@dataclass(frozen=True)
class Rules:
    """What steps keep to: robust weights, nothing below zero that cannot be, and what is held at zero.

    No inertia and no stiffness gets `farthest` times smaller or larger than at the start.
    """

    robust: bool = False
    bounded: bool = False
    at_zero: tuple[str, ...] = ()
    farthest: float = FARTHEST


@dataclass(frozen=True, eq=False)
class Unknowns:
    """Physical parameters p, shape (parameters,), delays of forces in s, sizes of the setting's effects."""

    p: FloatArray
    delays: Mapping[str, float]
    sizes: tuple[float, ...] = ()

    @property
    def vector(self) -> FloatArray:
        """All of them, SI, shape (n,)."""
        return np.array([*self.p, *self.delays.values(), *self.sizes])

    def records(self, setting: Setting) -> tuple[Record, ...]:
        """Return the records of a setting less delays, and effects as far as channels can be set right."""
        return corrected(setting.records, self.delays, setting.effects, self.sizes)


@dataclass(frozen=True, eq=False)
class GaussNewtonStep:
    """One Gauss-Newton step: rows in base columns at p, instruments, J, and the white linearised fits.

    `linear` is that of all columns, without bounds; `white` lacks the columns of what is at zero.
    """

    rows: Fit
    Z: tuple[FloatArray, ...]
    slope: FloatArray
    linear: Fit
    white: Fit
    notes: tuple[str, ...]

    @property
    def left(self) -> float:
        """Mean logarithm of what rows leave at p."""
        return self.rows.misfit / self.rows.count

    @property
    def free(self) -> list[int]:
        """Places of the columns of `white` among those of `linear`."""
        return [self.linear.columns.index(name) for name in self.white.columns]

    @property
    def x(self) -> FloatArray:
        """Solution in the columns of `linear`, in SI, shape (c,), zero where a parameter is held there."""
        x = np.zeros(len(self.linear.columns))
        x[self.free] = self.white.solution.x
        return x

    @property
    def spread(self) -> FloatArray:
        """Standard deviations of `x`, shape (c,)."""
        spread = np.zeros(len(self.linear.columns))
        spread[self.free] = np.sqrt(np.maximum(np.diag(hac_covariance(self.white)), 0.0))
        return spread

    @property
    def uncertainty(self) -> FloatArray:
        """`spread` in SI, without end where rows are short of rank and know nothing of a column; (c,)."""
        uncertainty = self.spread
        uncertainty[np.array(self.free)[self.white.solution.undetermined]] = np.inf
        return uncertainty


def possible_solution(step: GaussNewtonStep, model: Model, p: FloatArray) -> FloatArray:
    """Return the solution of a step from p, (parameters,), without Coulomb friction that cannot be; (c,).

    Bodies that turn together differ in what filters leave of masked samples. A step may take a hundred times
    the friction from the one and give it to the other, and no simulation returns from there. Where one whose
    deviation is larger than itself would be negative, sums of frictions that are known to less than their
    size stay what they are, and the others are those of least squares beside that.
    """
    x, spread = step.x, step.spread
    dry = [model.parameters.index(name) for name in parameters_of(model, "coulomb")]
    dry = [place for place in dry if p[place] and spread[place] > 0.0]
    if not any(x[place] < 0.0 and spread[place] > abs(p[place]) for place in dry):
        return x
    covariance, free = np.zeros((len(x),) * 2), step.free
    covariance[np.ix_(free, free)] = hac_covariance(step.white)
    size = np.abs(p[dry])
    variances, sums = np.linalg.eigh(covariance[np.ix_(dry, dry)] / np.outer(size, size))
    held = np.zeros((int(np.count_nonzero(variances > 1.0)), len(x)))
    held[:, dry] = sums[:, variances > 1.0].T / size
    gain = np.linalg.lstsq(held @ covariance @ held.T, held @ covariance, rcond=None)[0].T
    return np.asarray(x - gain @ (held[:, : len(p)] @ (x[: len(p)] - p)))


def step_from(
    setting: Setting, plain: Fit, now: Unknowns, rules: Rules, white: bool = True
) -> GaussNewtonStep:
    """Linearise rows at p, make them white, and solve them with the instruments of a simulation at p.

    Without `white` each row has one weight only.

    Raises
    ------
    IdentifiabilityError
        Where the simulation fails.
    """
    model = setting.model
    moved = now.records(setting)
    values = dict(zip(model.parameters, now.p.tolist(), strict=True))
    base, slope = model.base_from_physical(values), model.base_jacobian(values)
    fit = replace(
        plain,
        solution=replace(plain.solution, x=base),
        weights=(1.0,) * len(plain.blocks),
        notes=(),
    )
    there = replace(setting, records=moved)
    fit, Z, grown, quiet = _with_instruments(fit, there, values, now.sizes)
    most = WHITENING_ORDER if white else 0
    white_rows = block_whiteners(fit, setting.choice.steps_s(moved), most)
    fit = replace(fit, lost=round(sum(white_of.lost for white_of in white_rows)))
    rates = [delay_rates(fit, model, moved, setting.choice, setting.drop, channel) for channel in now.delays]
    steps = [rate.changed(np.negative) for rate in rates]
    further, beside = (_joined(fit, [*steps, *rows]) for rows in (grown, quiet))
    whitened, stacked = [], []
    parts = zip(fit.blocks, fit.residuals, Z, further, beside, white_rows, strict=True)
    for block, residual, z, own, calm, white_of in parts:
        W = white_of(np.column_stack([block.W @ slope, own]), block.place)
        Y = white_of(residual, block.place) + W[:, : len(now.p)] @ now.p
        whitened.append(replace(block.kept(), W=W, Y=Y))
        stacked.append(white_of(np.column_stack([z @ slope, calm]), block.place))
    if not all(np.all(np.isfinite(z)) for z in stacked):
        failed = DataError.at("simulation", "is not finite", "record another motion")
        raise simulation_failed(failed, plain, model) from failed
    names = (*model.parameters, *(f"delay of {channel}" for channel in now.delays))
    names += tuple(effect.name for effect in setting.effects)
    linear = replace(fit, columns=names, blocks=tuple(whitened))
    return GaussNewtonStep(fit, Z, slope, *_solved(two_stage(linear, tuple(stacked)), model, rules))


def _with_instruments(
    fit: Fit, setting: Setting, values: Mapping[str, float], sizes: Sequence[float]
) -> tuple[Fit, tuple[FloatArray, ...], Grown, Grown]:
    """Return a fit with its residuals, and instruments, both with the friction that its rows drop.

    Behind them: how Y - W X grows with each effect of the setting, and the same without noise of the sensors.
    """
    friction, effects = adds_friction(fit, setting), setting.effects
    if not friction and not effects:
        runs = simulated(fit, setting, values)
        return _with_residuals(fit), instruments(fit, setting, runs), (), ()
    beside = simulated_with(values, fit, setting)
    Z = instruments(fit, setting, {index: one.record for index, one in enumerate(beside)})
    grown = effect_rows(fit, setting, beside, effects, sizes)
    quiet = quiet_rows(fit, setting, beside, effects, grown)
    # what can be set right in the channels is; the rows have the others
    left = np.where([effect.edit is not None for effect in effects], 0.0, sizes)
    fit = less_effects(fit, grown, left) if left.any() else fit
    if not friction:
        return _with_residuals(fit), Z, grown, quiet
    Z = instruments_with_friction(Z, fit, setting, beside, values)
    # a weak feedback damps the chain, and bodies then turn and stick elsewhere than in the records
    close = followed_records(beside, fit, setting)
    return _with_residuals(with_friction(fit, setting, close, values)), Z, grown, quiet


def _joined(fit: Fit, columns: Sequence[Sequence[FloatArray]]) -> list[FloatArray]:
    """Return columns of one array a block each as one array a block, shape (n, columns)."""
    none = [np.zeros((len(block.place), 0)) for block in fit.blocks]
    return [np.column_stack(parts) for parts in zip(*columns, strict=True)] or none


def _with_residuals(fit: Fit) -> Fit:
    x = fit.solution.x
    return replace(fit, residuals=tuple(block.Y - block.W @ x for block in fit.blocks))


def _solved(every: Fit, model: Model, rules: Rules) -> tuple[Fit, Fit, tuple[str, ...]]:
    """Return the fit of all columns, that of those which are not at zero, and what is to be said of them."""
    linear, notes = _weighed(every, rules)
    at_zero = rules.at_zero
    if rules.bounded:
        within, _ = bounded_physical(linear, model, hac_covariance(linear))
        at_zero = tuple(name for name in linear.columns if name not in within.columns)
    if not at_zero:
        return linear, linear, notes
    white, notes = _weighed(refit(every, [name for name in every.columns if name not in at_zero]), rules)
    return linear, white, notes


def _weighed(fit: Fit, rules: Rules) -> tuple[Fit, tuple[str, ...]]:
    """Return the fit with robust weights, if these are wanted, and the sentence that says so."""
    if not rules.robust:
        return fit, ()
    found, weights = huber(fit)
    return found, huber_notes(weights)


def in_base_columns(step: GaussNewtonStep, now: Unknowns, rounds: int) -> Fit:
    """Return the fit in base columns: their covariance is that of the physical parameters, carried over."""
    white, parameters = step.white, step.slope.shape[1]
    free = [place for place in step.free if place < parameters]
    slope, c = step.slope if len(free) == parameters else step.slope[:, free], len(free)
    sums = np.zeros((len(slope), len(white.columns)))
    sums[:, :c] = slope
    solution = replace(
        white.solution,
        x=step.rows.solution.x,
        inverse=slope @ white.solution.inverse[:c, :c] @ slope.T,
        undetermined=white.solution.unseen(sums),
        null=np.zeros((0, len(slope))),
        scale=np.ones(len(slope)),
    )
    rms = [float(np.sqrt(np.mean(residual**2))) for residual in step.rows.residuals]
    weights = tuple(1.0 / max(size, float(np.finfo(float).tiny)) for size in rms)
    # regressors for tests of further columns
    projected = two_stage(replace(step.rows, weights=weights), step.Z).projected
    late_std, effect_std = np.split(step.spread[parameters:], [len(now.delays)])
    return replace(
        step.rows,
        solution=solution,
        weights=weights,
        projected=projected,
        delays=tuple(
            (channel, delay, float(std))
            for (channel, delay), std in zip(now.delays.items(), late_std, strict=True)
        ),
        notes=(f"instruments and physical parameters agreed after {rounds} rounds", *step.notes),
        carried=CarriedOver(
            step.linear,
            tuple(psi[:, :c] @ slope.T for psi in influence(white)),
            sizes=tuple(zip(now.sizes, effect_std.tolist(), strict=True)),
            at=now.p,
        ),
    )
