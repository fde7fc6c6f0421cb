"""A model with some of its parameters known: what they contribute goes to the left-hand side.

As `modelgen.spec.known_values.with_known` does for a spec; here for a generated module, whose text is left
alone. Columns of y = D x become y - D x_known = D' x': where base parameters are sums of physical ones, those
left are regrouped (Gautier 1991); where they are composites, these stay functions of the parameters left, and
a composite that has none left is known with them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import FunctionType, ModuleType
from typing import Any

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, Problem, listed, signed_sum
from modelgen.keyword_options import check_named_values
from modelgen.magnitudes import REMEDY, is_usable
from modelgen.runtime.model.model import Model, Terms, model_from_module
from modelgen.runtime.model.module_file import MADE_BY

NEGLIGIBLE = 1e-9  # of the largest entry of a column
SEED = 2002
FREE_SIGNS = ("offset", "stiffness3")


def with_known(model: Model, values: Mapping[str, float], where: str = "known") -> Model:
    """Return a model in which these parameters have these values (SI) and are not estimated.

    What is estimated of the others has the intervals that it has if the values are exact.

    Parameters
    ----------
    model : Model
    values : mapping of str to float
        Physical parameters by name; those that the model knows already may be given anew.
    where : str
        What messages call the place of the values.

    Raises
    ------
    DataError
        With one problem per name that is no parameter, and per value that nature does not have; when nothing
        is left to estimate.

    Examples
    --------
    >>> stiff = modelgen.with_known(model, {"K": 15150.0})  # doctest: +SKIP
    """
    check_named_values(where, values)
    problems = [problem for name in values if (problem := _problem(model, name, values[name], where))]
    DataError.raise_any(problems)
    renewed = [name for name in values if name in model.known and values[name] != model.known[name]]
    if renewed:
        remedy = "generate the module without it in [known], or leave it out"
        what = f"is known in the module already, as {model.known[renewed[0]]:g}"
        raise DataError.at(f"{where}: {renewed[0]}", what, remedy)
    held = {name: float(value) for name, value in values.items() if name in model.parameters}
    if held and model.is_arm:
        remedy = "take them into [known] of the arm's file, and generate the module again"
        raise DataError.at(where, "gives values for an arm, whose module is regrouped by then", remedy)
    if not held:
        return model
    if model.composites:
        reduced = _reduced(model, held)
    else:
        reduced = regrouped(model, held, model.base_jacobian(dict.fromkeys(model.parameters, 1.0)))
    if not reduced.names:
        what = "leave no parameter to estimate"
        raise DataError.at(where, what, f"leave out at least one of {listed(held)}")
    return model_from_module(reduced_module(model, held, reduced))


def as_identified(model: Model, known: Mapping[str, float]) -> Model:
    """Return the model of an estimate, in which these were known, from the module of the same sensors."""
    return with_known(model, {name: value for name, value in known.items() if name in model.parameters})


@dataclass(frozen=True, eq=False)
class Reduced:
    """What is left of the base parameters, and what is known of them.

    `names` are those left and `mixing`, shape (columns, left), their columns as sums of the old ones;
    `fixed`, shape (columns,), is what is known of the old ones; `more` replaces further names of the module.
    """

    names: tuple[str, ...]
    units: Mapping[str, str]
    mixing: FloatArray
    fixed: FloatArray
    identifiable: tuple[str, ...]
    absent: Mapping[str, str]
    more: Mapping[str, Any]


def _problem(model: Model, name: str, value: float, where: str) -> Problem | None:
    if name not in model.parameters and name not in model.known:
        return Problem(f"{where}: {name}", "is no parameter of the model", f"its: {listed(model.parameters)}")
    if not is_usable(value):
        return Problem(f"{where}: {name}", f"is {value!r}", REMEDY)
    role = model.roles[name].role
    if role not in FREE_SIGNS and (value < 0.0 or (value == 0.0 and role == "inertia")):
        limit = "greater than 0" if role == "inertia" else "0 or greater"
        return Problem(f"{where}: {name}", f"is {value:g}, but {role} must be {limit}", "correct the value")
    return None


def _left(model: Model, held: Mapping[str, float]) -> list[str]:
    return [name for name in model.parameters if name not in held]


def regrouped(model: Model, held: Mapping[str, float], every: FloatArray) -> Reduced:
    """Return the sums of the parameters left: the first independent columns in their order, as a spec has.

    `every` says how base parameters (SI) grow with all physical ones, in which they are linear, shape (c, p).
    """
    place = {name: index for index, name in enumerate(model.parameters)}
    fixed = sum((value * every[:, place[name]] for name, value in held.items()), np.zeros(len(every)))
    left = _left(model, held)
    A = every[:, [place[name] for name in left]]
    chosen: list[int] = []
    recipe = np.zeros((0, len(left)))
    for index in range(len(left)):
        column = A[:, index]
        size = float(np.linalg.norm(column))
        if size == 0.0:
            continue
        factors = np.linalg.lstsq(A[:, chosen], column, rcond=None)[0] if chosen else np.zeros(0)
        dependent = bool(np.linalg.norm(column - A[:, chosen] @ factors) <= NEGLIGIBLE * size)
        if not dependent:
            chosen.append(index)
            recipe = np.vstack([recipe, np.zeros(len(left))])
            recipe[-1, index] = 1.0
        else:
            recipe[:, index] = np.where(np.abs(factors) > NEGLIGIBLE * np.abs(factors).max(), factors, 0.0)
    names = tuple(_sum_text(left, row) for row in recipe)
    alone = {left[int(np.argmax(row))] for row in recipe if np.count_nonzero(row) == 1}
    inside = {
        name: [names[k] for k in np.flatnonzero(recipe[:, index])]
        for index, name in enumerate(left)
        if name not in alone
    }
    absent = {
        name: f"only in combination: {', '.join(sums)}" if sums else model.absent.get(name, "has no column")
        for name, sums in inside.items()
    }
    identifiable = tuple(name for name in left if name in alone)
    heads = [left[index] for index in chosen]
    rows = {head: k for k, head in enumerate(heads)}

    def base_from_physical(parameters: Mapping[str, Any]) -> Any:
        return recipe @ np.array([parameters[name] for name in left])

    def physical_from_base(base: FloatArray) -> dict[str, float]:
        return {name: float(base[rows[name]]) for name in identifiable}

    more = {"base_from_physical": base_from_physical, "physical_from_base": physical_from_base}
    units = {name: model.units[head] for name, head in zip(names, heads, strict=True)}
    return Reduced(names, units, A[:, chosen], fixed, identifiable, absent, more)


def _reduced(model: Model, held: Mapping[str, float]) -> Reduced:
    """Return the composites that parameters left have a part in."""
    left = _left(model, held)
    slopes = _slopes(model, held, left)
    scale = np.abs(slopes).max(axis=(0, 2))
    kept = np.flatnonzero(scale > 0.0)
    point = {**held, **dict.fromkeys(left, 1.0)}
    fixed = np.where(scale > 0.0, 0.0, model.base_from_physical(point))
    names = tuple(model.base_parameters[k] for k in kept)
    known = [_determined(slope[kept]) for slope in slopes]
    identifiable = tuple(name for index, name in enumerate(left) if all(one[index] for one in known))
    absent = {
        name: model.absent.get(name, "cannot be distinguished from the other parameters by these sensors")
        for name in left
        if name not in identifiable
    }
    evaluate = model.module.base_from_physical

    def base_from_physical(parameters: Mapping[str, Any]) -> Any:
        return evaluate({**held, **parameters})[kept]

    more = {
        "base_from_physical": base_from_physical,
        "COMPOSITES": {name: text for name, text in model.composites.items() if name in names},
    }
    units = {name: model.units[name] for name in names}
    return Reduced(names, units, np.eye(len(scale))[:, kept], fixed, identifiable, absent, more)


def _slopes(model: Model, held: Mapping[str, float], left: list[str]) -> FloatArray:
    """Return relative slopes of the base parameters at two random points, shape (2, columns, left)."""
    rng = np.random.default_rng(SEED)
    place = [model.parameters.index(name) for name in left]
    points = []
    for _ in range(2):
        # of the values known only a zero changes what can be told
        point = dict(
            zip(model.parameters, rng.uniform(1.0, 2.0, len(model.parameters)).tolist(), strict=True)
        )
        points.append({name: 0.0 if held.get(name) == 0.0 else value for name, value in point.items()})
    return np.array([model.base_jacobian(point)[:, place] for point in points])


def _determined(slope: FloatArray) -> list[bool]:
    """Return which parameters have no part in what leaves all base parameters as they are."""
    scaled = slope / (np.linalg.norm(slope, axis=1, keepdims=True) if len(slope) else 1.0)
    _, sizes, directions = np.linalg.svd(scaled)
    rank = int(np.sum(sizes > NEGLIGIBLE * sizes.max(initial=0.0)))
    return [bool(one) for one in np.all(np.abs(directions[rank:]) < 1e-6, axis=0)]


def _sum_text(names: list[str], factors: FloatArray) -> str:
    """Return a sum as modules write it, ``O_m + 0.5*O_c``; factors to six digits."""
    pairs = [(name, factor) for name, factor in zip(names, factors.tolist(), strict=True) if factor]
    return signed_sum((f < 0.0, name if abs(f) == 1.0 else f"{abs(f):.6g}*{name}") for name, f in pairs)


def reduced_module(model: Model, held: Mapping[str, float], reduced: Reduced) -> ModuleType:
    """Return a module like the model's, whose functions see the tables and base parameters that are left."""
    old = vars(model.module)
    measurement, regressor, fixed = old["measurement"], old["regressor"], reduced.fixed
    changed: dict[str, Any] = {
        "PARAMETERS": tuple(_left(model, held)),
        "KNOWN": {**model.known, **held},
        "BASE_PARAMETERS": reduced.names,
        "IDENTIFIABLE": reduced.identifiable,
        "ABSENT": dict(reduced.absent),
        "UNITS": {**model.units, **reduced.units},
        "measurement": lambda signals: measurement(signals) - regressor(signals) @ fixed,
        "regressor": lambda signals: regressor(signals) @ reduced.mixing,
        "columns": _columns(model, reduced),
        MADE_BY: (_known_module, (model, held)),
        **reduced.more,
    }
    module = ModuleType(str(old.get("__name__", model.chain)), old.get("__doc__"))
    vars(module).update({**old, **changed})
    for name, value in old.items():
        if name not in changed and isinstance(value, FunctionType):
            # the same code; the names it refers to are those of the new module
            vars(module)[name] = FunctionType(value.__code__, vars(module), name, value.__defaults__)
    return module


