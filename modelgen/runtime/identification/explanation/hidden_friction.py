"""What friction that the spec does not name moves where a sensor is late, or behind a low-pass.

Friction on a body is a delay of its sensor, damping of its link and friction on another body, but for what
the delay does to accelerations. Where it is hidden by that it is not estimated, and the friction that the
spec names is labelled as a sum; what else it moves is in the intervals, as far as its size is open.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.iv.companion_simulation import Simulated
from modelgen.runtime.iv.effect import LATE, LOW_PASSES, Effect
from modelgen.runtime.iv.score_tests import Span, moves_within
from modelgen.runtime.iv.thresholds import LEAST_OWN_DELAY
from modelgen.runtime.iv.told_effects import SUMMED
from modelgen.runtime.model.model import Model

FORM = {"viscous": 2.0, "coulomb": 1.0}


def moved_by_hidden_friction(
    model: Model,
    span: Span,
    simulated: Sequence[Simulated],
    known: Sequence[Effect],
    hidden: Mapping[Effect, Sequence[FloatArray]],
) -> FloatArray:
    """Return what friction moves that is hidden, as a mean square, shape (c, c) in SI.

    Its size is about that of friction of its kind which the spec names, at most, by the power that it takes;
    the value of that friction is the sum of both, and moves by nothing.

    Parameters
    ----------
    span : Span
    simulated : sequence of Simulated
    known : sequence of Effect
        Those that are estimated.
    hidden : mapping of Effect to sequence of array
        What each that is hidden adds to the residual, one array a block.
    """
    columns = span.fit.columns
    total, sensors = np.zeros((len(columns),) * 2), {one.key for one in model.sensors}
    if not any(one.kind in LATE | LOW_PASSES and one.channel in sensors for one in known):
        return total
    speeds = {
        body: float(np.sqrt(sum(np.mean(record.led[body].speed ** 2) for record in simulated)))
        for body in simulated[0].plant.bodies
    }
    for effect, rows in hidden.items():
        if not effect.name.startswith(SUMMED):
            continue
        kind, body = effect.name.split(" friction on ")
        role = kind.lower()
        named = [name for name, one in model.roles.items() if one.role == role]
        # what takes as much power as all that is named
        largest = sum(
            abs(simulated[0].plant.parameters[name])
            * (speeds[model.roles[name].bodies[0]] / speeds[body]) ** FORM[role]
            for name in named
            if speeds[body]
        )
        if largest:
            moved = moves_within(
                span, [[largest * part for part in rows]], doubtful=True, own=LEAST_OWN_DELAY
            )
            stays = np.array([name not in named for name in columns])
            total += moved * np.outer(stays, stays)
    return total
