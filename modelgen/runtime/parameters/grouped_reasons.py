"""Reasons for having no number: of the parameters of the spec, and once for all that share one."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass

from modelgen.errors import listed

DEPENDS = "depends on "  # begins the reason of a parameter that follows from base parameters without a number


@dataclass(frozen=True)
class SharedReason:
    """A reason, the parameters that it holds for, and those with one that differs in names and figures."""

    names: tuple[str, ...]
    likewise: tuple[str, ...]
    why: str

    @property
    def who(self) -> str:
        """The parameters, in words."""
        further = f" ({listed(self.likewise)} likewise)" if self.likewise else ""
        return f"{listed(self.names)}{further}"


def grouped_reasons(reasons: Mapping[str, str]) -> tuple[SharedReason, ...]:
    """Return the reasons of parameters, in their order, each said once.

    Those of one kind begin alike and differ in bodies, records and figures; the first stands for all.
    """
    kinds: dict[str, dict[str, str]] = {}
    for name, why in reasons.items():
        kinds.setdefault(_kind(why), {})[name] = why
    found = []
    for alike in kinds.values():
        why = next(iter(alike.values()))
        same = tuple(name for name, other in alike.items() if other == why)
        found.append(SharedReason(same, tuple(name for name in alike if name not in same), why))
    return tuple(found)


def parameters_in(formula: str, parameters: Collection[str]) -> tuple[str, ...]:
    """Return the parameters that a formula holds, in their order; of a parameter's name this one."""
    words = {*re.findall(r"\w+", formula)}
    return tuple(name for name in parameters if name in words)


def reasons_of_parameters(
    reasons: Mapping[str, str],
    formulas: Mapping[str, str],
    parameters: Collection[str],
    numbers: Collection[str] = (),
) -> dict[str, str]:
    """Return the reasons of a chain's base parameters by the parameters of its spec.

    A composite that rows found for themselves says nothing to who wrote the spec: its reason is that of the
    parameters in it.

    Parameters
    ----------
    reasons : mapping of str to str
        Of base parameters and of physical ones.
    formulas : mapping of str to str
        Base parameters that go by a short name to what they are made of.
    parameters : collection of str
        The physical parameters that these sensors can determine, in the order of the spec.
    numbers : collection of str
        Parameters with a number, which need no reason.
    """
    columns = {
        name: parameters_in(formulas.get(name, name), parameters)
        for name, why in reasons.items()
        if not why.startswith(DEPENDS)
    }
    found = {}
    for name in parameters:
        roots = (reasons[column] for column, made_of in columns.items() if name in made_of)
        own = reasons.get(name, DEPENDS)
        why = next(roots, own) if own.startswith(DEPENDS) else own
        if why != DEPENDS and name not in numbers:
            found[name] = why
    others = {name: why for name, why in reasons.items() if name not in parameters and not columns.get(name)}
    return others | found


def _kind(why: str) -> str:
    """Return how a reason begins; reasons of one kind differ in bodies, records and figures."""
    return re.sub(r"\d\S*", "#", re.split(r"[:;,(]| of | in ", why, maxsplit=1)[0])
