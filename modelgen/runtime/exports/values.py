"""The value of every parameter of an export: of an estimate, a set or by hand; samples of an estimate."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, Problem, listed
from modelgen.magnitudes import REMEDY, is_usable
from modelgen.runtime.model.model import Model
from modelgen.runtime.results.estimate import Estimate

LINEAR = 1e-12  # how little a gradient may differ between two points of a linear function
DETERMINED = 1e-9  # share of a singular value below which nothing is determined
MOST_SAMPLES = 10_000
MOST_DRAWS = 100  # times the number of samples
NON_NEGATIVE = ("inertia", "viscous", "coulomb", "damping", "stiffness")


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
    if problems:
        raise DataError(*problems)
    nominal = dict(model.known)
    origin = dict.fromkeys(nominal, "known")
    std: dict[str, float] = {}
    if isinstance(source, Estimate):
        _refuse_other(model, source)
        nominal |= source.physical
        origin |= dict.fromkeys(source.physical, "estimate")
        std = {entry.name: entry.std for entry in source.parameters.physical}
    else:
        nominal |= {name: float(value) for name, value in source.items() if name in model.parameters}
        origin |= dict.fromkeys((name for name in source if name in model.parameters), "parameter set")
    nominal |= given
    origin |= dict.fromkeys(given, "given")
    std = {name: value for name, value in std.items() if name not in given}
    if isinstance(source, Estimate):
        following = _following(model, source, nominal)
        nominal |= following
        origin |= dict.fromkeys(following, "follows from the estimate and what is given")
    wanted = [n for n in (*model.parameters, *model.known) if n in nominal or _role(model, n) not in optional]
    problems = [problem for name in wanted if (problem := _problem(model, source, nominal, name))]
    if problems:
        raise DataError(*problems)
    ordered = {name: float(nominal[name]) for name in wanted}
    return Values(ordered, {name: origin[name] for name in wanted}, std)


def _refuse_other(model: Model, estimate: Estimate) -> None:
    if (estimate.model.chain, estimate.model.sensor_set) != (model.chain, model.sensor_set) or len(
        estimate.base
    ) != len(model.base_parameters):
        what = f"is of {estimate.model}; the model is {model.chain}, sensors {model.sensor_set}"
        raise DataError.at("estimate", what, "give the model that was identified")


def _role(model: Model, name: str) -> str:
    return model.roles[name].role if name in model.roles else ""


def _linear_rows(model: Model, estimate: Estimate) -> tuple[FloatArray, FloatArray]:
    """Return coefficients and values of the identified base parameters that are sums of physical ones."""
    rng = np.random.default_rng(0)
    points = [{**model.known, **{name: rng.uniform(0.5, 2.0) for name in model.parameters}} for _ in range(2)]
    here, there = (model.base_jacobian(point) for point in points)
    constant = model.base_from_physical(points[0]) - here @ [points[0][name] for name in model.parameters]
    rows = np.isfinite(estimate.base) & np.all(np.abs(here - there) <= LINEAR * np.abs(here), axis=1)
    return here[rows], (estimate.base - constant)[rows]


def _following(model: Model, estimate: Estimate, nominal: Mapping[str, float]) -> dict[str, float]:
    """Return the parameters without a value that sums of the estimate determine, the others being known."""
    unknown = [name for name in model.parameters if name not in nominal]
    if not unknown:
        return {}
    rows, values = _linear_rows(model, estimate)
    columns = {name: rows[:, i] for i, name in enumerate(model.parameters)}
    rest = values - sum((columns[n] * nominal[n] for n in columns if n in nominal), np.zeros(len(values)))
    open_rows = np.column_stack([columns[name] for name in unknown])
    used = np.any(open_rows != 0.0, axis=1)
    if not used.any():
        return {}
    size = np.abs(open_rows[used]).max(axis=0)
    size[size == 0.0] = 1.0
    scale = np.abs(open_rows[used]).max(axis=1, keepdims=True)
    matrix = open_rows[used] / scale / size
    left, sizes, right = np.linalg.svd(matrix)
    rank = int(np.sum(sizes > DETERMINED * sizes[0]))
    found = right[:rank].T @ ((left.T @ (rest[used] / scale[:, 0]))[:rank] / sizes[:rank])
    free = np.abs(right[rank:]).max(axis=0, initial=0.0) > DETERMINED
    return {n: float(v) for n, v, f in zip(unknown, found / size, free, strict=True) if not f}


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
                if a.kind == "dependent columns" and _is_in(name, a.where)
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
    value, role = nominal[name], _role(model, name)
    if not is_usable(value):
        return Problem(f"parameters: {name}", f"is {value!r}", f"give a number in {unit}; {REMEDY}")
    if (role == "coulomb" and value < 0.0) or (role == "inertia" and value <= 0.0):
        limit = "positive" if role == "inertia" else "zero or positive"
        remedy = f"it must be {limit}: give --set {name}=NUMBER"
        return Problem(f"parameters: {name}", f"is {value:.6g} {unit}", remedy)
    return None


def _is_in(name: str, text: str) -> bool:
    return name in re.findall(r"\w+", text)


def _names_in(model: Model, base: str) -> list[str]:
    """Return the parameters that a base parameter is a sum of; nothing for a composite."""
    if base in model.composites:
        return []
    point = {**model.known, **dict.fromkeys(model.parameters, 1.0)}
    row = model.base_jacobian(point)[model.base_parameters.index(base)]
    return [name for name, share in zip(model.parameters, row, strict=True) if share]


def with_samples(model: Model, values: Values, estimate: Estimate, count: int, seed: int) -> Values:
    """Return the values with samples of the estimated parameters, normal with the estimate's covariance.

    A sample with a negative inertia, stiffness, damping or friction is impossible and is drawn again; of
    stiffness, damping and friction only where the estimate itself is not negative.

    Raises
    ------
    DataError
        When the numbers make no sense, or hardly any sample is possible.
    """
    if not 0 < count <= MOST_SAMPLES:
        raise DataError.at("samples", f"is {count}", f"give 1 to {MOST_SAMPLES}")
    if seed < 0:
        raise DataError.at("seed", f"is {seed}", "give a whole number, 0 or more")
    names = [name for name in values.nominal if values.origin[name] == "estimate"]
    spread = np.array([values.std[name] for name in names])
    if not np.isfinite(spread).all():
        raise DataError.at("samples", "need standard deviations, which the estimate lacks", "identify again")
    bounded = [i for i, n in enumerate(names) if _role(model, n) in NON_NEGATIVE and values.nominal[n] >= 0.0]
    solid = [i for i, name in enumerate(names) if _role(model, name) == "inertia"]
    rng = np.random.default_rng(seed)
    sizes, shapes = np.linalg.eigh(_correlation(model, values, estimate, names))
    root = spread[:, None] * shapes * np.sqrt(np.maximum(sizes, 0.0))
    center = np.array([values.nominal[name] for name in names])
    kept: list[Mapping[str, float]] = []
    draws = 0
    while len(kept) < count:
        if draws >= MOST_DRAWS * count:
            worst = min(bounded, key=lambda i: center[i] / max(spread[i], 1e-300))
            what = f"of {draws} samples {len(kept)} are possible: {names[worst]} is uncertain by its own size"
            raise DataError.at("samples", what, f"identify it better, or give --set {names[worst]}=NUMBER")
        drawn = center + root @ rng.standard_normal(len(names))
        draws += 1
        if np.all(drawn[bounded] >= 0.0) and np.all(drawn[solid] > 0.0):
            kept.append({**values.nominal, **dict(zip(names, drawn.tolist(), strict=True))})
    return Values(values.nominal, values.origin, values.std, tuple(kept), draws - count)


def _correlation(model: Model, values: Values, estimate: Estimate, names: list[str]) -> FloatArray:
    """Return the correlations of physical parameters that those of the base parameters lead to.

    To first order, by the inverse of the model's Jacobian.
    """
    full = {**dict.fromkeys(model.parameters, 1.0), **values.nominal}
    rows = [model.base_parameters.index(name) for name in estimate.params]
    size = np.array([abs(full[name]) or 1.0 for name in model.parameters])
    deviations = np.sqrt(np.diag(estimate.cov_params()))
    deviations[deviations == 0.0] = 1.0
    slopes = model.base_jacobian(full)[rows] * size / deviations[:, None]
    inverse = np.linalg.pinv(slopes, rcond=DETERMINED)
    physical = inverse @ (estimate.cov_params() / np.outer(deviations, deviations)) @ inverse.T
    places = [model.parameters.index(name) for name in names]
    found = physical[np.ix_(places, places)]
    root = np.sqrt(np.diag(found))
    root[root == 0.0] = 1.0
    return np.asarray(found / np.outer(root, root))
