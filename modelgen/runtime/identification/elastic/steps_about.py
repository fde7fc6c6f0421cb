"""Fits of rows about a point, for steps of Gauss and Newton; where those that leave forces open rest."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from modelgen.array_types import FloatArray, IntArray
from modelgen.errors import IdentifiabilityError
from modelgen.runtime.diagnostics.noise_bias import less_noise
from modelgen.runtime.identification.elastic.starting_springs import most_deflected, springs_pull
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import run_wls
from modelgen.runtime.identification.thresholds import (
    AS_LIKELY,
    FURTHEST_AHEAD,
    LARGEST_PERCENT,
    LONGEST_LAG,
    MOST_DEFLECTED,
    MOST_STEPS,
    ROUNDING,
    SHORTEST_STEP,
    UNSEEN,
    WITHIN_NOISE,
)
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.model.deflected_kernel import DeflectedKernel
from modelgen.runtime.model.model import Model


class OpenRest(NamedTuple):
    """Where rows that leave forces open come to rest, (columns,) in SI; whether they tell every spring."""

    point: FloatArray
    told: bool


def rest_with_forces_open(
    job: Job, kernel: DeflectedKernel, points: Sequence[FloatArray], anyway: bool = False
) -> OpenRest | None:
    """Return where rows that leave forces open come to rest, from where they leave least; None where nowhere.

    Where what directions are off by hides the springs, those with all forces come to rest far from it, or
    nowhere. A place where they tell every stiffness is preferred to what leaves least. With `anyway` it is
    where the first of these ways leaves least, wherever it ends. Points are base parameters, (columns,) in
    SI.
    """
    begun = [(one, at) for at in points if (one := tried(job, kernel, at, True)) is not None]
    untold: tuple[float, OpenRest] | None = None
    for fit, point in sorted(begun, key=lambda one: left_by(one[0])):
        best, found, rests = _downhill(job, kernel, fit, point)
        if anyway or (rests and _tells_springs(job, kernel.at(found, sampled=True), best)):
            return OpenRest(found, True)
        if rests and (untold is None or left_by(best) < untold[0]):
            untold = left_by(best), OpenRest(found, False)
    return untold and untold[1]


def _tells_springs(job: Job, kernel: DeflectedKernel, fit: Fit) -> bool:
    """Return whether a fit knows every stiffness that gives a position, less what noise does to it."""
    springs = names_acting(job.model, kernel, 0)
    fit, _ = less_noise(replace(job.model, kernel=kernel), job.records, job.choice, fit)
    spread = np.sqrt(np.maximum(np.diag(hac_covariance(fit)), 0.0))
    known = {
        name: std < 0.01 * LARGEST_PERCENT * abs(value)
        for name, std, value in zip(fit.columns, spread, fit.solution.x, strict=True)
    }
    return all(known.get(name, False) for name in springs)


def names_acting(model: Model, kernel: DeflectedKernel, order: int) -> set[str]:
    """Return the columns of all springs that give a position (order 0), or of their dampers (1)."""
    return {model.base_parameters[column] for row in kernel.giving for column in row.acting(order)}


def _downhill(job: Job, kernel: DeflectedKernel, fit: Fit, point: FloatArray) -> tuple[Fit, FloatArray, bool]:
    """Return the fit where steps end that leave no more than before, the point, and whether they rest there.

    A step that leaves more than noise explains is halved, and what follows one that did not shrink. Which
    forces are open changes with the point: steps within the noise may go to and fro between two places
    for ever, and are shortened until they rest.
    """
    share, last, best = 1.0, np.inf, fit
    before, shortened = np.zeros(len(fit.columns)), 1.0
    for _ in range(MOST_STEPS):
        change = moved(job.model, kernel, best, point) - point
        noise = abs(float(best.triangle[-1, -1])) * np.sqrt(len(best.columns) / best.count)
        rounding = ROUNDING * size_of(best, point + change, job.model)
        along, size = weighted(best, change, job.model), size_of(best, change, job.model)
        if size < noise and along.shape == before.shape and along @ before < 0.0:
            shortened *= 0.5
        if shortened * size < max(WITHIN_NOISE * noise, rounding):
            return best, point, True
        ahead = tried(job, kernel, point + shortened * share * change, sampled=True)
        if ahead is not None and best.count * (left_by(ahead) - left_by(best)) < AS_LIKELY:
            point = point + shortened * share * change
            share = min(1.0, 2.0 * share) if size < last else 0.5 * share
            best, last, before = ahead, size, along
        else:
            share *= 0.5
        if share < SHORTEST_STEP:
            break
    return best, point, False


def tried(job: Job, kernel: DeflectedKernel, point: FloatArray, sampled: bool = False) -> Fit | None:
    """Return the fit of rows about a point, (columns,) in SI; None where it is none of an arm.

    `sampled` as in `fit_about`.
    """
    if not springs_pull(kernel, point) or not springs_hold(job, kernel, point):
        return None
    with suppress(IdentifiabilityError):
        return fit_about(job, kernel, point, sampled)
    return None


def springs_hold(job: Job, kernel: DeflectedKernel, point: FloatArray) -> bool:
    """Return whether springs of a point, (columns,) in SI, carry links with the motors.

    They deflect by few times the motion, as rows about others hold nothing else, and at the fastest motion of
    any joint are not much more of a damper, nor of one that pushes.
    """
    motion_hz, about = job.choice.dynamics_hz or job.choice.cutoff_hz, kernel.at(point)
    angles = [2.0 * np.pi * motion_hz * about.spring(row)[1] for row in kernel.giving]
    lags_little = all(-FURTHEST_AHEAD < angle < LONGEST_LAG for angle in angles)
    return lags_little and most_deflected(kernel, job.records, point) < MOST_DEFLECTED


def left_by(fit: Fit, values: FloatArray | None = None) -> float:
    """Return the logarithm of what rows leave where no force is open, the mean over all samples.

    They leave it of the columns' `values`, (c,) in SI, instead of the solution's.
    """
    counts = np.array([block.count for block in fit.blocks])
    used = np.array([max(block.count - block.opened, 1.0) for block in fit.blocks])
    left = fit.residual_norms if values is None else [one.summary.residual_norm(values) for one in fit.blocks]
    rms = np.array(left) / np.sqrt(used)
    return float(np.sum(counts * np.log(np.maximum(rms, 1e-300))) / np.sum(counts))


def fit_about(job: Job, kernel: DeflectedKernel, point: FloatArray, sampled: bool = False) -> Fit:
    """Return least squares of rows about a point, (columns,) in SI.

    `sampled`: directions at samples, and forces left open where these are uncertain.
    """
    about = replace(job.model, kernel=kernel.at(point, sampled))
    # far from an estimate rows may overflow: such points do not hold
    with np.errstate(all="ignore"), suppress(np.linalg.LinAlgError):
        return run_wls(replace(job, model=about))[1]
    names = ", ".join(record.name for record in job.records)
    raise IdentifiabilityError.at(names, "gives rows beyond all numbers about such springs", "try others")


def moved(model: Model, kernel: DeflectedKernel, fit: Fit, point: FloatArray) -> FloatArray:
    """Return the estimate, (columns,) in SI; what the rows do not show stays where it was.

    Deflections are linear in compliances: a spring that is to be softer moves in 1 / K, to first order the
    same step, which never leads below zero.
    """
    if kernel.motors_alone:
        return moved_least(model, kernel, fit, point)
    seen = ~np.asarray(fit.solution.undetermined)
    columns = np.array(columns_of(fit, model))[seen]
    return _towards(kernel, point, columns, fit.solution.x[seen])


def moved_least(
    model: Model,
    kernel: DeflectedKernel,
    fit: Fit,
    point: FloatArray,
    held: Collection[int] = (),
    damping: float = 0.0,
    unseen: float = UNSEEN,
) -> FloatArray:
    """Return the estimate of the least change, (columns,) in SI, some base parameters held.

    `damping` weighs changes of what positions depend on; `unseen` as in `held_values`.
    """
    columns = np.array(columns_of(fit, model))
    damped = damping * np.isin(columns, kernel.columns).astype(np.float64)
    return _towards(kernel, point, columns, held_values(fit, model, point, held, damped, unseen))


def _towards(kernel: DeflectedKernel, point: FloatArray, columns: IntArray, values: FloatArray) -> FloatArray:
    """Return the point, (columns,) in SI, with values in some columns, springs softened in 1 / K."""
    found = point.copy()
    springs = {column for row in kernel.giving for column in row.acting(0)}
    for column, value in zip(columns, values, strict=True):
        if column in springs and value < point[column]:
            found[column] = point[column] / (2.0 - value / point[column])
        else:
            found[column] = value
    return found


def held_values(
    fit: Fit,
    model: Model,
    point: FloatArray,
    held: Collection[int] = (),
    damping: FloatArray | float = 0.0,
    unseen: float = UNSEEN,
) -> FloatArray:
    """Return what the rows say where some base parameters stay at the point, (c,) in SI.

    Rows are linear about the point, not about zero: to leave columns out would take what is held to zero, and
    so does a solution with what rows do not show, as two inertias in front of and behind a rigid spring. Here
    the change is the smallest one. `damping` is the weight of changes, of unit columns; directions in these
    that rows show by less than a share `unseen` of the best shown one stay as they are.
    """
    columns, width = columns_of(fit, model), len(fit.columns)
    values = point[columns].copy()
    free = [place for place, column in enumerate(columns) if column not in held]
    left = fit.triangle[:, width] - fit.triangle[:, :width] @ values
    scale = np.linalg.norm(fit.triangle[:, free], axis=0)
    scale[scale == 0.0] = 1.0
    rows = fit.triangle[:, free] / scale
    if np.any(damping):
        weight = np.sqrt(np.broadcast_to(damping, width)[free])
        rows, left = np.vstack([rows, np.diag(weight)]), np.concatenate([left, np.zeros(len(free))])
    values[free] += np.linalg.lstsq(rows, left, rcond=unseen)[0] / scale
    return values


def columns_of(fit: Fit, model: Model) -> list[int]:
    """Return the places of a fit's columns among the base parameters."""
    return [model.base_parameters.index(name) for name in fit.columns]


def weighted(fit: Fit, change: FloatArray, model: Model) -> FloatArray:
    """Return what a change, (base parameters,) in SI, changes in the weighted rows, turned into (c,)."""
    width = len(fit.columns)
    return fit.triangle[:width, :width] @ change[columns_of(fit, model)]


def size_of(fit: Fit, change: FloatArray, model: Model) -> float:
    """Return the norm of what a change, (base parameters,) in SI, changes in the weighted rows."""
    return float(np.linalg.norm(weighted(fit, change, model)))
