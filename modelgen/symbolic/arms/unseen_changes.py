"""Changes of the parameters that no row can see: what base parameters are made of, in closed form.

As Gautier and Khalil (1990) found: a body that is a figure of revolution about the axis of a revolute joint
may as well sit on the link in front of the joint, an inertia on either side of a prismatic joint, everything
on either side of a fixed one. With the links that turn about one direction only these changes span all there
are; `base_parameters` proves it for each arm.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from modelgen.spec.arms.arm import LINK_PARAMETERS, ArmSpec, Joint
from modelgen.symbolic.arms.carried_body import Body, carried
from modelgen.symbolic.arms.drives import coordinates, drives
from modelgen.symbolic.arms.link_freedom import Direction, Freedom, Z, base_freedom, freedom, parallel
from modelgen.symbolic.arms.placements import IDENTITY, Matrix, placement
from modelgen.symbolic.exact_dependencies import exact_dependencies

#: A parameter: that of a link by (name of the joint, kind), or another by ("", its name). The base is "".
Key = tuple[str, str]
Change = dict[Key, Any]

TENSOR = LINK_PARAMETERS[:6]
BASE = "base"


def unseen_changes(
    spec: ArmSpec, lengths: Mapping[str, Any], base_rows: bool, apart: Container[str] = ()
) -> Iterator[Change]:
    """Yield changes of all parameters, those without names included, that leave every row as it is.

    Parameters
    ----------
    spec : ArmSpec
        The arm.
    lengths : mapping of str to field element
        What stands for every named length.
    base_rows : bool
        Whether the base's wrench is measured.
    apart : container of str
        Joints whose motors have rows without links: their rotors are told apart from what is behind them.
    """
    parents, steps = {BASE: base_freedom(spec.gravity)}, {}
    yield from _unseen_alone(BASE, parents[BASE], base_rows)
    for joint in spec.joints:
        place = steps[joint.name] = _place(joint, lengths)
        own = freedom(joint, place.rotation, place.offset, parents[place.parent])
        for body in _either_side(joint, own, base_rows):
            change: Change = {(joint.name, kind): value for kind, value in body.items()}
            for kind, value in carried(body, place.rotation, place.offset).items():
                change[place.parent, kind] = -value
            yield change
        yield from _unseen_alone(joint.name, own, base_rows)
        yield from _unseen_drive(joint)
        if not base_rows and joint.kind != "fixed" and joint.name not in apart:
            yield from _rotor_as_link(joint, place, parents[place.parent], own)
        parents[joint.name] = own
    told_apart = base_rows or any(joint.name in apart for joint in spec.joints)
    yield from _unseen_among_drives(spec, {} if told_apart else _spins(spec, steps, parents))


@dataclass(frozen=True)
class FrameStep:
    """From a parent's frame to a joint's: with lengths as elements of the field; `axis` is the joint's z."""

    parent: str
    rotation: Matrix
    offset: Direction
    axis: Direction


def _place(joint: Joint, lengths: Mapping[str, Any]) -> FrameStep:
    place = placement(joint)
    x, y, z = (_value(component, lengths) for component in place.offset)
    axis = (place.rotation[0][2], place.rotation[1][2], place.rotation[2][2])
    return FrameStep(joint.parent or BASE, place.rotation, (x, y, z), axis)


def _value(component: Mapping[str, Fraction], lengths: Mapping[str, Any]) -> Any:
    return sum((factor * (lengths[name] if name else 1) for name, factor in component.items()), Fraction(0))


def _either_side(joint: Joint, own: Freedom, base_rows: bool) -> Iterator[Body]:
    """Yield the bodies that may as well sit on the parent's link."""
    one = Fraction(1)
    if joint.kind == "revolute":
        yield from ({"m": one}, {"mz": one}, {"Ixx": one, "Iyy": one})
        return
    yield from ({kind: one} for kind in TENSOR)
    if joint.kind == "fixed":
        yield from ({kind: one} for kind in LINK_PARAMETERS[6:])
    elif own.turning == "never" or (own.turning == "one" and parallel(own.axis, (0, 0, 1))):
        yield {"mz": one}  # sliding along the axis of the only rotation moves no first moment
        if own.turning == "one" and not base_rows:
            yield from ({"mx": one}, {"my": one})


def _unseen_alone(name: str, own: Freedom, base_rows: bool) -> Iterator[Change]:
    """Yield the changes of one link alone."""
    one = Fraction(1)
    if own.turning == "never":
        yield from ({(name, kind): one} for kind in TENSOR)
        if own.still and not base_rows:
            yield from ({(name, kind): one} for kind in LINK_PARAMETERS[6:])
        elif not base_rows:
            yield from ({(name, kind): one} for kind in LINK_PARAMETERS[6:9])
        elif own.still:
            yield from _moments_along(name, own.gravity)
            if not any(own.gravity):
                yield {(name, "m"): one}
    elif own.turning == "one":
        yield from _tensors_unseen(name, own.axis, base_rows)
        if not base_rows:
            yield _moment(name, own.axis)
            if own.centre is not None and own.upright:
                yield from _moments_about(name, own.centre)
    elif own.centre is not None and not any(own.gravity) and not base_rows:
        yield from _moments_about(name, own.centre)


def _moments_along(name: str, direction: Direction) -> Iterator[Change]:
    """Yield the first moment along a direction; all three if it is zero."""
    if any(direction):
        yield _moment(name, direction)
    else:
        yield from ({(name, kind): Fraction(1)} for kind in LINK_PARAMETERS[6:9])