def _known_module(model: Model, held: Mapping[str, float]) -> ModuleType:
    module: ModuleType = with_known(model, held).module
    return module


def _columns(model: Model, reduced: Reduced) -> Callable[[], dict[str, Any]]:
    measurement, regressor = [], []
    for terms, columns in zip(model.measurement_columns, model.regressor_columns, strict=True):
        known = [(-float(reduced.fixed[column]), own) for column, own in columns.items()]
        measurement.append(_summed([(1.0, terms), *known]))
        mixed = {
            new: _summed([(float(reduced.mixing[column, new]), own) for column, own in columns.items()])
            for new in range(len(reduced.names))
        }
        regressor.append({new: terms for new, terms in mixed.items() if terms})
    return lambda: {"measurement": tuple(measurement), "regressor": tuple(regressor)}


def _summed(parts: list[tuple[float, Terms]]) -> Terms:
    """Return terms times factors as one sum, a term for each key; what cancels is left out."""
    total: dict[str, float] = {}
    size: dict[str, float] = {}
    for factor, terms in parts:
        for coefficient, key in terms:
            total[key] = total.get(key, 0.0) + factor * coefficient
            size[key] = max(size.get(key, 0.0), abs(factor * coefficient))
    return tuple((value, key) for key, value in total.items() if abs(value) > 1e-14 * size[key])
