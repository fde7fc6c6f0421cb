"""What an arm's encoders and drives would read without noise: instruments of its rows.

Where the controller is known and the record has its references, the closed loop is simulated with the present
estimate. Else the arm follows the slow part of the measured motion, and its drives exert what that needs: a
low-pass near the motion lets through next to none of the noise that accelerations consist of.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.iv.thresholds import ARM_SMOOTHING, ARM_SMOOTHING_ORDER
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.arms.arm_plant import arm_plant
from modelgen.runtime.simulation.arms.carried_payloads import carrying, forces_of_motion, loads_of
from modelgen.runtime.simulation.arms.followed_reference import followed, nodes_a_sample, true_signals
from modelgen.runtime.simulation.arms.joint_controller import JointController
from modelgen.runtime.simulation.arms.joint_reference import JointReference
from modelgen.runtime.simulation.arms.measured_motion import measured_motion
from modelgen.runtime.simulation.arms.validate_arm import first_state, reference_motion


def arm_beside(
    model: Model,
    values: Mapping[str, float],
    record: Record,
    choice: FilterChoice,
    controller: JointController | None,
) -> dict[str, FloatArray]:
    """Return the channels of a record as they would be without noise, shape (n,) each.

    Parameters
    ----------
    model : Model
    values : mapping of str to float
        Base parameters by name, SI; what is absent counts as zero.
    record : Record
    choice : FilterChoice
        Its dynamics say how fast the motion is.
    controller : JointController, optional
        The loop is simulated where it is given and the record has ``reference_NAME`` of every joint, and
        carries the same payloads all the time.

    Raises
    ------
    DataError
        When the arm cannot be simulated, or its motion runs away.
    """
    base = np.array([values.get(name, 0.0) for name in model.base_parameters])
    plant = arm_plant(model, base, tame=True)
    steady = all(np.ptp(share) == 0.0 for share in loads_of(model, record).values())
    told = all(f"reference_{name}" in record.signals for name in plant.joints)
    if controller is not None and told and steady:
        plant = carrying(plant, record)
        reference = JointReference(reference_motion(plant, record), record.name)
        start = first_state(plant, record, _smoothing_hz(record, choice))
        factor = nodes_a_sample(plant, controller, reference.motion)
        return true_signals(plant, followed(plant, reference, controller, start, factor), factor)
    own = plant.coordinates
    motion = measured_motion(own, record, ARM_SMOOTHING_ORDER, _smoothing_hz(record, choice))
    found = dict(zip(own.channels, own.reads @ motion.q, strict=True))
    for key, terms in model.derived.items():
        found[key] = np.sum([weight * found[of] for weight, of in terms], axis=0)
    return found | forces_of_motion(plant, motion, record)


def _smoothing_hz(record: Record, choice: FilterChoice) -> float:
    return min(ARM_SMOOTHING * (choice.dynamics_hz or choice.cutoff_hz), 0.4 * record.fs)


def joint_controller(controller: object) -> JointController | None:
    """Return the controller of an arm's loop.

    Raises
    ------
    DataError
        When it is one of chains.
    """
    if controller is None or isinstance(controller, JointController):
        return controller
    raise DataError.at("loop", "has the controller of a chain", "give Loop(JointController(...))")
