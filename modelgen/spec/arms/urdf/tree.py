"""The links and joints of a URDF as a tree; what is missing, twice there, loose or a loop is reported."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from modelgen.errors import listed
from modelgen.spec.arms.references import MOST_JOINTS
from modelgen.spec.arms.tables import MARKS, joint_problem
from modelgen.spec.arms.urdf.attributes import Attributes
from modelgen.spec.arms.urdf.xml_tree import Element
from modelgen.spec.words import shown, suggest

_OTHER_FORMATS = {"sdf": "SDF", "mujoco": "MJCF", "Robot": "an OpenRAVE robot", "COLLADA": "COLLADA"}


@dataclass(frozen=True)
class UrdfJoint:
    """A joint: its name as a name of modelgen, its element, and the links that it joins."""

    name: str
    element: Element
    parent: str
    child: str

    @property
    def type(self) -> str:
        """The type as the file has it."""
        return self.element.attributes.get("type", "")


def check_root(robot: Element, read: Attributes) -> bool:
    """Return whether the outermost element is that of an expanded URDF; report it if not."""
    if robot.name != "robot":
        other = _OTHER_FORMATS.get(robot.name, f"<{robot.name[:40]}>")
        read.report(
            robot, "", f"is {other}, not URDF", "convert it to URDF; its outermost element is <robot>"
        )
    elif any(element.name.startswith("xacro:") for element in robot.inside):
        what = "is full of macros (xacro)"
        read.report(robot, "", what, "expand them first: xacro robot.xacro > robot.urdf")
    elif (count := sum(1 for _ in robot.all("joint"))) > MOST_JOINTS:
        read.report(robot, "", f"has {count} joints, more than {MOST_JOINTS}", "check what the file is")
    else:
        return True
    return False


def joints_of(robot: Element, read: Attributes) -> tuple[UrdfJoint, ...]:
    """Return the joints that can be read, in the order of the file; report why they are no tree."""
    links = _links(robot, read)
    joints = list(_joints(robot, links, read))
    if read.problems:
        return tuple(joints)
    carried: dict[str, UrdfJoint] = {}
    for joint in joints:
        other = carried.setdefault(joint.child, joint)
        if other is not joint:
            what = f"ends at link {shown(joint.child)}, as joint {other.name} does: a closed loop"
            read.report(joint.element, f"joint {joint.name}", what, "cut the loop: leave one of them out")
    roots = [link for link in links if link not in carried]
    if len(roots) > 1 and not read.problems:
        what = f"has {len(roots)} links that no joint carries: {listed(roots)}"
        read.report(robot, "", what, "join them to one base")
    around = [] if read.problems else _in_circles(joints, roots)
    if around:
        what = f"has joints that carry each other in a circle: {listed(around)}"
        read.report(robot, "", what, "an arm is a tree from its base: cut the circle")
    return tuple(joints)


def _links(robot: Element, read: Attributes) -> dict[str, Element]:
    links: dict[str, Element] = {}
    for link in robot.all("link"):
        name = link.attributes.get("name")
        if name is None:
            read.report(link, "", "is a link without a name", 'write <link name="...">')
        elif links.setdefault(name, link) is not link:
            read.report(link, "", f"is a second link {shown(name)}", "rename one of them")
    if not links:
        read.report(robot, "", "has no links", "check what the file is")
    return links


def _joints(robot: Element, links: dict[str, Element], read: Attributes) -> Iterator[UrdfJoint]:
    names: dict[str, str] = {}
    for joint in robot.all("joint"):
        written = joint.attributes.get("name")
        if written is None:
            read.report(joint, "", "is a joint without a name", 'write <joint name="...">')
            continue
        name = written.translate(MARKS)
        problem = joint_problem(name)
        if problem:
            read.report(joint, "", f"{shown(written)} is no name of a joint", problem[1])
            continue
        if name in names:
            what = f"joint {shown(written)} has the name of joint {shown(names[name])}"
            read.report(joint, "", what, "rename one of them; - . / : and spaces count as _")
        names[name] = written
        ends = [_end(joint, name, end, links, read) for end in ("parent", "child")]
        if ends[0] is not None and ends[1] is not None:
            yield UrdfJoint(name, joint, ends[0], ends[1])


def _end(joint: Element, name: str, end: str, links: dict[str, Element], read: Attributes) -> str | None:
    element = joint.first(end)
    link = element.attributes.get("link") if element else None
    if link is None:
        read.report(joint, f"joint {name}", f"has no {end}", f'write <{end} link="..."/>')
    elif link not in links:
        what = f"has the {end} {shown(link)}, which is no link"
        read.report(joint, f"joint {name}", what, suggest(link, links, "links"))
    else:
        return link
    return None


def _in_circles(joints: list[UrdfJoint], roots: list[str]) -> list[str]:
    """Return the names of the joints that are not reached from the root."""
    below: dict[str, list[UrdfJoint]] = {}
    for joint in joints:
        below.setdefault(joint.parent, []).append(joint)
    reached: dict[str, None] = {}
    pending = [*roots]
    while pending:
        for joint in below.get(pending.pop(), ()):
            reached[joint.name] = None
            pending.append(joint.child)
    return [joint.name for joint in joints if joint.name not in reached]
