"""Names of the intermediate values of an arm's kernel: what each is, where it is the motion of a link."""

from __future__ import annotations

from modelgen.symbolic.arms.arm_rows import ArmRows
from modelgen.symbolic.arms.expressions.graph import Ref, Symbol
from modelgen.symbolic.arms.kinematics import link_motions

#: What the names of a kernel mean; joints and links are numbered from 1, in the order of the spec.
LEGEND = (
    "q3, d1_q3, d2_q3  coordinate, speed and acceleration of joint 3; c3, s3 cosine and sine of it",
    "w3x dw3x a3x      angular speed, angular and linear acceleration (less gravity) of link 3 along its x",
    "u3xy              entry of [dw]x + [w]x [w]x of link 3",
    "z3_1x l3_1x       axis of joint 1 as link 3 sees it: rotation and translation per unit of speed",
)


SENSOR_LEGEND = (
    "q3, p3, y3  positions of link 3 and of motor 3, channel 3 of the sensors; d1_, d2_: their derivatives",
    "c3, s3      cosine and sine of the coordinate of joint 3",
    *LEGEND[1:],
)


def legend(rows: ArmRows) -> tuple[str, ...]:
    """Return what the names of a kernel mean."""
    return SENSOR_LEGEND if rows.sensor_set else LEGEND


def kernel_names(rows: ArmRows) -> dict[int, str]:
    """Return a name for every node that is a signal or part of a link's motion, all different."""
    graph, numbers = rows.graph, {joint.name: n for n, joint in enumerate(rows.spec.joints, start=1)}
    names: dict[int, str] = {}

    def give(ref: Ref, name: str) -> None:
        if abs(ref) > 1:
            names.setdefault(abs(ref), name)

    for joint in rows.spec.moving:
        number = numbers[joint.name]
        for order, start in enumerate(("q", "d1_q", "d2_q")):
            give(graph.symbol(Symbol("position", joint.name, order)), f"{start}{number}")
        give(graph.symbol(Symbol("force", joint.name)), f"tau{number}")
        if joint.kind == "revolute":
            give(graph.symbol(Symbol("cosine", joint.name)), f"c{number}")
            give(graph.symbol(Symbol("sine", joint.name)), f"s{number}")
    for payload in rows.spec.payloads:
        give(graph.symbol(Symbol("load", payload.name)), load_name(rows, payload.name))
    for name in rows.base_names:
        give(graph.symbol(Symbol("force", name)), name)
    for name, motion in link_motions(graph, rows.spec, rows.has_base).items():
        link = numbers[name]
        for start, vector in (
            ("w", motion.speed.angular),
            ("dw", motion.acceleration.angular),
            ("a", motion.acceleration.linear),
        ):
            for along, ref in zip("xyz", vector, strict=True):
                give(ref, f"{start}{link}{along}")
        for first, row in zip("xyz", motion.gradient, strict=True):
            for second, ref in zip("xyz", row, strict=True):
                give(ref, f"u{link}{first}{second}")
        for joint_name, axis in motion.axes.items():
            of = numbers.get(joint_name, joint_name)
            for start, vector in (("z", axis.angular), ("l", axis.linear)):
                for along, ref in zip("xyz", vector, strict=True):
                    give(ref, f"{start}{link}_{of}{along}")
    return names


def load_name(rows: ArmRows, payload: str) -> str:
    """Return how operations call the signal of a payload: load and its number."""
    return f"load{1 + [one.name for one in rows.spec.payloads].index(payload)}"
