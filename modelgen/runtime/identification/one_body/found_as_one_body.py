"""What slow motion tells of a chain whose springs it does not show: sums of the chain as one body.

Rows of a chain with one sensor hold derivatives of force and motion that say the same of each other below
the modes. Composites, and steps in the parameters, are open along what a delay, the damping and the springs
share, and take friction and inertia with them, which any motion shows.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace

import numpy as np

from modelgen.errors import DataError, IdentifiabilityError, listed
from modelgen.magnitudes import SMALLEST
from modelgen.progress import step
from modelgen.runtime.advice import Advice
from modelgen.runtime.identification.methods import Auto
from modelgen.runtime.identification.one_body.body_model import as_one_body
from modelgen.runtime.identification.one_body.thresholds import (
    CERTAIN_PERCENT,
    HALVED_CUTOFFS,
    UNLIKE_A_SPRING,
)
from modelgen.runtime.identification.options import Filters
from modelgen.runtime.identification.task import Task
from modelgen.runtime.identification.thresholds import LARGEST_PERCENT
from modelgen.runtime.model.mechanical_parts import BENDING
from modelgen.runtime.model.model import Model
from modelgen.runtime.parameters.bounds import parameters_of
from modelgen.runtime.parameters.parameter import Parameter
from modelgen.runtime.results.estimate import Estimate

Identify = Callable[[Model, Filters], Estimate]
REMEDY = "record a chirp or steps that reach the mode of vibration, or sense another body"
# What is said of a residual that one body on bending springs does not explain.
UNEXPLAINED = ("more than the model", "more than noise", "unexplained", "negative")


def found_as_one_body(task: Task, chain: Estimate | None, identify: Identify) -> Estimate | None:
    """Return a chain as one body where its own estimate has no stiffness; None where that is no better.

    Where springs bend in another way than far below a mode, the cut-off is lowered.

    Parameters
    ----------
    task : Task
        As given.
    chain : Estimate or None
        What was found of the chain, if anything was.
    identify : callable
        Takes a model and filters to their estimate.
    """
    model = task.model
    if not isinstance(task.method, Auto) or not task.checks.drift_check or model.is_arm:
        return None
    if chain is not None and any(name in chain.physical for name in parameters_of(model, "stiffness")):
        return None
    body = as_one_body(model)
    if body is None:
        return None
    step("looking at the chain as one body")
    best = best_at_lower_cutoffs(task, lambda filters: identify(body, filters))
    if best is None or (chain is not None and _open(best, best) >= _open(chain, best)):
        return None
    return _told(best, model)


def best_at_lower_cutoffs(task: Task, identify: Callable[[Filters], Estimate]) -> Estimate | None:
    """Return the estimate that says most of those that leave noise, else of all that springs allow."""
    known = list[Estimate]()
    for found in _at_lower_cutoffs(task, identify):
        if _is_known(found):
            known.append(found)
            if _is_explained(found) and max(_spreads(found, found)) < CERTAIN_PERCENT:
                break
    return max(known, key=lambda one: (_is_explained(one), -_open(one, one)), default=None)


def _at_lower_cutoffs(task: Task, identify: Callable[[Filters], Estimate]) -> Iterator[Estimate]:
    """Yield what is found at the cut-off that is chosen, or given, and below the former.

    Where nothing is found there, motion is too little or hidden, and less of it shows below.
    """
    try:
        found = identify(task.filters)
    except (IdentifiabilityError, DataError):
        return
    yield found
    if task.filters.cutoff_hz is not None or _of_role(found, "inertia") is None:
        return
    for halved in range(1, HALVED_CUTOFFS + 1):
        cutoff_hz = found.fit.filtering.cutoff_hz * 0.5**halved
        with suppress(IdentifiabilityError, DataError):
            yield identify(replace(task.filters, cutoff_hz=cutoff_hz))


def _spreads(found: Estimate, body: Estimate) -> list[float]:
    """Return how uncertain an estimate leaves each parameter of one body but its bending: in %, to 100."""
    own = {one.name: one.relative_std for one in found.parameters.physical}
    names = [one.name for one in body.parameters.physical if body.model.roles[one.name] != BENDING]
    return [min(own.get(name, 100.0), 100.0) for name in names]


def _open(found: Estimate, body: Estimate) -> float:
    """Return how much an estimate leaves open of these, all digits together."""
    return float(np.sum(np.log(np.maximum(_spreads(found, body), SMALLEST))))


def _is_explained(found: Estimate) -> bool:
    return not any(one.kind in UNEXPLAINED for one in found.checks.advice)


def _is_known(found: Estimate) -> bool:
    """Tell whether inertia has a number, and what springs bend is none that no spring has."""
    inertia, bending = _of_role(found, "inertia"), _of_role(found, BENDING)
    if inertia is None or inertia.value <= 0.0 or inertia.relative_std > LARGEST_PERCENT:
        return False
    return bending is None or bending.value > -UNLIKE_A_SPRING * bending.std


def _of_role(found: Estimate, role: str) -> Parameter | None:
    return next((one for one in found.parameters.physical if found.model.roles[one.name] == role), None)


def _told(found: Estimate, model: Model) -> Estimate:
    """Return the estimate with what the records do not tell of the chain, why, and what would."""
    lost = [name for name in model.parameters if name not in found.model.roles]
    inertia = _of_role(found, "inertia")
    cutoff_hz = found.fit.filtering.cutoff_hz
    total = inertia.name if inertia is not None else ""
    reason = (
        f"the bodies move as one up to {cutoff_hz:.3g} Hz, where these records tell what they do; "
        f"{total} is their inertia if the mode of vibration is above that"
    )
    advice = Advice("too slow", listed(lost), "do not show in motion far below the mode of vibration", REMEDY)
    parameters = found.parameters
    reasons = {**parameters.not_identifiable, **dict.fromkeys(lost, reason)}
    return replace(
        found,
        parameters=replace(parameters, not_identifiable=reasons),
        checks=replace(found.checks, advice=(*found.checks.advice, advice)),
    )
