"""Instruments less what noise of the forces that drive their simulation does to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, IdentifiabilityError
from modelgen.runtime.identification.explanation.drive_noise import DriveBias, drive_bias
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import IV, Method
from modelgen.runtime.identification.thresholds import BIAS_SHARE, LEFT_DRIVEN, LEFT_TURNING, MOST_DRIVEN
from modelgen.runtime.least_squares.fit import CarriedOver, Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.model.model import Model


def driven_by_noise(job: Job, method: Method, fit: Fit) -> DriveBias:
    """Return what noise of forces shifts instruments of a chain by; zero if that is little, or not known.

    Little against the deviations that all samples give, of which the job has a share.
    """
    c = len(fit.columns)
    none = DriveBias(np.zeros(c), np.zeros(len(fit.delays)), np.zeros((c, c)), 0.0)
    plain = isinstance(method, IV) and method.robust is None and method.bounds is None
    chain = not job.model.is_arm and fit.projected is not None
    lost = bool(fit.unknown) or (fit.carried is not None and fit.carried.at is None)
    if not plain or not chain or lost or job.loop:  # nor where a controller drives the simulation
        return none
    try:
        bias = drive_bias(job, fit)
    except (DataError, IdentifiabilityError):
        return none
    matters = np.abs(bias.shift) > BIAS_SHARE * np.sqrt(job.share) * _deviations(fit)
    return bias if np.any(matters) else none


def _deviations(fit: Fit) -> FloatArray:
    return np.asarray(np.sqrt(np.maximum(np.diag(hac_covariance(fit)), np.finfo(float).tiny)))


def less_driven(
    job: Job, method: Method, fit: Fit, again: bool = False, known: DriveBias | None = None
) -> tuple[Fit, FloatArray, tuple[str, ...]]:
    """Return a fit less what noise of the forces shifts it by, what of that may be left, and what is said.

    `known` is what `driven_by_noise` has given for that fit, if it was asked for.

    Returns
    -------
    Fit
        As it is where that shift does not matter, or is not known: in first order in the noise's share.
    array, shape (c, c)
        A mean square in SI.
    tuple of str

    Raises
    ------
    IdentifiabilityError
        Where the fit is another one `again`, for comparison, and the shift is not known.
    """
    x, none = fit.solution.x, np.zeros((len(fit.columns),) * 2)
    bias = driven_by_noise(job, method, fit) if known is None else known
    if not np.any(bias.shift):
        return fit, none, ()
    most = int(np.argmax(np.abs(bias.shift) / _deviations(fit)))
    told = f"noise of the forces shifts instruments (most {fit.columns[most]}"
    # what effects add to the channels is simulated: noise is in it as well, which is not in that shift
    noisy = [one for one in job.effects if one.kind not in ("zero", "constant")]
    if bias.share > MOST_DRIVEN or noisy:
        if again:
            raise IdentifiabilityError.at("instruments", "are shifted by noise of the forces", "filter less")
        return fit, np.outer(bias.shift, bias.shift), (f"{told}); the intervals are widened by that",)
    # between nothing and all of it where it is no more than a bound
    taken = 0.5 if bias.at_most else 1.0
    shifted, carried = x - taken * bias.shift, fit.carried
    if carried is not None and carried.at is not None and bias.carried is not None:
        shifted, carried = _carried_less(job.model, fit.columns, carried, carried.at, taken * bias.carried)
    with np.errstate(divide="ignore"):
        size = 100.0 * abs(np.divide(taken * bias.shift[most], shifted[most]))
    solution = replace(fit.solution, x=shifted)
    moved = [*bias.delays.tolist(), *[0.0] * (len(fit.delays) - len(bias.delays))]
    late = tuple(
        (key, late - taken * by, std) for (key, late, std), by in zip(fit.delays, moved, strict=True)
    )
    # residuals stay: what each instant adds to the estimate's error has a mean of zero in these
    found = replace(fit, solution=solution, delays=late, carried=carried)
    # at reversals noise turns friction as well, which moves instruments in another way
    part = max(LEFT_TURNING if fit.turning else LEFT_DRIVEN, 1.0 - taken)
    left = part**2 * np.outer(bias.shift, bias.shift) + bias.spread
    return found, left, (f"{told}, by {size:.2g} %), which is taken off",)


def _carried_less(
    model: Model, columns: Sequence[str], carried: CarriedOver, at: FloatArray, shift: FloatArray
) -> tuple[FloatArray, CarriedOver]:
    """Return base columns, in SI, (c,), and the fit of physical parameters that they come from, less a shift.

    It is that of all columns of this fit, (n,): parameters, delays, sizes of effects.
    """
    own, p = carried.linear.solution, len(at)
    moved = np.append(shift[:p], np.zeros(len(own.x) - p))  # steps of delays and sizes are zero at the end
    linear = replace(carried.linear, solution=replace(own, x=own.x - moved))
    by = shift[len(shift) - len(carried.sizes) :]
    sizes = tuple((size - one, std) for (size, std), one in zip(carried.sizes, by.tolist(), strict=True))
    there = at - shift[:p]
    base = model.base_from_physical(dict(zip(model.parameters, there.tolist(), strict=True)))
    x = base[[model.base_parameters.index(name) for name in columns]]
    return np.asarray(x), replace(carried, linear=linear, sizes=sizes, at=there)
