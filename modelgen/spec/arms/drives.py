"""What the tables of an arm say of a joint's link and drive, put onto the joint."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from modelgen.documents import Document
from modelgen.spec.arms.arm import Friction, Joint
from modelgen.spec.arms.limits import read_limits
from modelgen.spec.arms.parameters import DRIVE_PREFIXES, USUAL_DRIVE, link_names

#: Keys of a joint's table that only a joint with a coordinate has.
OF_A_DRIVE = (
    *DRIVE_PREFIXES,
    "friction",
    "gear",
    "position_limits",
    "speed_limit",
    "acceleration_limit",
    "force_limit",
)


def with_drive(joint: Joint, table: Document, arm: Document) -> Joint:
    """Return the joint with the names of its parameters and its limits.

    Parameters
    ----------
    joint
        With its kind and placement; its `link` is empty where a URDF gives the link no mass.
    table
        The joint's own table; empty where the file has none.
    arm
        The table [arm], which says what all joints have.
    """
    link = () if table.get("massless") else link_names(joint.name)
    if joint.kind == "fixed":
        return replace(joint, link=link)
    usual = arm.get("drive")
    parts: Iterable[str] = USUAL_DRIVE if usual is None else usual
    names: Document = {
        role: _named(table.get(role), role in parts, f"{prefix}_{joint.name}")
        for role, prefix in DRIVE_PREFIXES.items()
    }
    friction: Friction = table.get("friction") or arm.get("friction") or "symmetric"
    limits = read_limits(table, joint.kind).values
    return replace(joint, link=link, friction=friction, **names, **limits)


def _named(value: object, usual: bool, name: str) -> str | None:
    if isinstance(value, str):
        return value
    return name if (usual if value is None else value) else None