def _moments_about(name: str, centre: Direction) -> Iterator[Change]:
    """Yield the first moments about a point that rests."""
    for kind in LINK_PARAMETERS[6:9]:
        body = carried({kind: Fraction(1)}, IDENTITY, centre)
        yield {(name, other): value for other, value in body.items()}


def _moment(name: str, direction: Direction) -> Change:
    return {(name, kind): x for kind, x in zip(LINK_PARAMETERS[6:9], direction, strict=True) if x}


def _tensors_unseen(name: str, axis: Direction, base_rows: bool) -> Iterator[Change]:
    """Yield the tensors I with u I u = 0 (with base rows I u = 0), about a link's only axis u."""
    x, y, z = axis
    across: list[Direction] = [v for v in ((0, z, -y), (-z, 0, x), (y, -x, 0)) if any(v)]
    others: list[Direction] = across if base_rows else [*across, axis]
    for first in across:
        for second in others:
            yield {(name, kind): value for kind, value in _symmetric(first, second).items()}


def _symmetric(left: Direction, right: Direction) -> Body:
    """Return the tensor left right^T + right left^T."""
    places = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
    values = {
        kind: left[i] * right[k] + left[k] * right[i] for kind, (i, k) in zip(TENSOR, places, strict=True)
    }
    return {kind: value for kind, value in values.items() if value}


def _unseen_drive(joint: Joint) -> Iterator[Change]:
    """Yield the changes among the parameters of a drive: an offset is what differs between two directions."""
    one = Fraction(1)
    if joint.friction == "asymmetric" and joint.coulomb and joint.offset:
        plus, minus = ("", f"{joint.coulomb}_plus"), ("", f"{joint.coulomb}_minus")
        yield {("", joint.offset): one, plus: -one, minus: one}


def _unseen_among_drives(spec: ArmSpec, spins: Mapping[str, Mapping[str, Any]]) -> Iterator[Change]:
    """Yield the changes among drives of joints and coupled motors: as squares of speeds, their sums agree.

    A link that turns about its own axis as `spins` say has an inertia about it like a rotor's.
    """
    for part in ("rotor_inertia", "viscous"):
        named: list[tuple[Key, Mapping[str, Any]]] = [
            (("", getattr(drive.joint, part) + drive.suffix), dict(drive.lever))
            for drive in drives(spec)
            if getattr(drive.joint, part) and (part == "rotor_inertia" or drive.joint.friction == "symmetric")
        ]
        if part == "rotor_inertia":
            named += [((name, "Izz"), spin) for name, spin in spins.items()]
        place = {name: number for number, name in enumerate(coordinates(spec))}
        squares = [
            {(place[a], b): x * y for a, x in lever.items() for b, y in lever.items()} for _, lever in named
        ]
        for dependent, recipe in exact_dependencies(squares).items():
            change: Change = {named[column][0]: -Fraction(x) for column, x in recipe.items()}
            yield {**change, named[dependent][0]: Fraction(1)}


def _rotor_as_link(joint: Joint, place: FrameStep, parent: Freedom, own: Freedom) -> Iterator[Change]:
    """Yield the change of a rotor's inertia into parameters of a link that moves as the rotor does."""
    one, rotor = Fraction(1), ("", joint.rotor_inertia or f"rotor of {joint.name}")
    if joint.kind == "revolute" and parent.turning != "many" and not _along(place.axis, parent.axis):
        yield {rotor: one, (joint.name, "Izz"): -one}
    elif joint.kind == "prismatic" and _slides_freely(place.axis, parent):
        # the mass across the axis may as well sit on the parent's link; what is left moves as the rotor does
        change: Change = {(joint.name, "m"): one, rotor: -one}
        if own.gravity[2]:
            change["", joint.offset or f"offset of {joint.name}"] = own.gravity[2]
        for kind, value in carried({"m": one}, place.rotation, place.offset).items():
            change[place.parent, kind] = -value
        yield change


def _spins(
    spec: ArmSpec, steps: Mapping[str, FrameStep], parents: Mapping[str, Freedom]
) -> dict[str, Mapping[str, Any]]:
    """Return speeds of links about their own axis that are a sum of joint speeds in every posture."""
    joints = {joint.name: joint for joint in spec.joints}
    turning = [name for name, joint in joints.items() if joint.kind == "revolute"]
    found = {name: _spin(name, Z, joints, steps, parents) for name in turning}
    return {name: spin for name, spin in found.items() if spin is not None}


def _spin(
    link: str,
    direction: Direction,
    joints: Mapping[str, Joint],
    steps: Mapping[str, FrameStep],
    parents: Mapping[str, Freedom],
) -> dict[str, Any] | None:
    """Return a link's speed about a direction of its frame by the joints; None where that varies."""
    if link == BASE:
        return {}
    step, (x, y, z) = steps[link], direction
    if joints[link].kind != "revolute":
        rows = step.rotation
        before = (_along(rows[0], direction), _along(rows[1], direction), _along(rows[2], direction))
        return _spin(step.parent, before, joints, steps, parents)
    behind = parents[step.parent]
    along_axis = behind.turning == "one" and parallel(behind.axis, step.axis)
    if (x or y) and behind.turning != "never" and not along_axis:
        return None
    along = (z * step.axis[0], z * step.axis[1], z * step.axis[2])
    found = _spin(step.parent, along, joints, steps, parents)
    return found if found is None or not z else {**found, link: z}


def _slides_freely(axis: Direction, parent: Freedom) -> bool:
    """Return whether the parent turns about the joint's axis at most, and never moves along it."""
    if parent.turning == "many" or not parallel(axis, parent.axis):
        return False
    return not any(_along(axis, slide) for slide in parent.slides)


def _along(left: Direction, right: Direction) -> Any:
    return sum(a * b for a, b in zip(left, right, strict=True))
