"""Inertias that are too uncertain each, but known together: slow motion shows what moves in step."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import ModelgenError
from modelgen.runtime.model.model import Model
from modelgen.runtime.parameters.parameter import Parameter
from modelgen.runtime.parameters.physical_parameters import Covariances, FoundParameters
from modelgen.runtime.parameters.rounded import with_interval
from modelgen.runtime.parameters.thresholds import KNOWN_SUM_PERCENT


def with_known_sums(
    model: Model, covariances: Covariances, found: FoundParameters, doubtful: Mapping[str, str]
) -> dict[str, str]:
    """Return the reasons of refused parameters; those of inertias name their sum where that is known.

    Parameters
    ----------
    model : Model
    covariances : Covariances
        Of the base parameters identified.
    found : FoundParameters
        With the fit to composites.
    doubtful : mapping of str to str
        Physical parameters that get no number, with the reason.
    """
    solution, told = found.solution, dict(doubtful)
    names = [name for name in doubtful if name in model.roles and model.roles[name].role == "inertia"]
    if solution is None or len(names) < 2 or not all(name in solution.determined for name in names):
        return told
    values = {name: solution.values[name] for name in names}

    def spread(shares: FloatArray) -> float:
        gradient = shares @ np.array([solution.gradients[name] for name in names])
        return found.factor * covariances.standard_deviations(gradient)[0]

    text = known_sum(model, solution.values, values, spread)
    return told | ({name: f"{doubtful[name]}; {text}" for name in names} if text else {})


def known_sum(
    model: Model,
    chain: Mapping[str, float],
    inertias: Mapping[str, float],
    spread: Callable[[FloatArray], float],
) -> str | None:
    """Return what is known of inertias (SI) as they move together, in words; None if too little.

    `chain` holds parameters (SI) that it can be simulated with. `spread` takes the share, (n,), of each that
    the body of the first one carries to the standard deviation of their sum.
    """
    names = list(inertias)
    shares = _felt_shares(model, chain, names)
    if shares is None:
        return None
    total, std = float(shares @ np.array([*inertias.values()])), spread(shares)
    entry = Parameter("", model.units.get(names[0], ""), total, std, std, 0.0, std)
    if not 0.0 < entry.relative_std < KNOWN_SUM_PERCENT:
        return None
    parts = zip(shares.tolist(), names, strict=True)
    terms = " + ".join(name if share == 1.0 else f"{share:.4g} {name}" for share, name in parts)
    return f"{terms} = {with_interval(total, *entry.interval())} {entry.unit} is known"


def _felt_shares(model: Model, values: Mapping[str, float], names: list[str]) -> FloatArray | None:
    """Return what share of each inertia the body of the first one carries, all moving as one."""
    # least squares needs no simulation but for this
    from modelgen.runtime.simulation.closed_loop import vibration
    from modelgen.runtime.simulation.plant import make_plant

    try:
        plant = make_plant(model, dict(values))
    except ModelgenError:
        return None
    moves = dict(zip(plant.bodies, vibration(plant).lowest.tolist(), strict=True))
    felt = [moves[model.roles[name].bodies[0]] for name in names]
    if not all(np.isfinite(felt)) or not felt[0]:
        return None
    return np.asarray(np.round((np.array(felt) / felt[0]) ** 2, 12))
