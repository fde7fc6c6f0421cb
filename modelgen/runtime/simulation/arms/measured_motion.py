"""The motion of an arm that a record shows: positions behind a low-pass, and their derivatives."""

from __future__ import annotations

import numpy as np

from modelgen.runtime.filters.derivatives import differentiate, stencil_for
from modelgen.runtime.filters.zero_phase import zero_phase
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.arms.arm_coordinates import ArmCoordinates
from modelgen.runtime.simulation.arms.joint_motion import JointMotion


def measured_motion(own: ArmCoordinates, record: Record, order: int, cutoff_hz: float) -> JointMotion:
    """Return the motion of the coordinates below a frequency in Hz.

    The low-pass is a Butterworth of that order, forward and backward.
    """
    seen = own.seen_in(record.signals)
    q = np.array([zero_phase(one, order, cutoff_hz, record.fs) for one in seen])
    stencil = stencil_for(cutoff_hz, record.fs)
    v, a = (np.array([differentiate(one, record.dt, k, stencil) for one in q]) for k in (1, 2))
    return JointMotion(q, v, a, record.fs)
