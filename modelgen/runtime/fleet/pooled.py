"""What suits all machines, and whether they differ: the meta-analysis of their estimates.

Estimates of machines are pooled as those of independent studies are, weighted by their precision, with the
spread between machines in the interval as soon as it shows (`modelgen.runtime.numerics.heterogeneity`). Rows
of different machines in one least-squares fit would say nothing of that spread, and its intervals would be
those of a machine that there is not.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from modelgen.runtime.numerics.heterogeneity import heterogeneity, holm

# Machines count as different where chance makes one parameter of a fleet look so in 1 % of all fleets.
CONFIDENCE = 0.99


@dataclass(frozen=True)
class PooledParameter:
    """One parameter of all machines that give it.

    Attributes
    ----------
    name, unit : str
    machines : int
        How many give it.
    value, std : float
        The mean over machines, weighted, and its standard deviation; the spread between machines included.
    between_std : float
        Standard deviation of the machines' own true values, as far as it shows; 0 where it does not.
    heterogeneity, p_value : float
        Cochran's Q, and how probable a larger one is if all machines are equal; 0 and 1 for one machine.
    differs : bool
        Whether machines differ.
    """

    name: str
    unit: str
    machines: int
    value: float
    std: float
    between_std: float
    heterogeneity: float
    p_value: float
    differs: bool


def pooled_parameters(documents: Sequence[Mapping[str, Any]]) -> tuple[PooledParameter, ...]:
    """Return what all machines say of every parameter that any of them gives.

    Parameters
    ----------
    documents : sequence of mapping
        Estimates of the machines, as `Estimate.to_dict` gives them.
    """
    names = tuple(dict.fromkeys(name for one in documents for name in one["params"]))
    units = {name: str(one["units"].get(name, "")) for one in documents for name in one["params"]}
    found = []
    for name in names:
        pairs = [(one["params"][name], one["bse"][name]) for one in documents if name in one["params"]]
        known = np.array([pair for pair in pairs if None not in pair and pair[1] > 0.0], dtype=float)
        if len(known):
            found.append((name, len(known), heterogeneity(known[:, 0], known[:, 1] ** 2)))
    adjusted = holm([of_all.p_value for _, _, of_all in found])
    return tuple(
        PooledParameter(
            name,
            units[name],
            machines,
            of_all.value,
            of_all.std,
            of_all.between_std,
            of_all.statistic,
            of_all.p_value,
            corrected < 1.0 - CONFIDENCE,
        )
        for (name, machines, of_all), corrected in zip(found, adjusted, strict=True)
    )
