"""Physical sense of an arm's fit: its links are bodies, friction, rotor inertias and springs not below zero.

The rows are fitted once more under that condition, by their triangle (`nearest_bodies`). What bodies can have
is a convex set that holds the truth: in the metric of the rows the fit within it is never farther from the
truth than the one without, so that deviations of the latter hold for both.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modelgen.runtime.least_squares.fit import Fit, residuals_of
from modelgen.runtime.least_squares.wls import refit
from modelgen.runtime.model.model import Model
from modelgen.runtime.parameters.bounds import BoundCost, bounded_names
from modelgen.runtime.parameters.consistent_links import (
    LINK,
    Bodies,
    ConsistentEstimate,
    nearest_bodies,
)
from modelgen.runtime.parameters.thresholds import AT_BOUND


def bodies_of(model: Model) -> tuple[dict[str, tuple[str, ...]], tuple[str, ...]]:
    """Return the ten parameters of every link and payload by its name, and those no less than zero."""
    found: dict[str, list[str]] = {}
    for name, role in model.roles.items():
        if role.role == "link":
            found.setdefault(role.bodies[0], []).append(name)
    links = {body: tuple(names) for body, names in found.items() if len(names) == len(LINK)}
    return links, bounded_names(model)


def consistent_fit(fit: Fit, model: Model) -> tuple[Fit, BoundCost]:
    """Return the fit within what bodies can have, without the columns at zero, and what that costs.

    Raises
    ------
    DataError
        If Clarabel is not installed, or does not find the optimum.
    """
    links, bounded = bodies_of(model)
    within, found = among_bodies(fit, model)
    names = tuple(links)
    values = dict(zip(fit.columns, fit.solution.x.tolist(), strict=True))
    active = tuple((name, values[name]) for name in found.zero if name in values)
    held = tuple(names[place] for place in found.held)
    if not active and not held:
        return fit, BoundCost(bounded, (), 0.0, 0.0, names)
    before, after = fit.residual_norm, within.residual_norm
    grown = after / before - 1.0 if before > 0.0 else 0.0
    cost = BoundCost(bounded, active, grown, float(np.sqrt(found.cost)), names, held, len(fit.columns))
    at_zero = {name for name, _ in active}
    free = tuple(name for name in fit.columns if name not in at_zero)
    return replace(among_bodies(refit(fit, free), model)[0], notes=fit.notes, delays=fit.delays), cost


def among_bodies(fit: Fit, model: Model) -> tuple[Fit, ConsistentEstimate]:
    """Return a fit with the solution that bodies can have, of the same rows and columns."""
    links, bounded = bodies_of(model)
    columns = [model.base_parameters.index(name) for name in fit.columns]
    offset = model.base_from_physical(dict.fromkeys(model.parameters, 0.0))[columns]
    factors = model.base_jacobian({})[columns]
    c = len(columns)
    R = fit.triangle
    rounding = AT_BOUND * float(np.linalg.norm(R[:c, c]))
    sigma = max(fit.residual_norm / np.sqrt(max(fit.count - c, 1)), rounding)
    bodies = Bodies(model.parameters, tuple(links.values()), bounded, model.known)
    found = nearest_bodies(fit.solution.x - offset, R[:c, :c] / sigma, factors, bodies, offset)
    x = found.base
    return replace(fit, solution=replace(fit.solution, x=x), residuals=residuals_of(fit.blocks, x)), found
