"""An arm follows its reference in closed loop: how finely, from where, and which signals that gives."""

from __future__ import annotations

from math import ceil

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.runtime.simulation.arms.arm_motion import ArmMotion, arm_motion
from modelgen.runtime.simulation.arms.arm_plant import ArmPlant
from modelgen.runtime.simulation.arms.joint_controller import JointController, tracking
from modelgen.runtime.simulation.arms.joint_motion import JointMotion
from modelgen.runtime.simulation.arms.joint_reference import JointReference
from modelgen.runtime.simulation.arms.thresholds import MOST_A_SAMPLE, NODES_A_RATE, NODES_HZ, SAGGED


def carried_start(plant: ArmPlant, reference: JointMotion) -> FloatArray:
    """Return the state on the reference, shape (2 coordinates,), SI, links where their springs carry them."""
    own = plant.coordinates
    q, v, a = (own.stiff @ one[:, :1] for one in (reference.q, reference.v, reference.a))
    links = [k for k in range(len(own.joints)) if k not in own.driven]
    for _ in range(SAGGED if links else 0):
        by_q = plant.slopes(q, v, a)[0][0][np.ix_(links, links)]
        q[links] -= np.linalg.lstsq(by_q, plant.smooth(q, v, a)[links], rcond=None)[0]
    return np.concatenate((q[:, 0], v[:, 0]))


def nodes_a_sample(plant: ArmPlant, controller: JointController, reference: JointMotion) -> int:
    """Return how many steps a sample needs.

    Raises
    ------
    DataError
        When the closed loop is so fast that they would be too many.
    """
    rate = controller.fastest(plant, reference)
    if not rate < MOST_A_SAMPLE * NODES_A_RATE * reference.rate_hz:
        what = f"moves at {rate / (2.0 * np.pi):.3g} Hz with these parameters, too fast for the samples"
        raise DataError.at("closed loop", what, "check inertias (Ia of the drives) and gains")
    return max(1, ceil(max(NODES_HZ, rate / NODES_A_RATE) / reference.rate_hz))


def followed(
    plant: ArmPlant, reference: JointReference, controller: JointController, start: FloatArray, factor: int
) -> ArmMotion:
    """Return the motion at so many nodes a sample of the reference; it starts at positions and speeds in SI.

    `start` has shape (2 coordinates,).
    """
    nodes = reference.motion.finer(factor)
    added = None
    if reference.forces:
        at, places = np.arange(nodes.n) / factor, np.arange(reference.motion.n)
        still = np.zeros(reference.motion.n)
        forces = [np.interp(at, places, reference.forces.get(key, still)) for key in plant.forces]
        added = plant.gears @ np.array(forces)
    stiff = plant.coordinates.stiff
    supposed = JointMotion(stiff @ nodes.q, stiff @ nodes.v, stiff @ nodes.a, nodes.rate_hz)
    return arm_motion(plant, supposed, tracking(plant, controller, nodes, added), start)


def true_signals(plant: ArmPlant, motion: ArmMotion, stride: int = 1) -> dict[str, FloatArray]:
    """Return the exact signals at every `stride`-th node, shape (N,) each, in SI; channels come first."""
    model, moved, own = plant.model, motion.motion, plant.coordinates
    q, v, a, push = (one[:, ::stride] for one in (moved.q, moved.v, moved.a, motion.push))
    tau = plant.exerted(push)
    read = [own.reads @ one for one in (q, v, a)]
    true = dict(zip((*plant.forces, *own.channels), (*tau, *read[0]), strict=True))
    for key, terms in model.derived.items():
        true[key] = np.sum([weight * true[of] for weight, of in terms], axis=0)
    for k, key in enumerate(own.channels):
        true |= {f"d1_{key}": read[1][k], f"d2_{key}": read[2][k]}
    true |= plant.base_forces(q, v, a, tau)
    for c, name in enumerate(plant.rubbing.names):
        true[f"mode_{name}"] = motion.modes[c, ::stride].astype(float)
    return true
