"""An arm's document -> ArmSpec, of what is readable; contradictions are looked for afterwards."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from heapq import heapify, heappop, heappush
from typing import Any, cast

from modelgen.documents import Document
from modelgen.number_expression import exact_number
from modelgen.spec.arms.angles import read_angle
from modelgen.spec.arms.arm import Angle, ArmSpec, Joint, JointKind, Length, Shift, Step
from modelgen.spec.arms.drives import with_drive
from modelgen.spec.arms.lengths import read_length
from modelgen.spec.arms.parameters import arm_parameters
from modelgen.spec.arms.payloads import draft_payloads, weighed
from modelgen.spec.arms.placements import ROW_ANGLES, ROW_LENGTHS, origin_placement, row_placement
from modelgen.spec.arms.sensors import draft_sensors
from modelgen.spec.arms.tables import BASE, SYMBOLIC

GRAVITY = (0, 0, -9.81)
#: Name of the parameter set that the inertials of a URDF make.
URDF_SET = "urdf"


@dataclass(frozen=True)
class Described:
    """Joints that another file describes, without drives, and values of parameters by (joint, role).

    Those that the arm's file holds at zero are fixed here already.
    """

    joints: tuple[Joint, ...]
    values: Mapping[tuple[str, str], float]


def draft_arm(document: Document, source: str, sha256: str, described: Described | None) -> ArmSpec:
    """Build the arm; a zero or an empty tuple stands for what cannot be read."""
    arm: Document = document.get("arm") or {}
    joints = draft_joints(document, described)
    ordered = parents_first(joints)
    values = {name: draft_values(table) for name, table in (document.get("parameters") or {}).items()}
    lengths = draft_values(document.get("lengths"))
    gravity = [exact(value or 0) for value in arm.get("gravity") or GRAVITY]
    spec = ArmSpec(
        name=arm.get("name") or "",
        title=arm.get("title") or arm.get("name") or "",
        joints=ordered,
        gravity=(gravity[0], gravity[1], gravity[2]),
        transmission=_transmission(document, [joint for joint in ordered if joint.kind != "fixed"]),
        lengths=_valued(lengths, [joint.placement for joint in joints]),
        known=draft_values({**weighed(document), **(document.get("known") or {})}),
        parameter_sets=values,
        source=source,
        sha256=sha256,
    )
    spec = replace(spec, sensor_sets=draft_sensors(document, spec), payloads=draft_payloads(document, spec))
    mounted = [s.mounting for sensors in spec.sensor_sets.values() for s in sensors]
    spec = replace(spec, lengths=_valued(lengths, [*(joint.placement for joint in joints), *mounted]))
    return spec if described is None else _with_described(spec, described)


def draft_joints(document: Document, described: Described | None) -> tuple[Joint, ...]:
    """Return all joints in the order of the files, those of a table for each table."""
    arm: Document = document.get("arm") or {}
    tables = [table or {} for table in document.get("joints") or ()]
    if described is None:
        frames = [_frame(table, tables[:k]) for k, table in enumerate(tables)]
        return tuple(with_drive(frame, table, arm) for frame, table in zip(frames, tables, strict=True))
    own = {str(table.get("name")): table for table in tables}
    joints = [
        with_drive(joint, {"massless": not joint.link, **own.get(joint.name, {})}, arm)
        for joint in described.joints
    ]
    names = {joint.name for joint in joints}
    added = [table for table in tables if table.get("name") not in names]
    return (*joints, *(with_drive(_frame(table, []), table, arm) for table in added))


def _frame(table: Document, before: Sequence[Document]) -> Joint:
    parent = table.get("parent") or (before[-1].get("name") if before else None)
    given: dict[str, Angle | Length] = {
        key: read_angle(table[key]) for key in ROW_ANGLES if _there(table, key)
    }
    given |= {key: read_length(table[key]) for key in ROW_LENGTHS if _there(table, key)}
    if table.keys() & {"xyz", "rpy"}:
        xyz = [read_length(0 if value is None else value) for value in table.get("xyz") or ()]
        rpy = [read_angle(0 if value is None else value) for value in table.get("rpy") or ()]
        placement = origin_placement(xyz, rpy, given)
    else:
        placement = row_placement(given)
    name, kind = str(table.get("name") or ""), cast("JointKind", table.get("type") or "revolute")
    return Joint(name, None if parent == BASE else parent, kind, placement, ())


def _there(table: Document, key: str) -> bool:
    return table.get(key) is not None


def parents_first(joints: Sequence[Joint]) -> tuple[Joint, ...]:
    """Return the joints so that each comes after its parent, else in their order.

    Those of a cycle, or whose parent is nowhere, come last.
    """
    places = {joint.name: k for k, joint in reversed([*enumerate(joints)])}
    children: dict[int, list[int]] = {}
    ready = []
    for k, joint in enumerate(joints):
        if joint.parent is None:
            ready.append(k)
        elif joint.parent in places:
            children.setdefault(places[joint.parent], []).append(k)
    heapify(ready)
    done: dict[int, None] = {}
    while ready:
        k = heappop(ready)
        done[k] = None
        for child in children.get(k, ()):
            heappush(ready, child)
    return tuple(joints[k] for k in (*done, *(k for k in range(len(joints)) if k not in done)))


def _transmission(document: Document, moving: Sequence[Joint]) -> tuple[tuple[Fraction, ...], ...]:
    places = {joint.name: k for k, joint in reversed([*enumerate(moving)])}
    rows = [[Fraction(int(i == j)) for j in range(len(moving))] for i in range(len(moving))]
    for table in document.get("joints") or ():
        place = places.get(str((table or {}).get("name")))
        if place is not None and table.get("gear"):
            rows[place][place] = exact(table["gear"])
    for table in document.get("couplings") or ():
        motor, joint = (places.get(str((table or {}).get(key))) for key in ("motor", "joint"))
        if motor is not None and joint is not None and motor != joint and table.get("ratio"):
            rows[motor][joint] = exact(table["ratio"])
    return tuple(tuple(row) for row in rows)


def _valued(values: Mapping[str, float], ways: Iterable[Sequence[Step]]) -> dict[str, float | None]:
    """Return the value of every named length in placements and mountings, in the order of their first use."""
    named = (step.length.name for way in ways for step in way if isinstance(step, Shift))
    return {name: values.get(name) for name in named if name is not None}


def _with_described(arm: ArmSpec, described: Described) -> ArmSpec:
    """Return the arm with the values that a URDF gives as a set, by the names that the parameters have."""
    values = described.values
    own = [one for one in arm_parameters(arm) if one.payload is None]
    named = {p.name: values[p.joint, p.role] for p in own if (p.joint, p.role) in values}
    return replace(arm, parameter_sets={URDF_SET: named, **arm.parameter_sets})


def draft_values(table: Document | None) -> dict[str, float]:
    """Return the readable numbers of a table."""
    given = {name: value for name, value in (table or {}).items() if value not in (None, SYMBOLIC)}
    return {name: float(exact(value)) for name, value in given.items()}


def exact(value: Any) -> Fraction:
    """Return the number that was written, as decimal or as text, not its nearest double."""
    return exact_number(value) if isinstance(value, str) else Fraction(str(value))
