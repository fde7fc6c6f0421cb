"""Force and torque that each of a link's ten parameters makes when the link moves, in the link's frame.

f = m a + U mc and n = I alpha + omega x (I omega) + mc x a, about the frame's origin, are linear in m, mc and
I. `LINK_PARAMETERS` of the spec has the order.
"""

from __future__ import annotations

from modelgen.symbolic.arms.expressions.graph import ZERO, Graph, Ref
from modelgen.symbolic.arms.kinematics import NONE, LinkMotion, Twist, Vector


def parameter_wrenches(graph: Graph, motion: LinkMotion) -> tuple[tuple[Vector, Vector], ...]:
    """Return (torque, force) per unit of each of the ten parameters, in the order of `LINK_PARAMETERS`."""
    alpha, acceleration = motion.acceleration.angular, motion.acceleration.linear
    torques = _inertia_torques(graph, motion.speed.angular, alpha, motion.gradient)
    x, y, z = acceleration
    columns = list(zip(*motion.gradient, strict=True))
    arms: tuple[Vector, Vector, Vector] = ((ZERO, -z, y), (z, ZERO, -x), (-y, x, ZERO))
    return (
        *((torque, NONE) for torque in torques),
        *((arm, (column[0], column[1], column[2])) for arm, column in zip(arms, columns, strict=True)),
        (NONE, acceleration),
    )


def along_axis(graph: Graph, axis: Twist, wrench: tuple[Vector, Vector]) -> Ref:
    """Return the component of a wrench (torque, force) that acts on an axis: what its joint has to give."""
    torque, force = wrench
    return graph.add(graph.dot(axis.angular, torque), graph.dot(axis.linear, force))


def _inertia_torques(
    graph: Graph, omega: Vector, alpha: Vector, gradient: tuple[Vector, Vector, Vector]
) -> tuple[Vector, ...]:
    """Return I alpha + omega x (I omega) per unit of Ixx, Ixy, Ixz, Iyy, Iyz, Izz."""
    (wx, wy, wz), (ax, ay, az) = omega, alpha
    times, less = graph.multiply, graph.subtract
    xx, yy, zz = times(wx, wx), times(wy, wy), times(wz, wz)
    xy, xz, yz = times(wx, wy), times(wx, wz), times(wy, wz)
    u = gradient  # its entries off the diagonal are the sums of accelerations and products of speeds
    return (
        (ax, xz, -xy),
        (-u[2][0], u[2][1], less(xx, yy)),
        (u[1][0], less(zz, xx), -u[1][2]),
        (-yz, ay, xy),
        (less(yy, zz), -u[0][1], u[0][2]),
        (yz, -xz, az),
    )
