"""What an estimate determines of a chain: values and covariance of its parameters, what it leaves open."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.model.model import Model
from modelgen.runtime.modes.thresholds import FARTHEST, FULLY_OPEN, LOOSE_PART, LOOSE_SHARE, MOST_LOG, Z95
from modelgen.runtime.numerics.decorrelation import square_root
from modelgen.runtime.parameters.composite_fit import fit_composites
from modelgen.runtime.parameters.rounded import with_interval
from modelgen.runtime.parameters.thresholds import RANK_TOLERANCE


@dataclass(frozen=True, eq=False)
class UncertainChain:
    """Physical parameters in the order of `names`, as far as the base parameters say what they are.

    Attributes
    ----------
    names : tuple of str
    values : array, shape (names,)
        One choice that gives the base parameters found, in SI units.
    root : array, shape (names, m)
        root root^T is their covariance: what the base parameters pass on to them.
    open : array, shape (names, k)
        Directions, in shares of the values, that change no base parameter that was found.
    open_but_damping : array, shape (names, m)
        The same, were all frictions and dampings known.
    loose : array, shape (names, m), optional
        The part of `root` along directions that are too uncertain for what is linear at the values.
    """

    names: tuple[str, ...]
    values: FloatArray
    root: FloatArray
    open: FloatArray
    open_but_damping: FloatArray
    loose: FloatArray | None = None

    @property
    def by_name(self) -> dict[str, float]:
        """The values by name."""
        return dict(zip(self.names, self.values.tolist(), strict=True))

    @property
    def too_uncertain(self) -> tuple[str, ...]:
        """Names of the parameters that have a part in `loose`."""
        if self.loose is None:
            return ()
        lost = np.linalg.norm(self.loose, axis=1) > LOOSE_PART * LOOSE_SHARE * np.abs(self.values)
        return tuple(name for name, one in zip(self.names, lost, strict=True) if one)

    @property
    def cautious_root(self) -> FloatArray:
        """`root` with what is too uncertain reaching as far as the intervals of reciprocals, same shape.

        The deviation of a composite that is hardly known grows with it, nearly as its square: that stated at
        too small an estimate is too small, and the reciprocal is nearer to normal than the number (the
        interval of a ratio with an uncertain divisor, Fieller 1954).
        """
        if self.loose is None or not self.loose.any():
            return self.root
        size = np.where(self.values == 0.0, 1.0, np.abs(self.values))[:, None]
        U, s, Vt = np.linalg.svd(self.loose / size, full_matrices=False)
        reach = Z95 * np.abs(U).max(axis=0) * s
        far = reach > Z95 * LOOSE_PART * LOOSE_SHARE
        wider = np.zeros_like(s)
        ends = -np.log(np.maximum(1.0 - reach[far], 1.0 / FARTHEST))
        wider[far] = np.maximum(ends / reach[far], 1.0) - 1.0
        return np.asarray(self.root + size * (U * (s * wider) @ Vt))

    def moved(self, by: FloatArray, inertias: frozenset[str]) -> dict[str, float]:
        """Return the values moved; inertias by their logarithms, so that none falls below zero.

        `by` in SI, shape (parameters,).
        """
        found = self.values + by
        for i, name in enumerate(self.names):
            if name in inertias:
                found[i] = self.values[i] * np.exp(np.clip(by[i] / self.values[i], -MOST_LOG, MOST_LOG))
        return dict(zip(self.names, found.tolist(), strict=True))


def uncertain_chain(
    model: Model, base: FloatArray, covariance: FloatArray, start: Mapping[str, float]
) -> UncertainChain:
    """Return what base parameters say of the physical ones.

    Parameters
    ----------
    model : Model
    base : array, shape (columns,)
        All base parameters of the model in SI, NaN where the records say nothing.
    covariance : array, shape (found, found)
        Of those with a number.
    start : mapping of str to float
        Physical parameters near which to look; others start from the model's own sets, or from one.
    """
    given = {name: value for values in model.parameter_sets.values() for name, value in values.items()}
    first = {name: start.get(name) or given.get(name) or 1.0 for name in model.parameters}
    found = np.flatnonzero(np.isfinite(base))
    weights = np.where(base[found] == 0.0, 1.0, base[found] ** 2)
    solved = fit_composites(model, base, np.diag(weights), first)
    values = dict(solved.values)
    # friction and damping that nothing is known of have no part in the fit
    for name, row in zip(model.parameters, open_directions(model, base, values), strict=True):
        if name in dissipative(model) and np.linalg.norm(row) > FULLY_OPEN:
            values[name] = 0.0
    gradients = np.array([solved.gradients[name] for name in model.parameters])
    return chain_around(model, base, values, gradients @ square_root(covariance))


def chain_around(
    model: Model, base: FloatArray, values: Mapping[str, float], root: FloatArray
) -> UncertainChain:
    """Return the chain of these values (SI), with what the base parameters leave open there.

    `base` has shape (base parameters,); `root` times its transpose is the covariance of the values, shape
    (parameters, k).
    """
    sizes = np.array([values[name] for name in model.parameters])
    return UncertainChain(
        model.parameters,
        sizes,
        root,
        open_directions(model, base, values),
        open_directions(model, base, values, dissipative(model)),
        loose_part(sizes, root) if model.composites else None,
    )


def without_inertia(model: Model, chain: UncertainChain) -> str:
    """Return in words which bodies come out without an inertia above zero, empty if none does."""
    told = []
    for name, value, row in zip(chain.names, chain.values.tolist(), chain.root, strict=True):
        if value > 0.0 or name not in model.roles or model.roles[name].role != "inertia":
            continue
        reach, unit = Z95 * float(np.linalg.norm(row)), model.units.get(name, "")
        how = "is zero within its interval" if value + reach > 0.0 else "comes out below zero"
        size = with_interval(value, value - reach, value + reach) if reach else f"{value:.4g}"
        told.append(f"{name} {how} ({size} {unit})")
    return f"{', '.join(told)}, and no body is without inertia" if told else ""


def loose_part(values: FloatArray, root: FloatArray) -> FloatArray:
    """Return the part of a root along directions whose deviation is a large share of the values, same shape.

    Parameters that are zero have no share.
    """
    size = np.where(values == 0.0, np.inf, np.abs(values))[:, None]
    U, s, Vt = np.linalg.svd(np.where(np.isfinite(size), root / size, 0.0), full_matrices=False)
    far = s > LOOSE_SHARE
    part = U[:, far] * s[far] @ Vt[far]
    return np.asarray(np.where(np.isfinite(size), part * np.abs(values)[:, None], 0.0))


def dissipative(model: Model) -> frozenset[str]:
    """Return the frictions and dampings among the parameters."""
    return frozenset(name for name, role in model.roles.items() if role.role in ("viscous", "damping"))


def open_directions(
    model: Model, base: FloatArray, values: Mapping[str, float], known: Collection[str] = ()
) -> FloatArray:
    """Return directions in shares of the parameters' sizes that change no base parameter, (parameters, k).

    `base` holds these, shape (columns,), NaN where not identified. What is `known` does not take part.
    """
    found = np.flatnonzero(np.isfinite(base))
    size = np.abs([values[name] or 1.0 for name in model.parameters])
    slope = model.base_jacobian(values)[found] * size
    slope /= np.maximum(np.linalg.norm(slope, axis=1), np.finfo(float).tiny)[:, None]
    free = [i for i, name in enumerate(model.parameters) if name not in known]
    _, s, Vt = np.linalg.svd(slope[:, free], full_matrices=True)
    rank = int(np.sum(s > RANK_TOLERANCE * s.max(initial=1e-300)))
    directions = np.zeros((len(model.parameters), len(free) - rank))
    directions[free] = Vt[rank:].T
    return directions
