"""Physical sense: inertia, stiffness, damping and friction not below zero, and what that bound costs.

The bounded estimate minimises the same weighted residual (`scipy.optimize.lsq_linear` on the triangle of the
weighted rows). A bound that is active is a sign, not a cure: the records ask for a value that nature does not
have, so the price is told, and a parameter at its bound has no interval.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import IdentifiabilityError, listed
from modelgen.runtime.advice import Advice
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.least_squares.wls import refit
from modelgen.runtime.model.model import Model
from modelgen.runtime.parameters.thresholds import AT_BOUND, BEYOND_CHANCE, CONTRADICTED, DRAWS

PHYSICAL = "physical"
# Never negative in nature.
POSITIVE_ROLES = ("inertia", "stiffness", "viscous", "coulomb", "damping")


@dataclass(frozen=True)
class BoundCost:
    """What bounds did: `active` pairs of parameter at zero and the value it would have had without.

    `residual_increase` is by what share the norm of the weighted residual grew, `deviations` how far from the
    unbounded estimate this is in standard deviations (root of the Wald statistic of the active ones). Of an
    arm `bodies` are links and payloads whose masses and inertias are those of bodies, `held` those of them
    that this moved; the deviations are then all that `columns` parameters together were moved by.
    """

    bounded: tuple[str, ...]
    active: tuple[tuple[str, float], ...]
    residual_increase: float
    deviations: float
    bodies: tuple[str, ...] = ()
    held: tuple[str, ...] = ()
    columns: int = 1

    @property
    def surprise(self) -> float:
        """How unlikely the bounds are, as so many deviations of a single number (Fisher, of chi-square)."""
        if self.columns == 1:
            return self.deviations
        return float(np.sqrt(2.0) * self.deviations - np.sqrt(2.0 * self.columns - 1.0))


def negative_columns(model: Model, fit: Fit) -> dict[str, float]:
    """Return the columns of a fit that are negative although nature has no such thing, with their values."""
    return negative_parameters(model, dict(zip(fit.columns, fit.solution.x.tolist(), strict=True)))


def negative_parameters(model: Model, values: Mapping[str, float]) -> dict[str, float]:
    """Return those of some values that are negative although nature has no such thing."""
    bounded = bounded_names(model)
    return {name: value for name, value in values.items() if value < 0.0 and name in bounded}


def impossible_columns(model: Model, fit: Fit) -> tuple[str, ...]:
    """Return the columns of a fit, composites as well, whose sign nature does not have, beyond chance."""
    lower, upper = bounded_below_or_above(model)
    places = [model.base_parameters.index(name) for name in fit.columns]
    std = np.sqrt(np.maximum(np.diag(hac_covariance(fit)), 0.0))
    beyond = np.maximum(lower[places] - fit.solution.x, fit.solution.x - upper[places])
    found = np.flatnonzero(beyond > BEYOND_CHANCE * std)
    return tuple(fit.columns[place] for place in found.tolist())


def bounded_below_or_above(model: Model) -> tuple[FloatArray, FloatArray]:
    """Return bounds of the base parameters, zero or infinite in any unit, that follow from physical signs.

    Shape (columns,) each. What is never negative (nor positive) for any inertia, stiffness, damping and
    friction above zero is bounded by zero; offsets and cubic stiffness are free. Decided on 200 random points
    over ten decades.
    """
    rng = np.random.default_rng(0)
    bounded = bounded_names(model)
    positive = np.array([name in bounded for name in model.parameters])
    size = 10.0 ** rng.uniform(-5.0, 5.0, (DRAWS, len(model.parameters)))
    sign = np.where(positive, 1.0, rng.choice([-1.0, 1.0], size.shape))
    points = [dict(zip(model.parameters, row, strict=True)) for row in (size * sign).tolist()]
    values = np.array([model.base_from_physical(point) for point in points])
    lower = np.where(np.all(values >= 0.0, axis=0), 0.0, -np.inf)
    upper = np.where(np.all(values <= 0.0, axis=0), 0.0, np.inf)
    return lower, upper


def bounded_fit(fit: Fit, model: Model, covariance: FloatArray) -> tuple[Fit, BoundCost]:
    """Return the fit within the bounds, without the columns at zero, and what the bounds cost.

    Parameters
    ----------
    fit : Fit
        Without bounds; least squares or instrumental variables.
    model : Model
    covariance : array, shape (c, c)
        Of that fit, in SI.

    Raises
    ------
    IdentifiabilityError
        When nothing is left above zero.
    """
    lower, upper = bounded_below_or_above(model)
    places = [model.base_parameters.index(name) for name in fit.columns]
    return _fit_within(fit, lower[places], upper[places], covariance)


def bounded_physical(fit: Fit, model: Model, covariance: FloatArray) -> tuple[Fit, BoundCost]:
    """Return the same for a fit whose columns are physical parameters, and further ones without bounds.

    `covariance` is that of the columns, in SI, shape (c, c).
    """
    bounded = bounded_names(model)
    lower = np.array([0.0 if name in bounded else -np.inf for name in fit.columns])
    return _fit_within(fit, lower, np.full(len(lower), np.inf), covariance)


def parameters_of(model: Model, *roles: str) -> tuple[str, ...]:
    """Return the parameters to estimate that have one of these roles; known ones are none of them."""
    return tuple(name for name in model.parameters if name in model.roles and model.roles[name].role in roles)


def bounded_names(model: Model) -> tuple[str, ...]:
    """Return the physical parameters that are never negative."""
    return parameters_of(model, *POSITIVE_ROLES)


def _fit_within(
    fit: Fit, lower: FloatArray, upper: FloatArray, covariance: FloatArray
) -> tuple[Fit, BoundCost]:
    from scipy.optimize import lsq_linear

    names = tuple(
        name
        for name, low, high in zip(fit.columns, lower, upper, strict=True)
        if np.isfinite(low) or np.isfinite(high)
    )
    x = fit.solution.x
    if np.all(x >= lower) and np.all(x <= upper):
        return fit, BoundCost(names, (), 0.0, 0.0)
    R, c = fit.triangle, len(x)
    scale = np.linalg.norm(R[:, :c], axis=0)
    # with a width that excludes zero alone a variable cannot leave it, so both ends are given as they are
    solved = lsq_linear(R[:c, :c] / scale, R[:c, c], (lower * scale, upper * scale), method="bvls")
    small = AT_BOUND * float(np.linalg.norm(R[:, c]))
    at_zero = [
        bool(abs(value) <= small and (low == 0.0 or high == 0.0))
        for value, low, high in zip(solved.x, lower, upper, strict=True)
    ]
    free = [name for name, zero in zip(fit.columns, at_zero, strict=True) if not zero]
    if not free:
        remedy = "check the signs of channels and forces, or identify without bounds"
        raise IdentifiabilityError.at("bounds", "leave nothing above zero", remedy)
    bounded = refit(fit, free)
    active = np.flatnonzero(at_zero)
    before, after = (float(np.linalg.norm(one.weighted_residual)) for one in (fit, bounded))
    wald = float(x[active] @ np.linalg.pinv(covariance[np.ix_(active, active)]) @ x[active])
    cost = BoundCost(
        names,
        tuple((fit.columns[k], float(x[k])) for k in active),
        after / before - 1.0 if before > 0.0 else 0.0,
        float(np.sqrt(max(wald, 0.0))),
    )
    return replace(bounded, notes=fit.notes, delays=fit.delays), cost


def bound_reasons(cost: BoundCost, fit: Fit) -> dict[str, str]:
    """Return why the parameters at their bound, and composites that vanish with them, have no number."""
    active = {
        name: f"lies at its bound, 0: without bounds it would be {value:.4g}; there is no interval for it"
        for name, value in cost.active
    }
    vanished = [name for name, value in zip(fit.columns, fit.solution.x, strict=True) if value == 0.0]
    why = f"is zero with {', '.join(active)} at the bound"
    return dict.fromkeys(vanished, why) | active if active else {}


def bound_advice(cost: BoundCost) -> tuple[Advice, ...]:
    """Return the warning that bounds contradict the records, where they do by more than chance."""
    if cost.surprise <= CONTRADICTED:
        return ()
    names = ", ".join([*(name for name, _ in cost.active), *cost.held])
    where = "at zero" if not cost.held else "at the bound"
    return (
        Advice(
            "bounds",
            names,
            f"{where} is {cost.deviations:.1f} standard deviations from what the records say",
            "the model, a sign or a delay is wrong: bounds hide that, they do not mend it",
        ),
    )


def bound_sentence(cost: BoundCost) -> str:
    """Return what the bounds cost in one sentence."""
    if not cost.bounded and not cost.bodies:
        return "Bounds: no parameter has one."
    said = [f"mass and pseudo-inertia of {listed(cost.bodies)}"] if cost.bodies else []
    said += [f"never negative: {', '.join(cost.bounded)}"] if cost.bounded else []
    which = "; ".join(said)
    if not cost.active and not cost.held:
        return f"Bounds ({which}): none is active, they cost nothing."
    active = ", ".join(f"{name} (without bounds {value:.4g})" for name, value in cost.active)
    moved = [f"at zero are {active}"] if active else []
    moved += [f"moved onto what a body can have: {listed(cost.held)}"] if cost.held else []
    price = (
        f"the weighted residual grows by {100.0 * cost.residual_increase:.3g} %, "
        f"{cost.deviations:.2g} standard deviations"
    )
    front = f"Bounds ({which})" if cost.bodies else "Bounds"
    return f"{front}: {'; '.join([*moved, price])}."
