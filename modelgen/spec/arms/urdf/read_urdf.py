"""A URDF's text -> joints with frames on their axes, limits, and the values of their links and friction."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from typing import Any

from modelgen.errors import Problem, SpecError
from modelgen.spec.arms.arm import LINK_PARAMETERS, Joint, JointKind, Step
from modelgen.spec.arms.draft import Described
from modelgen.spec.arms.parameters import link_names
from modelgen.spec.arms.urdf.attributes import Attributes
from modelgen.spec.arms.urdf.inertials import link_values
from modelgen.spec.arms.urdf.origins import axis_steps, placement
from modelgen.spec.arms.urdf.tree import UrdfJoint, check_root, joints_of
from modelgen.spec.arms.urdf.xml_tree import xml_tree
from modelgen.spec.words import shown, suggest

_KINDS: dict[str, JointKind] = {
    "revolute": "revolute",
    "continuous": "revolute",
    "prismatic": "prismatic",
    "fixed": "fixed",
}
_WITHOUT = {
    "floating": "moves in six directions",
    "planar": "moves in a plane",
    "mimic": "moves as another joint does",
}
_ZEROS = dict.fromkeys(LINK_PARAMETERS, 0.0)


def described_arm(text: str, source: str, fixed: Collection[str]) -> tuple[Described, list[Problem]]:
    """Return the joints and values of a URDF, and what is wrong with it.

    Parameters
    ----------
    text, source
        The file's text, and its name in messages.
    fixed
        Names of joints that are to be held where their coordinate is zero.
    """
    try:
        robot = xml_tree(text, source)
    except SpecError as error:
        return Described((), {}), [*error.problems]
    read = Attributes(source)
    joints = joints_of(robot, read) if check_root(robot, read) else ()
    kinds = {joint.name: _kind(joint, fixed, read) for joint in joints}
    axes = {
        joint.name: ()
        if kinds[joint.name] == "fixed"
        else axis_steps(joint.element, read, f"joint {joint.name}")
        for joint in joints
    }
    carrying = {joint.child: joint for joint in joints}
    links = {link.attributes.get("name", ""): link for link in robot.all("link")}
    at_rest = _at_rest(joints, kinds, links)
    found: list[Joint] = []
    values: dict[tuple[str, str], float] = {}
    for joint in joints:
        name, kind, axis = joint.name, kinds[joint.name], axes[joint.name]
        carrier = carrying.get(joint.parent)
        before: tuple[Step, ...] = axes[carrier.name] if carrier else ()
        steps = placement(before, joint.element.first("origin"), axis, read, f"joint {name}")
        own = link_values(links[joint.child], axis, read, f"link {shown(joint.child)}")
        if kind != "fixed":
            own = own or _ZEROS
            values |= _friction(joint, read)
        elif joint.child in at_rest:  # nothing that an arm does depends on it
            own = None
        values |= {(name, role): value for role, value in (own or {}).items()}
        limits = {} if kind == "fixed" else _limits(joint, read)
        parent, link = carrier.name if carrier else None, link_names(name) if own else ()
        found.append(Joint(name, parent, kind, steps, link, **limits))
    return Described(tuple(found), values), read.problems


def _at_rest(
    joints: Iterable[UrdfJoint], kinds: Mapping[str, JointKind], links: Iterable[str]
) -> frozenset[str]:
    """Return the links that no joint moves: the base, and what is fixed to it."""
    children: dict[str, list[str]] = {}
    for joint in joints:
        if kinds[joint.name] == "fixed":
            children.setdefault(joint.parent, []).append(joint.child)
    carried = {joint.child for joint in joints}
    pending = [link for link in links if link not in carried]
    found: dict[str, None] = {}
    while pending:
        link = pending.pop()
        if link not in found:
            found[link] = None
            pending += children.get(link, [])
    return frozenset(found)


def without_coordinate(text: str, source: str) -> tuple[str, ...]:
    """Return the names of the joints that an arm can only hold at zero: mimic, floating and planar ones.

    Raises
    ------
    SpecError
        When the text is no URDF, or its links and joints are no tree.
    """
    robot, read = xml_tree(text, source), Attributes(source)
    joints = joints_of(robot, read) if check_root(robot, read) else ()
    if read.problems:
        raise SpecError(*read.problems)
    return tuple(joint.name for joint in joints if _type(joint) in _WITHOUT)


def _type(joint: UrdfJoint) -> str:
    return "mimic" if joint.element.first("mimic") else joint.type


def _kind(joint: UrdfJoint, fixed: Collection[str], read: Attributes) -> JointKind:
    if joint.name in fixed:
        return "fixed"
    kind = _type(joint)
    if kind in _WITHOUT:
        what = f"is of type {kind}: it {_WITHOUT[kind]}, and an arm here has one coordinate for each joint"
        remedy = f'hold it at zero: [[joints]] with name = "{joint.name}", type = "fixed" in the TOML file'
        read.report(joint.element, f"joint {joint.name}", what, remedy)
    elif kind not in _KINDS:
        what = f"has the type {shown(kind)}" if kind else "has no type"
        read.report(joint.element, f"joint {joint.name}", what, suggest(kind, _KINDS, "types"))
    return _KINDS.get(kind, "fixed")


def _limits(joint: UrdfJoint, read: Attributes) -> dict[str, Any]:
    """Return limits; zeros, which files have where nobody knew better, say nothing."""
    element, of = joint.element.first("limit"), f"joint {joint.name}"
    lower, upper = (float(read.number(element, key, of) or 0) for key in ("lower", "upper"))
    limits: dict[str, Any] = {}
    if joint.type != "continuous" and lower < upper:
        limits["position_limits"] = (lower, upper)
    elif element is not None and lower > upper:
        read.report(element, of, f"has its lower limit {lower:g} above {upper:g}", "swap them")
    for key, name in (("velocity", "speed_limit"), ("effort", "force_limit")):
        size = float(read.never_negative(element, key, of))
        if size > 0:
            limits[name] = size
    return limits


def _friction(joint: UrdfJoint, read: Attributes) -> Mapping[tuple[str, str], float]:
    element, of = joint.element.first("dynamics"), f"joint {joint.name}"
    named = (("damping", "viscous"), ("friction", "coulomb"))
    return {(joint.name, role): float(read.never_negative(element, key, of)) for key, role in named}
