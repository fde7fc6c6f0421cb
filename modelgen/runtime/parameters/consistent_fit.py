"""Physical sense of an arm's fit: its links are bodies, friction, rotor inertias and springs not below zero.

The rows are fitted once more under that condition, by their triangle (`nearest_bodies`), which says what it
costs. Where that moves links the estimate lies further inside, where bodies are likely (`centred_bodies`).

What bodies can have is a convex set that holds the truth: in the metric of the rows the nearest fit within it
is never farther from the truth than the one without, whose covariance is large enough for both. That of rows
and likely bodies together is too small where bodies are not what was taken for likely. The mean of the two
stands for the inverse of the fit, which its intervals follow from.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.least_squares.fit import Fit, residuals_of
from modelgen.runtime.least_squares.wls import refit
from modelgen.runtime.model.model import Model
from modelgen.runtime.parameters.bounds import BoundCost, bounded_names
from modelgen.runtime.parameters.centred_bodies import Centred, centred_bodies
from modelgen.runtime.parameters.consistent_links import (
    LINK,
    Bodies,
    ConsistentEstimate,
    nearest_bodies,
)
from modelgen.runtime.parameters.thresholds import AT_BOUND, WORTH_CENTRING


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
    found = _Search(fit, model).nearest
    names = tuple(links)
    values = dict(zip(fit.columns, fit.solution.x.tolist(), strict=True))
    active = tuple((name, values[name]) for name in found.zero if name in values)
    held = tuple(names[place] for place in found.held)
    if not active and not held:
        return fit, BoundCost(bounded, (), 0.0, 0.0, names)
    before, after = fit.residual_norm, float(np.linalg.norm(fit.triangle @ [*found.base, -1.0]))
    grown = after / before - 1.0 if before > 0.0 else 0.0
    cost = BoundCost(bounded, active, grown, float(np.sqrt(found.cost)), names, held, len(fit.columns))
    at_zero = {name for name, _ in active}
    free = tuple(name for name in fit.columns if name not in at_zero)
    return replace(among_bodies(refit(fit, free), model)[0], notes=fit.notes, delays=fit.delays), cost


def among_bodies(fit: Fit, model: Model) -> tuple[Fit, ConsistentEstimate]:
    """Return a fit with the solution that bodies can have, of the same rows and columns.

    Where bounds move it by a deviation or more it is that of likely ones; costs are those of the nearest.
    """
    search = _Search(fit, model)
    found, inverse = search.nearest, fit.solution.inverse
    if found.held and found.cost >= WORTH_CENTRING:
        centred = search.centred
        values = dict(zip(model.parameters, centred.parameters.tolist(), strict=True))
        base = search.factors @ centred.parameters + search.offset
        found = replace(found, base=base, parameters=values)
        spread = search.factors @ np.linalg.solve(centred.curvature, search.factors.T)
        inverse = 0.5 * (inverse + spread / search.sigma**2)
    solution = replace(fit.solution, x=found.base, inverse=inverse)
    return replace(fit, solution=solution, residuals=residuals_of(fit.blocks, found.base)), found


@dataclass(frozen=True, eq=False)
class _Search:
    """Bodies for the rows of a fit, in standard deviations that its residual gives these."""

    fit: Fit
    model: Model

    @cached_property
    def _columns(self) -> list[int]:
        return [self.model.base_parameters.index(name) for name in self.fit.columns]

    @cached_property
    def offset(self) -> FloatArray:
        """What known parameters contribute to the columns, shape (c,), in SI."""
        zero = dict.fromkeys(self.model.parameters, 0.0)
        return self.model.base_from_physical(zero)[self._columns]

    @cached_property
    def factors(self) -> FloatArray:
        """How often each parameter counts in each column, shape (c, parameters)."""
        return self.model.base_jacobian({})[self._columns]

    @cached_property
    def sigma(self) -> float:
        """The standard deviation of weighted rows."""
        fit, c = self.fit, len(self.fit.columns)
        rounding = AT_BOUND * float(np.linalg.norm(fit.triangle[:c, c]))
        return max(fit.residual_norm / float(np.sqrt(max(fit.count - c, 1))), rounding)

    @cached_property
    def _bodies(self) -> Bodies:
        links, bounded = bodies_of(self.model)
        return Bodies(self.model.parameters, tuple(links.values()), bounded, self.model.known)

    @property
    def _estimate(self) -> tuple[FloatArray, FloatArray, FloatArray, Bodies]:
        c = len(self.fit.columns)
        whitening = self.fit.triangle[:c, :c] / self.sigma
        return self.fit.solution.x - self.offset, whitening, self.factors, self._bodies

    @cached_property
    def nearest(self) -> ConsistentEstimate:
        """The nearest bodies."""
        return nearest_bodies(*self._estimate, self.offset)

    @property
    def centred(self) -> Centred:
        """Bodies inside."""
        return centred_bodies(*self._estimate, self.nearest.parameters)
