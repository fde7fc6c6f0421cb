"""The same torques by Lagrange with Rayleigh's dissipation: energies go in, rules of derivation do the rest.

Independent of `inverse_dynamics` on purpose: it knows positions and speeds, no acceleration and no wrench.
The difference of both must be zero; `newton_minus_lagrange` says so in full for small arms, and at random
points of a prime field for any.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from random import Random

from modelgen.spec.arms.arm import ArmSpec, Joint
from modelgen.symbolic.arms.drives import (
    JointDrive,
    coordinates,
    deflected,
    direction_of,
    directions,
    drives,
    moved_by,
)
from modelgen.symbolic.arms.dynamics.geometry import in_base, link_poses
from modelgen.symbolic.arms.dynamics.inverse_dynamics import first_moment, inertia, inverse_dynamics
from modelgen.symbolic.arms.expressions.derivative import partial_derivatives, time_derivatives
from modelgen.symbolic.arms.expressions.evaluation import residues
from modelgen.symbolic.arms.expressions.graph import ONE, ZERO, Graph, Ref, Symbol
from modelgen.symbolic.arms.expressions.prime_field import PRIME
from modelgen.symbolic.arms.kinematics import cross, link_motions

HALF = Fraction(1, 2)
SEED = 2002


def lagrange_torques(graph: Graph, spec: ArmSpec) -> dict[str, Ref]:
    """Return d/dt dT/dq' - dT/dq + dV/dq + dR/dq' for every coordinate."""
    kinetic, potential = energies(graph, spec)
    dissipation = graph.total(_dissipation(graph, drive) for drive in drives(spec))
    for joint in (joint for joint in spec.moving if joint.elastic):
        stored, lost = _spring(graph, joint)
        potential, dissipation = graph.add(potential, stored), graph.add(dissipation, lost)
    torques = {}
    for name in coordinates(spec):
        momentum, friction = partial_derivatives(graph, [kinetic, dissipation], name, 1)
        by_place, height = partial_derivatives(graph, [kinetic, potential], name, 0)
        force = time_derivatives(graph, [momentum])[0]
        torques[name] = graph.total([force, -by_place, height, friction])
    return torques


def energies(graph: Graph, spec: ArmSpec) -> tuple[Ref, Ref]:
    """Return kinetic and potential energy of links and rotors."""
    motions, poses = link_motions(graph, spec), link_poses(graph, spec)
    gravity = [graph.constant(component) for component in spec.gravity]
    kinetic, potential = ZERO, ZERO
    for joint in spec.joints:
        omega, speed = motions[joint.name].speed.angular, motions[joint.name].speed.linear
        moment, mass = first_moment(graph, joint)
        turned = [graph.dot(row, omega) for row in inertia(graph, joint)]
        square = graph.add(graph.dot(omega, turned), graph.multiply(mass, graph.dot(speed, speed)))
        kinetic = graph.add(kinetic, graph.scale(HALF, square))
        kinetic = graph.add(kinetic, graph.dot(moment, cross(graph, speed, omega)))
        pose = poses[joint.name]
        weight = [graph.multiply(mass, x) for x in pose.origin]
        weight = [graph.add(a, b) for a, b in zip(weight, in_base(graph, pose.rotation, moment), strict=True)]
        potential = graph.subtract(potential, graph.dot(gravity, weight))
    for drive in drives(spec):
        if drive.joint.rotor_inertia:
            rotor = graph.symbol(Symbol("parameter", drive.joint.rotor_inertia + drive.suffix))
            speed_of = moved_by(graph, drive, 1)
            kinetic = graph.add(
                kinetic, graph.scale(HALF, graph.multiply(rotor, graph.multiply(speed_of, speed_of)))
            )
    return kinetic, potential


def newton_minus_lagrange(spec: ArmSpec) -> tuple[Graph, list[Ref]]:
    """Return the difference of both derivations for every coordinate, in a graph of its own."""
    graph = Graph()
    newton, lagrange = inverse_dynamics(graph, spec), lagrange_torques(graph, spec)
    return graph, [graph.subtract(newton[name], lagrange[name]) for name in coordinates(spec)]


def vanishes(graph: Graph, refs: Sequence[Ref], lengths: Sequence[str]) -> bool:
    """Return whether references are zero at random points modulo 2^61 - 1.

    That of an expression of degree d which is not zero happens with a probability of at most d / 2^61.
    """
    random = Random(SEED)
    drawn = {name: random.randrange(1, PRIME) for name in lengths}
    return not any(any(found.values) for found in residues(graph, refs, 4, SEED, drawn))


def _spring(graph: Graph, joint: Joint) -> tuple[Ref, Ref]:
    """Return the energy that a spring stores, and Rayleigh's function of its damping."""
    moved, rate = (deflected(graph, joint, order) for order in (0, 1))
    square = graph.multiply(moved, moved)
    energies = []
    for name, share, shape in (
        (joint.stiffness, HALF, square),
        (joint.stiffness3, HALF * HALF, graph.multiply(square, square)),
        (joint.damping, HALF, graph.multiply(rate, rate)),
    ):
        factor = graph.symbol(Symbol("parameter", name)) if name else ZERO
        energies.append(graph.scale(share, graph.multiply(factor, shape)))
    return graph.add(energies[0], energies[1]), energies[2]


def _dissipation(graph: Graph, drive: JointDrive) -> Ref:
    """Return Rayleigh's function of a drive: its derivative by the speed is friction."""
    joint, speed = drive.joint, moved_by(graph, drive, 1)
    total = ZERO
    for of, suffix, sign in directions(joint):
        direction = direction_of(graph, drive, of)
        while_moving = ONE if of == "sign" else direction
        if joint.viscous:
            viscous = graph.symbol(Symbol("parameter", joint.viscous + suffix + drive.suffix))
            square = graph.multiply(while_moving, graph.multiply(speed, speed))
            total = graph.add(total, graph.scale(HALF, graph.multiply(viscous, square)))
        if joint.coulomb:
            coulomb = graph.symbol(Symbol("parameter", joint.coulomb + suffix + drive.suffix))
            total = graph.add(total, sign * graph.multiply(coulomb, graph.multiply(direction, speed)))
    if joint.offset and not drive.suffix:
        total = graph.add(total, graph.multiply(graph.symbol(Symbol("parameter", joint.offset)), speed))
    return total
