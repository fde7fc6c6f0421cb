"""Estimates made up from numbers, for what takes estimates and does not care where they come from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from modelgen.runtime.parameters.parameter import Parameter
from modelgen.runtime.parameters.physical_parameters import Covariances
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.results.estimate_parts import EstimatedParameters
from tests.runtime.results.test_summary import made_up


def estimate_of(
    values: Mapping[str, float], noise: float = 1.0, drift: float = 0.0, name: str = "run"
) -> Estimate:
    """An estimate of these parameters, all of one deviation, of independent errors."""
    std = float(np.hypot(noise, drift))
    entries = tuple(Parameter(key, "N", value, std, noise, drift, noise) for key, value in values.items())
    parts = [np.eye(len(values)) * one**2 for one in (std, noise, drift, noise)]
    parameters = EstimatedParameters(entries, entries, np.array(list(values.values())), {}, {})
    return replace(
        made_up(),
        records=(name,),
        covariances=Covariances(*parts),
        parameters=parameters,
    )
