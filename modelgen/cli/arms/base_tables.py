"""What the rows of an arm can distinguish: base parameters, as plain values and as tables."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rich.text import Text

from modelgen.cli.tables import Description, table
from modelgen.errors import ModelError
from modelgen.spec.arms.arm import LINK_PARAMETERS, ArmSpec
from modelgen.spec.arms.parameters import arm_parameters

#: What base parameters are of; mountings are named only where there are any.
_OWNERS = ("link", "drive", "mounting")
_NO_SCALE = (
    "only ratios can be found: the gain of every drive is to be estimated and no force or parameter is "
    "known; give a payload that was weighed, or one gain, in [known]"
)


def describe_base(arm: ArmSpec, prove: bool, sensor_set: str | None = "") -> Description:
    """Return the base parameters of a sensor set ("": everything is measured), or why there are none."""
    from modelgen.symbolic.arms.arm_rows import arm_rows
    from modelgen.symbolic.arms.base_parameters import arm_base_model

    try:
        rows = arm_rows(arm, sensor_set=sensor_set or "")
        model = arm_base_model(rows)
    except ModelError as error:
        return {"base_parameters": None, "reason": "; ".join(f"{p.what}; {p.remedy}" for p in error.problems)}
    parameters = {parameter.name: parameter for parameter in arm_parameters(arm, rows.sensors)}
    first = [base.combination[0][0] for base in model.base]
    return {
        "base_parameters": [
            {
                "name": base.name,
                "unit": parameters[name].unit,
                "of": _owner(parameters[name].role),
                "terms": len(base.combination),
            }
            for base, name in zip(model.base, first, strict=True)
        ],
        "identifiable": list(model.identifiable),
        "absent": dict(model.absent),
        "has_scale": rows.has_scale,
        "newton_equals_lagrange": _proof(arm) if prove else None,
    }


def _owner(role: str) -> str:
    return "link" if role in LINK_PARAMETERS else role if role in _OWNERS else "drive"


def base_tables(described: Description) -> Iterator[Any]:
    """Lay out what `describe_base` says: sums in full, the rest by name."""
    base = described["base_parameters"]
    yield Text("")
    if base is None:
        yield Text(f"base parameters: none are derived; {described['reason']}")
        return
    counts = [f"{sum(one['of'] == owner for one in base)} of {owner}s" for owner in _OWNERS]
    counts = counts if any(one["of"] == _OWNERS[-1] for one in base) else counts[:-1]
    head = f"Base parameters: {len(base)} ({', '.join(counts)}), sums first"
    sums = [(entry["name"], entry["unit"]) for entry in base if entry["terms"] > 1]
    yield Text(head, style="bold")
    if sums:
        yield table("", ("base parameter", "unit"), sums)
    alone = ", ".join(described["identifiable"]) or "none"
    reasons: dict[str, list[str]] = {}
    for name, why in described["absent"].items():
        if not why.startswith("only in combination"):
            reasons.setdefault(why.replace("shows it", "shows them"), []).append(name)
    yield Text(f"\nidentifiable by themselves: {alone}")
    for why, unseen in reasons.items():
        yield Text(f"not identifiable, {why}: {', '.join(unseen)}")
    if not described["has_scale"]:
        yield Text(_NO_SCALE)
    if described["newton_equals_lagrange"] is not None:
        word = "equal" if described["newton_equals_lagrange"] else "DO NOT equal"
        yield Text(f"proved modulo a prime: the equations of Newton and Euler {word} those of Lagrange")


def _proof(arm: ArmSpec) -> bool:
    from modelgen.symbolic.arms.dynamics.lagrange import newton_minus_lagrange, vanishes

    graph, differences = newton_minus_lagrange(arm)
    return vanishes(graph, differences, [*arm.lengths])
