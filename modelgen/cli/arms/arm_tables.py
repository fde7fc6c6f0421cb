"""What `modelgen show` says of an arm: its joints, drives and parameters, as plain values and as tables."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import Any

from rich.console import Group
from rich.text import Text

from modelgen.cli.arms.base_tables import base_tables, describe_base
from modelgen.cli.arms.sensor_tables import describe_sensor_sets, sensor_set_tables
from modelgen.cli.tables import Description, table
from modelgen.errors import listed
from modelgen.spec.arms.angles import nearly_right
from modelgen.spec.arms.arm import LINK_PARAMETERS, ArmSpec, Joint, Length, Step, Turn
from modelgen.spec.arms.parameters import arm_parameters
from modelgen.spec.arms.poses import zero_poses

_AXES = "xyz"


def describe_arm(arm: ArmSpec, prove: bool = False, sensors: str | None = None) -> Description:
    """Return an arm's kinematics, drives and parameters as plain values; angles in rad, lengths in m.

    `prove` asks whether the equations of Newton and Euler are those of Lagrange; `sensors` is a sensor set,
    or "all" for those that robots have usually.
    """
    poses = zero_poses(arm)
    valued = None not in arm.lengths.values()
    return {
        "arm": arm.name,
        "title": arm.title,
        "gravity": [float(value) for value in arm.gravity],
        "lengths": dict(arm.lengths),
        "joints": [_joint(joint, poses[joint.name].tolist() if valued else None) for joint in arm.joints],
        "motors": [{"joint": name, "position": text} for name, text in _motors(arm)],
        "parameters": [
            {"name": p.name, "role": p.role, "joint": p.joint, "unit": p.unit, "known": arm.known.get(p.name)}
            | ({"payload": p.payload} if p.payload else {})
            for p in arm_parameters(arm)
        ],
        "parameter_sets": {name: dict(values) for name, values in arm.parameter_sets.items()},
        "sensor_sets": describe_sensor_sets(arm, sensors),
        **describe_base(arm, prove, sensors if sensors in arm.sensor_sets else ""),
        "notes": list(_notes(arm)),
    }


def arm_tables(described: Description) -> Group:
    """Lay out what `describe_arm` says."""
    gravity = ", ".join(f"{value:g}" for value in described["gravity"])
    lengths = ", ".join(f"{n} = {'?' if v is None else f'{v:g}'}" for n, v in described["lengths"].items())
    head = [
        f"{described['arm']}: {described['title']}",
        "",
        f"gravity ({gravity}) m/s^2 in the frame of the base",
    ]
    if lengths:
        head.append(f"lengths (m): {lengths}")
    return Group(
        *(Text(line) for line in [*head, ""]),
        *_joint_tables(described),
        *_parameter_lines(described),
        *sensor_set_tables(described["sensor_sets"]),
        *base_tables(described),
    )


def _joint_tables(described: Description) -> Iterator[Any]:
    joints = described["joints"]
    columns = ("joint", "type", "on", "frame at q = 0, from that of the joint it is on", "stands at (m)")
    lines = [
        (joint["name"], joint["type"], joint["parent"] or "base", joint["placement"], _place(joint["pose"]))
        for joint in joints
    ]
    yield table("Joints (z is the axis)", columns, lines)
    limited = [joint for joint in joints if joint["limits"]]
    if limited:
        yield Text("")
        yield table(
            "Limits",
            ("joint", "position", "speed", "acceleration", "force"),
            [(joint["name"], *_limit_texts(joint)) for joint in limited],
        )
    geared = [f"  {motor['position']}" for motor in described["motors"]]
    if geared:
        yield Text("\nMotors, from the positions of joints")
        yield from (Text(line) for line in geared)


def _parameter_lines(described: Description) -> Iterator[Any]:
    by_joint: dict[str, dict[str, list[str]]] = {}
    for parameter in described["parameters"]:
        kind = "link" if parameter["role"] in LINK_PARAMETERS else "drive"
        place = f"{parameter['payload']} on " if "payload" in parameter else ""
        place += parameter["joint"]
        by_joint.setdefault(place, {"link": [], "drive": []})[kind].append(parameter["name"])
    rows = [
        (joint, _short(kinds["link"]), ", ".join(kinds["drive"]) or "-") for joint, kinds in by_joint.items()
    ]
    yield Text("")
    title = f"Parameters: {len(described['parameters'])}"
    yield table(title, ("joint", "of the link behind it", "of its drive"), rows)
    known = [
        f"known: {p['name']} = {p['known']!r} {p['unit']}"
        for p in described["parameters"]
        if p["known"] is not None
    ]
    sets = [
        f"values: {name} ({len(values)} parameters)" for name, values in described["parameter_sets"].items()
    ]
    said = [*known, *sets, *(f"note: {note}" for note in described["notes"])]
    yield from (Text(line) for line in (["", *said] if said else []))


def _joint(joint: Joint, pose: list[list[float]] | None) -> Description:
    limits = {
        "position": None if joint.position_limits is None else list(joint.position_limits),
        "speed": joint.speed_limit,
        "acceleration": joint.acceleration_limit,
        "force": joint.force_limit,
    }
    return {
        "name": joint.name,
        "type": joint.kind,
        "parent": joint.parent,
        "placement": " ".join(map(_step_text, joint.placement)) or "the same",
        "pose": pose,
        "limits": {name: value for name, value in limits.items() if value is not None},
    }


def _step_text(step: Step) -> str:
    axis = _AXES[step.axis]
    if isinstance(step, Turn):
        degrees = math.degrees(step.angle.radians)
        degrees = 90 * round(degrees / 90) if 0 in (step.angle.cosine, step.angle.sine) else round(degrees, 4)
        return f"Rot({axis}, {degrees:g}°)"
    return f"Trans({axis}, {_length_text(step.length)})"


def _length_text(length: Length) -> str:
    if length.name is None:
        return f"{float(length.factor):.6g}"
    return _times(length.factor, length.name)


def _times(factor: Fraction, name: str) -> str:
    size = abs(factor)
    number = "" if size == 1 else f"{float(size):.6g} "
    return f"{'-' if factor < 0 else ''}{number}{name}"


def _motors(arm: ArmSpec) -> Iterator[tuple[str, str]]:
    moving = arm.moving
    for k, (joint, row) in enumerate(zip(moving, arm.transmission, strict=True)):
        if any(ratio != (i == k) for i, ratio in enumerate(row)):
            terms = [_times(ratio, f"q_{moving[i].name}") for i, ratio in enumerate(row) if ratio]
            yield joint.name, f"motor {joint.name} = {' + '.join(terms).replace('+ -', '- ')}"


def _notes(arm: ArmSpec) -> Iterator[str]:
    """Yield what is allowed and yet looks like a mistake."""
    for joint in arm.joints:
        for step in joint.placement:
            if isinstance(step, Turn) and nearly_right(step.angle):
                off = abs(math.remainder(step.angle.radians, 0.5 * math.pi))
                yield (
                    f"joint {joint.name} is turned {off:.2g} rad off a right angle; if one is meant, "
                    "write more digits (1.5707963) or degrees: else this alone distinguishes some parameters"
                )


def _place(pose: Sequence[Sequence[float]] | None) -> str:
    return "" if pose is None else ", ".join(f"{round(row[3], 4) + 0.0:g}" for row in pose[:3])


def _limit_texts(joint: Description) -> Iterator[str]:
    limits, turns = joint["limits"], joint["type"] == "revolute"
    unit = "rad" if turns else "m"
    ends = limits.get("position")
    yield f"{ends[0]:.4g} to {ends[1]:.4g} {unit}" if ends else "-"
    for name, per in (("speed", "/s"), ("acceleration", "/s^2")):
        yield f"{limits[name]:.4g} {unit}{per}" if name in limits else "-"
    yield f"{limits['force']:.4g} {'N m' if turns else 'N'}" if "force" in limits else "-"


def _short(names: Sequence[str]) -> str:
    """Return names of a link in few letters: the first, ..., the last."""
    return f"{names[0]} ... {names[-1]}" if len(names) == 10 else listed(names).replace("none", "-")
