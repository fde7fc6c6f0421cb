"""Mass matrix and accelerations of an arm: the inverse dynamics, taken apart and solved."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

from modelgen.spec.arms.arm import ArmSpec
from modelgen.symbolic.arms.drives import coordinates, motor_coordinate
from modelgen.symbolic.arms.dynamics.inverse_dynamics import inverse_dynamics
from modelgen.symbolic.arms.expressions.derivative import partial_derivatives, substituted
from modelgen.symbolic.arms.expressions.graph import ZERO, Graph, Ref, Symbol


@dataclass(frozen=True)
class DirectDynamics:
    """torques = mass @ accelerations + bias.

    Attributes
    ----------
    mass
        Mass matrix by (row, column), both triangles, rotor inertias included; zeros are left out.
    bias
        Torques at no acceleration: speeds, gravity, friction.
    accelerations
        By coordinate, from torques, which are forces' symbols: those of the joints, not of the motors'.
        Behind a spring the force of the joint acts on the coordinate of its motor, and none on its link.
    """

    mass: Mapping[tuple[int, int], Ref]
    bias: tuple[Ref, ...]
    accelerations: Mapping[str, Ref]


def mass_matrix(graph: Graph, spec: ArmSpec, torques: Mapping[str, Ref]) -> dict[tuple[int, int], Ref]:
    """Return how the torques of `inverse_dynamics` depend on the accelerations, both triangles."""
    names = coordinates(spec)
    refs = [torques[name] for name in names]
    mass: dict[tuple[int, int], Ref] = {}
    for column, name in enumerate(names):
        found = partial_derivatives(graph, refs[: column + 1], name, 2)
        for row, ref in enumerate(found):
            if ref:
                mass[row, column] = mass[column, row] = ref
    return mass


def direct_dynamics(graph: Graph, spec: ArmSpec, regrouped: Collection[str] = ()) -> DirectDynamics:
    """Return the mass matrix, the bias and the accelerations; `regrouped` as `inverse_dynamics` takes it.

    The matrix is factorised from the tip to the base (Featherstone 2008, section 6.5): then the factors of a
    tree have no entry where the matrix has none.
    """
    torques = inverse_dynamics(graph, spec, regrouped)
    names = coordinates(spec)
    mass = mass_matrix(graph, spec, torques)
    still = {Symbol("position", name, 2): ZERO for name in names}
    bias = substituted(graph, [torques[name] for name in names], still)
    pushed = {motor_coordinate(joint): joint.name for joint in spec.moving}
    forces = [graph.symbol(Symbol("force", pushed[name])) if name in pushed else ZERO for name in names]
    right = [graph.subtract(force, load) for force, load in zip(forces, bias, strict=True)]
    found = _solved(graph, mass, right)
    return DirectDynamics(mass, tuple(bias), dict(zip(names, found, strict=True)))


def _solved(graph: Graph, mass: Mapping[tuple[int, int], Ref], right: list[Ref]) -> list[Ref]:
    """Return the solution of a symmetric positive definite system, mass = L^T D L from the last row up."""
    size = len(right)
    work = dict(mass)
    lower: dict[tuple[int, int], Ref] = {}
    shares: list[Ref] = [ZERO] * size
    for k in reversed(range(size)):
        shares[k] = graph.reciprocal(work[k, k])
        before = [i for i in range(k) if work.get((k, i), ZERO)]
        for i in before:
            lower[k, i] = graph.multiply(work[k, i], shares[k])
        for i in before:
            for j in before:
                if j <= i:
                    less = graph.multiply(lower[k, i], work[k, j])
                    work[i, j] = graph.subtract(work.get((i, j), ZERO), less)
    found = list(right)
    for k in reversed(range(size)):
        for i in range(k):
            if (k, i) in lower:
                found[i] = graph.subtract(found[i], graph.multiply(lower[k, i], found[k]))
    for k in range(size):
        found[k] = graph.multiply(found[k], shares[k])
        for i in range(k):
            if (k, i) in lower:
                found[k] = graph.subtract(found[k], graph.multiply(lower[k, i], found[i]))
    return found
