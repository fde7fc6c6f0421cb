"""SI units of signals, forces and parameters, by the kind of motion of the body they belong to."""

from __future__ import annotations

from typing import Literal

Motion = Literal["rotation", "translation"]
Measures = Literal["position", "velocity", "acceleration"]
Role = Literal["inertia", "viscous", "coulomb", "offset", "damping", "stiffness", "stiffness3"]

_COORDINATE: dict[Motion, str] = {"rotation": "rad", "translation": "m"}
_FORCE: dict[Motion, str] = {"rotation": "N m", "translation": "N"}
ORDER: dict[Measures, int] = {"position": 0, "velocity": 1, "acceleration": 2}
_PARAMETER: dict[Motion, dict[Role, str]] = {
    "rotation": {
        "inertia": "kg m^2",
        "viscous": "N m s/rad",
        "coulomb": "N m",
        "offset": "N m",
        "damping": "N m s/rad",
        "stiffness": "N m/rad",
        "stiffness3": "N m/rad^3",
    },
    "translation": {
        "inertia": "kg",
        "viscous": "N s/m",
        "coulomb": "N",
        "offset": "N",
        "damping": "N s/m",
        "stiffness": "N/m",
        "stiffness3": "N/m^3",
    },
}


def signal_unit(motion: Motion, measures: Measures, derivative: int) -> str:
    """Return the unit of the `derivative`-th time derivative of what a sensor measures, such as "rad/s^2"."""
    return _COORDINATE[motion] + _per_seconds(ORDER[measures] + derivative)


def force_unit(motion: Motion, derivative: int) -> str:
    """Return the unit of the `derivative`-th time derivative of a force or torque, such as "N m/s"."""
    return _FORCE[motion] + _per_seconds(derivative)


def parameter_unit(motion: Motion, role: Role) -> str:
    """Return the unit of a physical parameter, such as "N m s/rad"."""
    return _PARAMETER[motion][role]


def _per_seconds(order: int) -> str:
    return {0: "", 1: "/s"}.get(order, f"/s^{order}")
