"""Changes of a payload's parameters that no row can see: of its link's, those that no other parameter undoes.

The columns of a payload are those of its link times a factor of its own, 1 in some records and 0 in others.
What one link may hand to another (`unseen_changes`) a payload may not: only what is unseen of it alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction

from modelgen.spec.arms.arm import LINK_PARAMETERS, ArmSpec
from modelgen.symbolic.arms.exact_regrouping import regrouping
from modelgen.symbolic.arms.row_parts import KEPT_FIRST
from modelgen.symbolic.arms.unseen_changes import Change, Key


def payload_key(payload: str, parameter: str) -> Key:
    """Return the key of a payload's parameter: apart from those of joints, whose names have no space."""
    return (f"payload {payload}", parameter)


def payload_changes(spec: ArmSpec, changes: Sequence[Change]) -> Iterator[Change]:
    """Yield those of payloads; `changes` are all of the arm without them."""
    for payload in spec.payloads:
        places: dict[Key, int] = {(payload.joint, kind): place for place, kind in enumerate(KEPT_FIRST)}
        for dependent, recipe in regrouping(changes, places).items():
            change: Change = {payload_key(payload.name, KEPT_FIRST[dependent]): Fraction(1)}
            for column, factor in recipe.items():
                change[payload_key(payload.name, KEPT_FIRST[column])] = -factor
            yield change


def payload_keys(spec: ArmSpec) -> dict[str, Key]:
    """Return the key of every parameter of a payload, by its name."""
    return {
        name: payload_key(payload.name, kind)
        for payload in spec.payloads
        for name, kind in zip(payload.link, LINK_PARAMETERS, strict=True)
    }
