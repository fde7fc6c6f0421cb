"""Instrumental variables in the physical parameters, for rows whose columns are composites of them.

An elimination leaves more composites than physical parameters, and at the noise of usual sensors some of them
cannot be told apart; the fewer physical parameters can. Rows are linearised at the present estimate p,

    Y - W b(p) = W J (p' - p),    J = db/dp,

made white (`whitening`), and solved with the instruments Z J of a simulation at p, until p stands still
(Gauss-Newton steps). Delays of forces are further unknowns, see `delays`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from modelgen.errors import IdentifiabilityError
from modelgen.runtime.contract import Model
from modelgen.runtime.covariance import hac_covariance, influence
from modelgen.runtime.data import Record
from modelgen.runtime.delays import SMALLEST_STEP, advanced, delay_rates
from modelgen.runtime.instruments import Setting, diverged, instruments_at, simulation_parameters
from modelgen.runtime.observation import Observation
from modelgen.runtime.physical_start import physical_starts
from modelgen.runtime.two_stage import two_stage
from modelgen.runtime.whitening import whitener
from modelgen.runtime.wls import Fit, fit_matched

FloatArray = npt.NDArray[np.float64]
# records -> rows without the samples that a consistent estimate must not use
Rows = Callable[[tuple[Record, ...]], Observation]

ROUNDS = 25
# Done when nothing moves by more than this share of its standard deviation, or of its value;
SMALL_MOVE = 0.02
SMALL_CHANGE = 1e-6
# what has a standard deviation beyond this share of its value may move: nobody will be told its value.
HOPELESS = 0.5
# A step changes no parameter of the body or link by more than this share: far away the rows are not linear.
LARGEST_STEP = 0.5
# Nor can a parameter be this many times smaller or larger than at the start.
FARTHEST = 1e4
SIGNED = ("offset", "viscous", "coulomb")


@dataclass(frozen=True, eq=False)
class Unknowns:
    """Physical parameters p, shape (parameters,), and the delays of forces in s."""

    p: FloatArray
    delays: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class Step:
    """One Gauss-Newton step: rows in base columns at p, instruments, J, and the white linearised fit."""

    rows: Fit
    Z: tuple[FloatArray, ...]
    slope: FloatArray
    white: Fit


def fit_composites_iv(
    setting: Setting, rows: Rows, late: tuple[str, ...], near: Fit | None = None
) -> tuple[Observation, Fit]:
    """Estimate physical parameters and delays together, from the first start that leads anywhere.

    `near` is such a fit at other settings; else as `fit_physical_iv`.
    """
    if near is not None and not near.absent:
        return fit_physical_iv(setting, rows, late, simulation_parameters(setting.model, near))
    first = fit_matched(rows(tuple(setting.records)))
    failure = diverged("no physical parameters belong to its estimate")
    for start in physical_starts(first, setting):
        try:
            return fit_physical_iv(setting, rows, late, start)
        except IdentifiabilityError as error:
            failure = error
    raise failure


def fit_physical_iv(setting: Setting, rows: Rows, late: tuple[str, ...], start: Mapping[str, float]) -> tuple[
    Observation, Fit
]:  # fmt: skip
    """Estimate physical parameters and delays together, from a start (SI).

    Parameters
    ----------
    setting : Setting
        `records` as measured.
    rows : callable
        Takes records to their rows.
    late : tuple of str
        Forces whose delay is estimated as well.
    start : mapping of str to float
        All of the model's parameters.

    Returns
    -------
    Observation, Fit
        In base columns; delays compensated.

    Raises
    ------
    IdentifiabilityError
        When the steps do not come to rest.
    """
    model = setting.model
    sample = 1.0 / min(record.fs for record in setting.records)
    first = np.array([start[name] for name in model.parameters])
    now = Unknowns(first, dict.fromkeys(late, 0.0))
    c = len(model.parameters)
    observation = rows(tuple(setting.records))
    plain = fit_matched(observation)
    if plain.absent:
        raise diverged(f"the records do not move what {', '.join(plain.absent)} needs")
    for done in range(1, ROUNDS + 1):
        if late and done > 1:
            observation = rows(tuple(advanced(record, now.delays) for record in setting.records))
            plain = replace(plain, blocks=tuple(block for block in observation.blocks if block.place.size))
        step = _step(setting, plain, now)
        x = step.white.solution.x
        spread = np.sqrt(np.maximum(np.diag(hac_covariance(step.white)), 0.0))
        move = np.r_[x[:c] - now.p, x[c:]]
        if not np.all(np.isfinite(move)):
            raise diverged("its estimate is not finite")
        size = np.r_[np.abs(x[:c]), np.full(len(late), SMALLEST_STEP * sample / SMALL_CHANGE)]
        small = np.maximum(SMALL_MOVE * spread, SMALL_CHANGE * size)
        hopeless = spread > HOPELESS * np.r_[np.abs(x[:c]), np.full(len(late), np.inf)]
        if done > 1 and np.all((np.abs(move) <= small) | hopeless):
            return observation, _in_base_columns(step, now, spread[c:], done)
        now = _moved(model, now, move, sample)
        _check_distance(model, now.p, first)
    raise diverged(f"after {ROUNDS} rounds the physical parameters still move")


def _step(setting: Setting, plain: Fit, now: Unknowns) -> Step:
    """Linearise rows at p, make them white, and solve them with the instruments of a simulation at p."""
    model = setting.model
    moved = tuple(advanced(record, now.delays) for record in setting.records)
    values = dict(zip(model.parameters, now.p.tolist(), strict=True))
    base, slope = model.base_from_physical(values), model.base_jacobian(values)
    fit = replace(
        plain,
        solution=replace(plain.solution, x=base),
        residuals=tuple(block.Y - block.W @ base for block in plain.blocks),
        weights=(1.0,) * len(plain.blocks),
        notes=(),
    )
    there = replace(setting, records=moved)
    whiteners = [whitener(e, block.place) for e, block in zip(fit.residuals, fit.blocks, strict=True)]
    rates = [delay_rates(fit, model, moved, setting.choice, setting.drop, channel) for channel in now.delays]
    late = [np.column_stack(columns) for columns in zip(*rates, strict=True)] or [
        np.zeros((len(block.place), 0)) for block in fit.blocks
    ]
    Z = instruments_at(fit, there, values)
    white, stacked = [], []
    parts = zip(fit.blocks, fit.residuals, Z, late, whiteners, strict=True)
    for block, residual, z, rate, white_of in parts:
        W = white_of(np.column_stack([block.W @ slope, -rate]), block.place)
        Y = white_of(residual, block.place) + W[:, : len(now.p)] @ now.p
        white.append(replace(block, W=W, Y=Y))
        stacked.append(white_of(np.column_stack([z @ slope, -rate]), block.place))
    names = (*model.parameters, *(f"delay of {channel}" for channel in now.delays))
    linear = replace(fit, columns=names, blocks=tuple(white))
    return Step(fit, Z, slope, two_stage(linear, tuple(stacked)))


def _moved(model: Model, now: Unknowns, move: FloatArray, sample: float) -> Unknowns:
    """Return the unknowns after a step, shortened where it would leave the range of the linear rows."""
    c = len(now.p)
    bound = np.array(
        [name in model.roles and model.roles[name].role not in SIGNED for name in model.parameters]
    )
    share = np.abs(move[:c][bound]) / np.maximum(np.abs(now.p[bound]), np.finfo(float).tiny)
    length = min(1.0, LARGEST_STEP / max(float(share.max(initial=0.0)), LARGEST_STEP))
    late = np.clip(length * move[c:], -sample, sample)
    delays = {
        channel: delay + float(step) for (channel, delay), step in zip(now.delays.items(), late, strict=True)
    }
    return Unknowns(now.p + length * move[:c], delays)


def _check_distance(model: Model, p: FloatArray, first: FloatArray) -> None:
    for name, value, start in zip(model.parameters, p, first, strict=True):
        far = not abs(start) / FARTHEST <= abs(value) <= abs(start) * FARTHEST
        if far and start and model.roles[name].role not in SIGNED:
            raise diverged(f"{name} runs away")


def _in_base_columns(step: Step, now: Unknowns, late_std: FloatArray, rounds: int) -> Fit:
    """Return the fit in base columns: their covariance is that of the physical parameters, carried over."""
    white, slope = step.white, step.slope
    c = slope.shape[1]
    solution = replace(
        white.solution,
        x=step.rows.solution.x,
        inverse=slope @ white.solution.inverse[:c, :c] @ slope.T,
        undetermined=np.zeros(len(slope), dtype=bool),
    )
    rms = [float(np.sqrt(np.mean(residual**2))) for residual in step.rows.residuals]
    weights = tuple(1.0 / max(size, float(np.finfo(float).tiny)) for size in rms)
    # regressors for tests of further columns
    projected = two_stage(replace(step.rows, weights=weights), step.Z).projected
    return replace(
        step.rows,
        solution=solution,
        weights=weights,
        projected=projected,
        series=tuple(psi[:, :c] @ slope.T for psi in influence(white)),
        delays=tuple(
            (channel, delay, float(std))
            for (channel, delay), std in zip(now.delays.items(), late_std, strict=True)
        ),
        notes=(f"instruments and physical parameters agreed after {rounds} rounds",),
    )
