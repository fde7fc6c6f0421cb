"""The value of every parameter of an export: of an estimate, of a set, or given by hand."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

from modelgen.errors import DataError, Problem, listed
from modelgen.keyword_options import check_named_values
from modelgen.magnitudes import REMEDY, is_usable
from modelgen.runtime.exports.sums import Sums
from modelgen.runtime.model.model import Model
from modelgen.runtime.results.estimate import Estimate

FOLLOWS = "follows from the estimate and what is given"


@dataclass(frozen=True)
class Values:
    """Parameters in SI units, known ones included; `origin` says where each is from.

    `std` holds the standard deviations of those estimated, `samples` sets drawn from their covariance, and
    `drawn_again` how many of these were impossible (a negative inertia) and replaced.
    """

    nominal: Mapping[str, float]
    origin: Mapping[str, str]
    std: Mapping[str, float] = field(default_factory=dict)
    samples: tuple[Mapping[str, float], ...] = ()
    drawn_again: int = 0


def export_values(
    model: Model,
    source: Estimate | Mapping[str, float],
    given: Mapping[str, float] | None = None,
    optional: tuple[str, ...] = (),
) -> Values:
    """Return every parameter's value: what is given by hand, what is estimated, and what follows from both.

    Parameters
    ----------
    model : Model
    source : Estimate or mapping of str to float
        An estimate of this model, or values such as a parameter set.
    given : mapping of str to float, optional
        Values that go before those of the source. Where the records determine only a sum of parameters, the
        others follow from the sum and what is given.
    optional : tuple of str
        Roles that the format can do without; parameters without a value are left out.

    Raises
    ------
    DataError
        With one problem for every parameter that has no value, saying why and what to give.
    """
    given = given or {}
    problems = [
        Problem(f"set {name}", "is no parameter of the model", f"choose one of {listed(model.parameters)}")
        for name in given
        if name not in model.parameters and name not in model.known
    ]
    DataError.raise_any(problems)
    nominal = dict(model.known)
    origin = dict.fromkeys(nominal, "known")
    std: dict[str, float] = {}
    if isinstance(source, Estimate):
        _refuse_other(model, source)
        nominal |= source.physical
        origin |= dict.fromkeys(source.physical, "estimate")
        std = {entry.name: entry.std for entry in source.parameters.physical}
    else:
        check_named_values("source", source)
        nominal |= {name: float(value) for name, value in source.items() if name in model.parameters}
        origin |= dict.fromkeys((name for name in source if name in model.parameters), "parameter set")
    nominal |= given
    origin |= dict.fromkeys(given, "given")
    std = {name: value for name, value in std.items() if name not in given}
    if isinstance(source, Estimate) and not source.model.joined:
        following = Sums.of(model, source).following(model, source.base, nominal)
        nominal |= following
        origin |= dict.fromkeys(following, FOLLOWS)
    wanted = [n for n in model.every_parameter if n in nominal or role_of(model, n) not in optional]
    problems = [problem for name in wanted if (problem := _problem(model, source, nominal, name))]
    DataError.raise_any(problems)
    ordered = {name: float(nominal[name]) for name in wanted}
    return Values(ordered, {name: origin[name] for name in wanted}, std)


def _refuse_other(model: Model, estimate: Estimate) -> None:
    if estimate.model.joined and estimate.model.chain == model.chain:
        return  # its parameters are physical ones, whatever the sensors
    if (estimate.model.chain, estimate.model.sensor_set) != (model.chain, model.sensor_set) or len(
        estimate.base
    ) != len(model.base_parameters):
        if estimate.model.as_one_body:
            what = "is of the chain as one body: its springs did not show in the records"
            raise DataError.at("estimate", what, "record a motion that reaches the mode, or give all values")
        what = f"is of {estimate.model}; the model is {model.chain}, sensors {model.sensor_set}"
        raise DataError.at("estimate", what, "give the model that was identified")


def role_of(model: Model, name: str) -> str:
    """Return the role of a parameter; an empty text for one that the model does not describe."""
    return model.roles[name].role if name in model.roles else ""


def _problem(
    model: Model, source: Estimate | Mapping[str, float], nominal: Mapping[str, float], name: str
) -> Problem | None:
    unit = model.units.get(name, "SI")
    if name not in nominal:
        why, remedy = "has no value", f"give it in {unit}: --set {name}=NUMBER"
        if isinstance(source, Estimate):
            reason = source.not_identifiable.get(name) or model.absent.get(name)
            why += f" ({reason})" if reason else ""
            seen = [
                a.where
                for a in source.checks.advice
                if a.kind == "dependent columns" and name in re.findall(r"\w+", a.where)
            ]
            remedy += f"; {listed(seen, most=3, width=200)}" if seen else ""
            sums = [
                f"{base} = {source.params[base]:.6g}"
                for base in source.params
                if name in _names_in(model, base) and len(_names_in(model, base)) > 1
            ]
            if sums:
                remedy += f"; known is {listed(sums, most=3)}, so that what is left over follows"
        return Problem(f"parameters: {name}", why, remedy)
    value, role = nominal[name], role_of(model, name)
    if not is_usable(value):
        return Problem(f"parameters: {name}", f"is {value!r}", f"give a number in {unit}; {REMEDY}")
    if (role == "coulomb" and value < 0.0) or (role == "inertia" and value <= 0.0):
        limit = "positive" if role == "inertia" else "zero or positive"
        remedy = f"it must be {limit}: give --set {name}=NUMBER"
        return Problem(f"parameters: {name}", f"is {value:.6g} {unit}", remedy)
    return None


def _names_in(model: Model, base: str) -> list[str]:
    """Return the parameters that a base parameter is a sum of; nothing for a composite."""
    if base in model.composites:
        return []
    point = {**model.known, **dict.fromkeys(model.parameters, 1.0)}
    row = model.base_jacobian(point)[model.base_parameters.index(base)]
    return [name for name, share in zip(model.parameters, row, strict=True) if share]
