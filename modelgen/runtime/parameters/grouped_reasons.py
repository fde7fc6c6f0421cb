"""Reasons for having no number, said once for all parameters that share one."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from modelgen.errors import listed


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


def _kind(why: str) -> str:
    """Return how a reason begins; reasons of one kind differ in bodies, records and figures."""
    return re.sub(r"\d\S*", "#", re.split(r"[:;,(]| of | in ", why, maxsplit=1)[0])
