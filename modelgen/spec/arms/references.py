"""Second pass over an arm's file: what its tables say of each other, on what the first pass could read."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from modelgen.documents import Document
from modelgen.errors import Problem, listed
from modelgen.spec.arms.arm import ArmSpec, Joint
from modelgen.spec.arms.draft import URDF_SET, Described
from modelgen.spec.arms.drives import OF_A_DRIVE
from modelgen.spec.arms.limits import read_limits
from modelgen.spec.arms.names import check_lengths, check_shared_names, check_values
from modelgen.spec.arms.parameters import SPRING
from modelgen.spec.arms.payloads import check_payloads
from modelgen.spec.arms.sensors import check_sensors
from modelgen.spec.arms.tables import BASE
from modelgen.spec.arms.transmission import check_transmission
from modelgen.spec.words import shown, suggest

#: A walking robot has 60; the derivation grows with their square.
MOST_MOVING, MOST_JOINTS = 100, 1000
_ROW_KEYS, _ORIGIN_KEYS = ("gamma", "b", "alpha", "d"), ("xyz", "rpy")
_PLACEMENT = ("type", "parent", *_ROW_KEYS, "theta", "r", *_ORIGIN_KEYS)


def check_arm(document: Document, spec: ArmSpec, described: Described | None) -> list[Problem]:
    """Report contradictions between tables; silent where an unreadable table may hold what is missed."""
    tables = document.get("joints") or []
    unread = None in tables or any(table.get("name", "") is None for table in tables if table)
    complete = not unread and ("joints" not in document or document["joints"] is not None)
    joints = {joint.name: joint for joint in reversed(spec.joints)}
    joints = dict(reversed(joints.items()))  # of two with one name the first, in the order of the file
    theirs = frozenset(joint.name for joint in described.joints) if described else frozenset()
    return [
        *(_check_present(spec, described) if complete else ()),
        *_check_names(tables, theirs if described else None),
        *(_check_parents(tables, joints) if complete else ()),
        *(found for k, table in enumerate(tables) for found in _check_joint(k, table or {}, joints, theirs)),
        *check_transmission(document, spec, joints if complete else None),
        *check_shared_names(spec, tables),
        *(check_lengths(document, spec) if complete else ()),
        *check_values(document, spec, complete),
        *_check_sets(document, described),
        *check_sensors(document, spec, joints if complete else None),
        *check_payloads(document, spec, joints if complete else None),
    ]


def check_size(document: Document, described: Described | None) -> Iterator[Problem]:
    """Yield what is wrong with the number of joints, before matrices of that size are made."""
    tables = [table or {} for table in document.get("joints") or ()]
    theirs = [joint.name for joint in described.joints if joint.kind != "fixed"] if described else []
    moving = {*theirs, *(str(table.get("name")) for table in tables if table.get("type") != "fixed")}
    for count, most, kind in (
        (len(tables), MOST_JOINTS, "joints"),
        (len(moving), MOST_MOVING, "joints that move"),
    ):
        if count > most:
            yield Problem(
                "joints", f"are {count} {kind}, more than {most}", "leave out what is not identified"
            )


def _check_present(spec: ArmSpec, described: Described | None) -> Iterator[Problem]:
    if not spec.joints and described is None:
        yield Problem("joints", "is missing", "write [[joints]] for every joint, or urdf under [arm]")
    elif not spec.moving:
        yield Problem("joints", "hold none that moves", 'write one of type = "revolute" or "prismatic"')


def _check_names(tables: Sequence[Document | None], theirs: frozenset[str] | None) -> Iterator[Problem]:
    first: dict[str, int] = {}
    for k, table in enumerate(tables):
        name = (table or {}).get("name")
        if name is not None and first.setdefault(name, k) != k:
            yield Problem(
                f"joints[{k}].name", f"{shown(name)} is the name of joints[{first[name]}]", "rename one"
            )
    if theirs is None:
        return
    for k, table in enumerate(tables):
        name = (table or {}).get("name")
        if table and isinstance(name, str) and name not in theirs and "parent" not in table:
            remedy = f"{suggest(name, theirs, 'joints')} one that is added needs a parent".replace(
                "? one", "? One"
            )
            yield Problem(f"joints[{k}].name", f"{shown(name)} is no joint of the URDF", remedy)


def _check_parents(tables: Sequence[Document], joints: Mapping[str, Joint]) -> Iterator[Problem]:
    wrong = False
    for k, table in enumerate(tables):
        parent = table.get("parent")
        if not isinstance(parent, str) or parent == BASE:
            continue
        if parent not in joints:
            wrong = True
            yield Problem(
                f"joints[{k}].parent",
                f"{shown(parent)} is not a joint",
                suggest(parent, [*joints, BASE], "joints"),
            )
        elif parent == table["name"]:
            wrong = True
            yield Problem(f"joints[{k}].parent", "is the joint itself", 'name another one, or "base"')
    cycle = () if wrong else _cycle(joints)
    if cycle:
        what = f"{listed(cycle, ' - ')} carry each other in a circle"
        yield Problem("joints", what, 'let one of them have parent = "base"; a loop is not a tree')


def _cycle(joints: Mapping[str, Joint]) -> tuple[str, ...]:
    """Return the names of joints that carry each other; empty where all stand on the base."""
    grounded: set[str] = set()
    for start in joints:
        way: dict[str, None] = {}
        name: str | None = start
        while name is not None and name in joints and name not in grounded:
            if name in way:
                names = [*way]
                return tuple(names[names.index(name) :])
            way[name] = None
            name = joints[name].parent
        grounded |= way.keys()
    return ()


def _check_joint(
    place: int, table: Document, joints: Mapping[str, Joint], theirs: frozenset[str]
) -> Iterator[Problem]:
    where = f"joints[{place}]"
    name = str(table.get("name"))
    kind = joints[name].kind if name in joints else table.get("type") or "revolute"
    if name in theirs:
        moved = [
            key
            for key in _PLACEMENT
            if key in table and not (key == "type" and table[key] in ("fixed", None))
        ]
        if moved:
            what = f"of {shown(name)} is said by the URDF"
            yield Problem(
                f"{where}.{moved[0]}", what, 'leave it out; only type = "fixed" can be changed here'
            )
    rows, origins = ([key for key in keys if key in table] for keys in (_ROW_KEYS, _ORIGIN_KEYS))
    if rows and origins:
        remedy = "keep one way: gamma, b, alpha, d, theta, r; or xyz, rpy (with theta, r as the joint's zero)"
        yield Problem(where, f"has both {rows[0]} and {origins[0]}", remedy)
    idle = [key for key in OF_A_DRIVE if table.get(key) not in (None, False)]
    if kind == "fixed" and idle and (table.get("type") or name in joints):
        yield Problem(
            f"{where}.{idle[0]}", "is of a joint that is fixed", "leave it out, or let the joint move"
        )
    elif kind != "fixed":
        for key, mistake in read_limits(table, kind).mistakes:
            yield Problem(f"{where}.{key}", mistake.what, mistake.remedy)
        spring = [key for key in SPRING[1:] if name in joints and getattr(joints[name], key)]
        if spring and not joints[name].elastic:
            remedy = "add stiffness = true (or a name), or leave it out"
            yield Problem(f"{where}.{spring[0]}", "is of a spring, and the joint has no stiffness", remedy)


def _check_sets(document: Document, described: Described | None) -> Iterator[Problem]:
    if described is not None and URDF_SET in (document.get("parameters") or {}):
        what = "is the set that the inertials of the URDF make"
        yield Problem(f"parameters.{URDF_SET}", what, "choose another name")
