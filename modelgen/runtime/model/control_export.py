"""The direct model as a StateSpace of python-control, with names (extra `control`)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from modelgen.errors import DataError
from modelgen.optional_library import optional_library
from modelgen.runtime.model.chain_matrices import body_inertias
from modelgen.runtime.model.model import Model


def control_system(
    model: Model,
    parameters: Mapping[str, float],
    directions: Mapping[str, int] | None = None,
    friction_inputs: bool = False,
) -> Any:
    """Return ``control.StateSpace`` of x' = A x + B Gamma, z = C x + D Gamma (Pham 2002, eqs. (17)-(19)).

    Parameters
    ----------
    model : Model
    parameters : mapping of str to float
        Physical parameters (SI), such as ``estimate.physical``; Coulomb frictions and offsets may be left
        out, they are no part of a linear system.
    directions : mapping of str to int, optional
        Body to +1 or -1, where friction is asymmetric.
    friction_inputs : bool
        Append one input ``friction_BODY`` for every body with Coulomb friction or offset (E and F).

    Raises
    ------
    DataError
        When a parameter is missing or control is not installed.
    """
    control = optional_library("control", "control", "control_system")
    import numpy as np

    idle = {name for name, role in model.roles.items() if role.role in ("coulomb", "offset")}
    given = {**dict.fromkeys(idle, 0.0), **model.known, **parameters}
    missing = [name for name in model.parameters if name not in given]
    if missing:
        what = f"lack {', '.join(missing)}"
        raise DataError.at("parameters", what, "give a value for each, in SI units")
    forward = {entry.body: 1 for entry in model.friction if entry.asymmetric}
    space = model.state_space(given, {**forward, **(directions or {})} or None)
    bodies = [body for body, _ in body_inertias(model)]
    inputs = [actuator.key for actuator in model.actuators]
    B, D = space.B, space.D
    if friction_inputs:
        inputs += [f"friction_{entry.body}" for entry in model.friction]
        B, D = np.hstack((B, space.E)), np.hstack((D, space.F))
    return control.ss(
        space.A,
        B,
        space.C,
        D,
        inputs=inputs,
        states=[f"q_{body}" for body in bodies] + [f"v_{body}" for body in bodies],
        outputs=[sensor.key for sensor in model.sensors],
        name=f"{model.chain}_{model.sensor_set}",
    )
