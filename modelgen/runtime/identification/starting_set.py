"""Physical parameters to start instruments from: a set of the spec, by its name, or values."""

from __future__ import annotations

from collections.abc import Mapping

from modelgen.errors import DataError, Problem
from modelgen.magnitudes import REMEDY, is_usable
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import missing_name

WHERE = "start"


def starting_set(model: Model, start: Mapping[str, float] | str) -> Mapping[str, float]:
    """Return the physical parameters (SI) to start from.

    Raises
    ------
    DataError
        For a set that the model does not carry, and values that are none of it, missing or no numbers.
    """
    if isinstance(start, str):
        if start not in model.parameter_sets:
            raise DataError(missing_name(WHERE, "parameter set", start, model.parameter_sets))
        start = model.parameter_sets[start]
    elif not isinstance(start, Mapping):
        raise DataError.at(WHERE, f"is a {type(start).__name__}", "give the name of a set, or a mapping")
    problems = [
        missing_name(WHERE, "parameter", str(name), model.parameters)
        for name in start
        if name not in model.parameters
    ]
    for name in model.parameters:
        if name not in start:
            problems.append(Problem(WHERE, f"lacks {name}", "give all parameters of the model"))
        elif isinstance(start[name], bool) or not is_usable(start[name]):
            problems.append(Problem(f"{WHERE}: {name}", f"is {start[name]!r}", REMEDY))
    if problems:
        raise DataError(*problems)
    return {name: float(start[name]) for name in model.parameters}
