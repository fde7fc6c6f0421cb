"""A chain of which one body alone is sensed, as that one body: all that slow motion shows.

Below its modes a chain moves as one, and its springs bend by what the bodies behind them need. With sensor
and force at the first of two,

    T / q = (J_m + J_l) s^2 + F_v s - (J_l^2 / K) s^4 + ...

which is J_l s^2 (D s + K) / (J_l s^2 + D s + K) expanded in powers of s (derived). The whole row holds
derivatives of the force beside those of the motion: where these say the same of each other, its composites
are open, and so are steps in the parameters. The term in s^4 keeps what springs bend out of the sum of
inertias.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.model.known_parameters import Reduced, reduced_module, regrouped
from modelgen.runtime.model.mechanical_parts import BENDING
from modelgen.runtime.model.model import Model, model_from_module
from modelgen.runtime.model.module_file import MADE_BY
from modelgen.runtime.parameters.bounds import parameters_of

# N m/rad of springs beside bodies of 1 kg m^2: composites are then those of a rigid chain, to so many digits.
STIFF, RIGID_DIGITS = 1e12, 1e-9
LINKS = ("stiffness", "damping")


@dataclass(frozen=True)
class _Sums:
    """Sums of a chain's parameters by name: the role of each, and the key and factor of what it is times.

    Of inertias that is the acceleration of the body, of viscous friction its velocity, of Coulomb friction
    and offsets a direction and 1.
    """

    roles: Mapping[str, str]
    factors: Mapping[str, float]
    total: str

    @property
    def viscous(self) -> str | None:
        return next((name for name, role in self.roles.items() if role == "viscous"), None)


def as_one_body(model: Model) -> Model | None:
    """Return the model of a chain whose bodies move as one, with what its springs bend; None if it has none.

    Its parameters are sums of the chain's, as the body of the sensors feels them, what acts on that body, and
    the bending, which is not below zero in a chain that it is right for.
    """
    fourth = _fourth_derivative(model) if _serves(model) else None
    return None if fourth is None else model_from_module(_one_body_module(model, fourth))


def _serves(model: Model) -> bool:
    """Tell whether one body alone is sensed, pushed and rubbed, in one row of composites."""
    if model.is_arm or not model.composites or model.known or len(model.rows) != 1 or not model.actuators:
        return False
    for role in model.roles.values():
        if role.role == "stiffness3" or (role.role in LINKS and len(role.bodies) != 2):
            return False
    plain = not any(one.asymmetric or one.coulomb_minus != one.coulomb_plus for one in model.friction)
    places = (model.sensors, model.actuators, model.friction)
    bodies = {one.body for every in places for one in every}
    return plain and len(bodies) == 1 and None not in bodies and len(model.sensors) == 1


def _fourth_derivative(model: Model) -> int | None:
    """Return the column that is times the fourth derivative of the position; None without one."""
    order = model.sensors[0].order
    keys = {one.key for one in model.signals if one.sensor and one.derivative + order == 4}
    for column, terms in model.regressor_columns[0].items():
        if len(terms) == 1 and terms[0][1] in keys:
            return column
    return None


def _one_body_module(model: Model, fourth: int) -> ModuleType:
    reduced, sums = _rigid(model)
    bent = np.zeros((len(reduced.mixing), 1))
    bent[fourth] = -1.0
    bending = _bending_name(model, sums)
    names = (*reduced.names, bending)
    roles = {name: {"role": role, "bodies": _body(model)} for name, role in sums.roles.items()}
    more = {
        "PARAMETERS": names,
        "COMPOSITES": {},
        "ROLES": {**roles, bending: {"role": BENDING, "bodies": _body(model)}},
        "PARAMETER_SETS": {},
        "FRICTION": tuple({**one, "state": 1} for one in model.module.FRICTION),
        "base_from_physical": lambda parameters: np.array([parameters[name] for name in names]),
        "base_jacobian": lambda parameters: np.eye(len(names)),
        "physical_from_base": lambda base: dict(zip(names, np.asarray(base).tolist(), strict=True)),
        "state_space": _state_space(model, sums),
        MADE_BY: (_made_again, (model,)),
    }
    units = {**reduced.units, bending: model.units[model.base_parameters[fourth]]}
    mixing = np.hstack((reduced.mixing, bent))
    whole = Reduced(names, units, mixing, reduced.fixed, names, {}, more)
    return _with_used_signals(reduced_module(model, {}, whole), model)


def _made_again(model: Model) -> ModuleType | None:
    found = as_one_body(model)
    return None if found is None else found.module


def _body(model: Model) -> tuple[str, ...]:
    return (str(model.sensors[0].body),)


def _rigid(model: Model) -> tuple[Reduced, _Sums]:
    """Return the sums that are left where no spring bends."""
    at = dict.fromkeys(model.parameters, 1.0)
    links = dict.fromkeys(parameters_of(model, *LINKS), 0.0)
    at |= links | dict.fromkeys(parameters_of(model, "stiffness"), STIFF)
    every = np.array(model.base_jacobian(at))
    every[np.abs(every) < RIGID_DIGITS * np.abs(every).max()] = 0.0
    reduced = regrouped(model, links, every)
    roles, factors, terms = {}, {}, model.regressor_columns[0]
    for name, column in zip(reduced.names, reduced.mixing.T, strict=True):
        head = next(one for one, own in zip(model.parameters, every.T, strict=True) if np.all(own == column))
        roles[name] = model.roles[head].role
        factors[name] = sum(
            value * terms[place][0][0] for place, value in enumerate(column.tolist()) if value
        )
    total = next(name for name, role in roles.items() if role == "inertia")
    return reduced, _Sums(roles, factors, total)


def _bending_name(model: Model, sums: _Sums) -> str:
    """Return what springs bend as a formula, where it is a short one."""
    inertias, springs = (parameters_of(model, role) for role in ("inertia", "stiffness"))
    behind = [name for name in inertias if set(model.roles[name].bodies) != set(_body(model))]
    if len(behind) == len(springs) == 1 and behind[0] in sums.total.split(" + "):
        return f"{behind[0]}^2/{springs[0]}"
    return "bending of the springs"


def _state_space(model: Model, sums: _Sums) -> Any:
    """Return the function that gives the state space of the one body, what springs bend left out."""
    pushes = {one.key: 0.0 for one in model.actuators}
    signals = {one.key: one for one in model.signals}
    for factor, key in model.measurement_columns[0]:
        if signals[key].derivative == 0 and signals[key].actuator in pushes:
            pushes[str(signals[key].actuator)] += factor
    rubs = [
        max((abs(sums.factors[name]) for name in (one.coulomb_plus, one.offset) if name), default=1.0)
        for one in model.friction
    ]
    order, form, viscous = model.sensors[0].order, model.module.StateSpace, sums.viscous

    def state_space(parameters: Mapping[str, float], directions: Mapping[str, int] | None = None) -> Any:
        inertia = sums.factors[sums.total] * parameters[sums.total]
        slows = 0.0 if viscous is None else sums.factors[viscous] * parameters[viscous]
        A = np.array([[0.0, 1.0], [0.0, -slows / inertia]])
        B = np.vstack((np.zeros(len(pushes)), np.array(list(pushes.values())) / inertia))
        E = np.vstack((np.zeros(len(rubs)), -np.array(rubs) / inertia))
        none = np.zeros((1, len(pushes))), np.zeros((1, len(rubs)))
        if order < 2:
            return form(A, B, np.eye(2)[order : order + 1], none[0], E, none[1])
        return form(A, B, A[1:], B[1:], E, E[1:])

    return state_space


def _with_used_signals(module: ModuleType, model: Model) -> ModuleType:
    """Return a module without the signals that its columns do not hold."""
    columns = module.columns()
    used = {key for terms in columns["regressor"][0].values() for _, key in terms}
    used |= {key for _, key in columns["measurement"][0]} | {*model.rows[0].reversals}
    used |= {str(one.of) for one in model.features} | {str(one.times) for one in model.features}
    kept = tuple(one for one in model.module.SIGNALS if one["key"] in used)
    measurement, regressor = module.measurement, module.regressor
    lost = [one["key"] for one in model.module.SIGNALS if one not in kept]

    def whole(signals: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        return {**dict.fromkeys(lost, np.zeros(len(next(iter(signals.values()))))), **signals}

    vars(module).update(
        SIGNALS=kept,
        ROWS=({**model.module.ROWS[0], "order": 4},),
        measurement=lambda signals: measurement(whole(signals)),
        regressor=lambda signals: regressor(whole(signals)),
    )
    return module
