"""What suits all machines, and whether they differ: the meta-analysis of their estimates.

Estimates of machines are pooled as those of independent studies are (Cochran, Biometrics 10, 1954, 101-129;
DerSimonian and Laird, Controlled Clinical Trials 7, 1986, 177-188): weighted by their precision, with the
spread between machines in the interval as soon as it shows. Rows of different machines in one least-squares
fit would say nothing of that spread, and its intervals would be those of a machine that there is not.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from modelgen.array_types import FloatArray

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
            found.append(_pooled(name, units[name], known, len(names)))
    return tuple(found)


def _pooled(name: str, unit: str, pairs: FloatArray, tests: int) -> PooledParameter:
    """Return one parameter; `pairs` holds value and standard deviation of each machine, shape (k, 2)."""
    from scipy.stats import chi2

    values, variances = pairs[:, 0], pairs[:, 1] ** 2
    k, weights = len(values), 1.0 / variances
    mean = float(weights @ values / weights.sum())
    Q = float(weights @ (values - mean) ** 2)
    between = 0.0
    if k > 1:
        between = max(0.0, (Q - (k - 1)) / float(weights.sum() - (weights @ weights) / weights.sum()))
    spread = 1.0 / (variances + between)
    p_value = float(chi2.sf(Q, k - 1)) if k > 1 else 1.0
    return PooledParameter(
        name,
        unit,
        k,
        float(spread @ values / spread.sum()),
        float(1.0 / np.sqrt(spread.sum())),
        float(np.sqrt(between)),
        Q if k > 1 else 0.0,
        p_value,
        p_value < (1.0 - CONFIDENCE) / tests,
    )
