"""The same parameters of several estimates with their intervals, side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from modelgen.errors import DataError
from modelgen.runtime.parameters.parameter import Parameter
from modelgen.runtime.plots.axes import VERBATIM, colours
from modelgen.runtime.records.record import missing_name
from modelgen.runtime.results.estimate import Estimate


def named_estimates(
    own: Estimate, others: Estimate | Sequence[Estimate] | Mapping[str, Estimate]
) -> dict[str, Estimate]:
    """Return the estimates by the names that a plot gives them, the own one first."""
    if isinstance(others, Estimate):
        others = (others,)
    if isinstance(others, Mapping):
        found = {"this": own} | dict(others)
        if "this" in others:
            raise DataError.at("others", "name one of them this", "choose another name")
    else:
        every = (own, *others)
        names = [f"{one.fit.method}: {', '.join(one.records)}" for one in every]
        found = {
            name if names.count(name) == 1 else f"{place + 1}. {name}": one
            for place, (name, one) in enumerate(zip(names, every, strict=True))
        }
    strange = [name for name, one in found.items() if not isinstance(one, Estimate)]
    if strange:
        raise DataError.at("others", f"hold what is no Estimate: {', '.join(strange)}", "give Estimates")
    return found


def parameters_of(estimate: Estimate) -> dict[str, Parameter]:
    """Return the parameters of an estimate by name, base and physical."""
    every = (*estimate.parameters.identified, *estimate.parameters.physical)
    return {entry.name: entry for entry in every}


def chosen_names(estimates: Mapping[str, Estimate], names: Sequence[str] | None) -> tuple[str, ...]:
    """Return the parameters to show: the given ones, or the physical (else base) ones of any estimate.

    Raises
    ------
    DataError
        For a name that none of the estimates has.
    """
    known = dict.fromkeys(name for one in estimates.values() for name in parameters_of(one))
    if names is not None:
        wanted = (names,) if isinstance(names, str) else tuple(names)
        absent = [missing_name("names", "parameter", name, known) for name in wanted if name not in known]
        DataError.raise_any(absent)
        return wanted
    physical = dict.fromkeys(name for one in estimates.values() for name in one.physical)
    return tuple(physical or known)


def draw_parameter(axis: Any, name: str, estimates: Mapping[str, Estimate], alpha: float) -> None:
    """Draw one parameter of each estimate with its interval, in the parameter's unit."""
    colour, unit = colours(axis), ""
    for place, one in enumerate(estimates.values()):
        entry = parameters_of(one).get(name)
        if entry is None:
            axis.text(
                0.02, -place, "no number", va="center", fontsize=8, transform=axis.get_yaxis_transform()
            )
            continue
        low, high = entry.interval(alpha)
        shade = colour.others[place % len(colour.others)]
        axis.plot([low, high], [-place, -place], color=shade, linewidth=2.0, solid_capstyle="butt")
        axis.plot([entry.value], [-place], color=shade, marker="o", markersize=5.0)
        unit = entry.unit
    axis.set_xlabel(f"{name} in {unit}" if unit else name)
    axis.set_yticks([-place for place in range(len(estimates))], list(estimates), **VERBATIM)
    # whole numbers, not what is to be added to a corner, and room for their digits
    axis.ticklabel_format(axis="x", useOffset=False)
    axis.locator_params(axis="x", nbins=5)
    axis.set_ylim(0.6 - len(estimates), 0.6)
    axis.grid(axis="x", alpha=0.25)
