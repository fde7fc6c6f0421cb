"""JointEstimate: the answer of several sensor sets together, those of each one, and whether they agree."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import listed
from modelgen.runtime.advice import Advice
from modelgen.runtime.joining.sensor_set_part import SensorSetPart
from modelgen.runtime.model.model import Model
from modelgen.runtime.modes.chain_of_fit import modes_of_fit
from modelgen.runtime.modes.uncertain_chain import UncertainChain, chain_around, uncertain_chain
from modelgen.runtime.numerics.decorrelation import square_root
from modelgen.runtime.numerics.tails import chi_square_tail
from modelgen.runtime.parameters.composite_fit import PhysicalSolution
from modelgen.runtime.parameters.parameter import Parameter
from modelgen.runtime.parameters.physical_parameters import Covariances
from modelgen.runtime.parameters.pruning import Pruning
from modelgen.runtime.parameters.thresholds import NULL_SHARE, RANK_TOLERANCE
from modelgen.runtime.results.checks import Checks
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.results.estimate_parts import EstimatedFit, EstimatedParameters

TITLE = "{title}; sensor sets joined by generalised least squares"


@dataclass(frozen=True)
class Agreement:
    """Whether sensor sets differ by more than their covariances explain: a chi square, and its probability.

    `factor` is what the intervals are wider by, 1 where the sets agree.
    """

    statistic: float
    degrees_of_freedom: int
    p_value: float
    factor: float

    @classmethod
    def of(cls, solution: PhysicalSolution, covariance: FloatArray) -> Agreement | None:
        """Return the test of what a fit leaves, or None; the covariance, in SI, is (numbers, numbers)."""
        statistic, spare = solution.left_over(covariance)
        if not spare:
            return None
        p_value = chi_square_tail(statistic, spare)
        return cls(statistic, spare, p_value, solution.contradiction(covariance))

    @property
    def sentence(self) -> str:
        """The test in words."""
        verb = "agree" if self.factor == 1.0 else "contradict each other"
        return (
            f"The sensor sets {verb}: chi square {self.statistic:.3g}, {self.degrees_of_freedom} degrees of "
            f"freedom, p = {self.p_value:.2g}."
        )


@dataclass(frozen=True, eq=False)
class JointEstimate:
    """What `identify_jointly` finds.

    Attributes
    ----------
    estimate : Estimate
        The one answer; its parameters are physical ones, and sums that stay open. It is saved, exported,
        compared and followed over time as any other; it keeps no records for plots.
    parts : mapping of str to Estimate
        What each sensor set says alone.
    failed : mapping of str to str
        Sensor sets whose records alone answer nothing, with the reason.
    agreement : Agreement or None
        None where no two sets see the same.
    """

    estimate: Estimate
    parts: Mapping[str, Estimate]
    failed: Mapping[str, str]
    agreement: Agreement | None

    def summary(self) -> str:
        """Return everything as plain text: the answer of all, then that of each set."""
        alone = [f"Sensors {title} alone\n\n{one.summary()}" for title, one in self.parts.items()]
        return "\n".join([self.estimate.summary(), *alone])

    def __str__(self) -> str:
        return str(self.estimate)


@dataclass(frozen=True, eq=False)
class Joined:
    """Estimates of sensor sets and the fit of the physical parameters to all of them."""

    models: Mapping[str, Model]
    parts: Mapping[str, SensorSetPart]
    estimates: Mapping[str, Estimate]
    chain: Model
    solution: PhysicalSolution
    covariances: Covariances
    agreement: Agreement | None
    parameters: tuple[Parameter, ...]
    doubtful: Mapping[str, str]

    @property
    def factor(self) -> float:
        """What the intervals are wider by."""
        return 1.0 if self.agreement is None else self.agreement.factor

    @property
    def gradients(self) -> FloatArray:
        """Slopes of all physical parameters by the numbers of the parts, in SI, (parameters, numbers)."""
        return np.array([self.solution.gradients[name] for name in self.chain.parameters])


def assembled(joined: Joined, failed: Mapping[str, str]) -> Estimate:
    """Return the one estimate of all sensor sets; `failed` ones have no part in it and are named."""
    estimates, known = list(joined.estimates.values()), {one.name for one in joined.parameters}
    sums, slopes = _open_sums(joined)
    rows = [joined.gradients[joined.chain.parameters.index(one.name)] for one in joined.parameters]
    H = np.array([*rows, *slopes]).reshape(-1, len(joined.chain.base_parameters))
    every = (*joined.parameters, *sums)
    covariances = _covariances(joined, H)
    chain = chain_around(
        joined.chain,
        np.ones(len(joined.chain.base_parameters)),
        joined.solution.values,
        joined.factor * joined.gradients @ square_root(joined.covariances.total),
    )
    base = np.array([one.value for one in every])

    def again(values: Mapping[str, float]) -> UncertainChain:
        numbers = joined.chain.base_from_physical(joined.solution.values)
        return uncertain_chain(joined.chain, numbers, joined.covariances.total, values)

    first = estimates[0]
    return Estimate(
        replace(
            first.model,
            sensor_set=" + ".join(joined.models),
            composites={},
            unseen=_unseen(joined),
            joined=tuple(joined.models),
        ),
        _records(joined.estimates),
        _fit(joined, every),
        covariances,
        EstimatedParameters(every, joined.parameters, base, {}, _refused(joined, known)),
        Checks(
            _advice(joined, failed),
            tuple(test for one in estimates for test in one.checks.residuals),
            tuple(entry for one in estimates for entry in one.checks.signals),
            kept=first.checks.kept,
        ),
        modes_of_fit(joined.chain, (chain, again)),
        contents=tuple(text for one in estimates for text in one.contents),
    )


def _records(estimates: Mapping[str, Estimate]) -> tuple[str, ...]:
    """Return the names of the records; those of two sets that are alike by their sets, too."""
    names = [name for one in estimates.values() for name in one.records]
    return tuple(
        name if names.count(name) == 1 else f"{title}: {name}"
        for title, one in estimates.items()
        for name in one.records
    )


def _open_sums(joined: Joined) -> tuple[list[Parameter], list[FloatArray]]:
    """Return sums of parameters that a set sees and that stay sums, and their slopes by all numbers."""
    known = {one.name for one in joined.parameters}
    found: dict[str, tuple[Parameter, FloatArray]] = {}
    values = joined.solution.values
    for title, part in joined.parts.items():
        if joined.models[title].composites:
            continue
        slope = part.slope(values)
        for name, value, row in zip(part.names, part.evaluate(values), slope, strict=True):
            inside = {p for p, size in zip(joined.chain.parameters, row, strict=True) if size}
            if inside <= known or name in found or inside & joined.doubtful.keys():
                continue
            gradient = row @ joined.gradients
            total, noise, drift, printed = joined.covariances.standard_deviations(gradient)
            wider = float(np.sqrt(drift**2 + (joined.factor**2 - 1.0) * total**2))
            spreads = (joined.factor * total, noise, wider, printed)
            unit = joined.models[title].units.get(name, "")
            found[name] = Parameter(name, unit, float(value), *spreads), gradient
    return [one for one, _ in found.values()], [gradient for _, gradient in found.values()]


def _covariances(joined: Joined, H: FloatArray) -> Covariances:
    """Return the covariances of the answer; what sets contradict each other by counts as drift."""
    each = joined.covariances
    total, noise, drift, printed = (
        H @ matrix @ H.T for matrix in (each.total, each.noise, each.drift, each.printed)
    )
    wider = (joined.factor**2 - 1.0) * total
    return Covariances(total + wider, noise, drift + wider, printed)


def _fit(joined: Joined, every: tuple[Parameter, ...]) -> EstimatedFit:
    fits = {title: one.fit for title, one in joined.estimates.items()}
    first = next(iter(fits.values()))
    norm = float(np.linalg.norm([one.error_norm for one in fits.values()]))
    used = sum(one.nobs for one in joined.estimates.values())
    agreement = () if joined.agreement is None else (joined.agreement.sentence,)
    return EstimatedFit(
        method=first.method,
        method_title=TITLE.format(title=first.method_title),
        covariance_kind=first.covariance_kind,
        filtering=replace(
            first.filtering,
            decimation=tuple(factor for one in fits.values() for factor in one.filtering.decimation),
            bands=tuple(band for one in fits.values() for band in one.filtering.bands),
            sentences=tuple(f"{t}: {text}" for t, one in fits.items() for text in one.filtering.sentences),
            notes=tuple(f"{t}: {text}" for t, one in fits.items() for text in one.filtering.notes),
        ),
        rows=tuple(row for one in fits.values() for row in one.rows),
        residuals=None,
        condition_number=max(one.condition_number for one in fits.values()),
        condition_number_raw=max(one.condition_number_raw for one in fits.values()),
        relative_error=max(one.relative_error for one in fits.values()),
        error_norm=norm,
        sigma=norm / float(np.sqrt(max(used - len(every), 1))),
        residual_dof=first.residual_dof,
        pruning=Pruning(
            first.pruning.percent,
            max(one.relative_error for one in fits.values()),
            (),
            tuple((one.name, one.value, one.relative_std) for one in every),
        ),
        delays={f"{t}: {key}": value for t, one in fits.items() for key, value in one.delays.items()},
        delay_std={f"{t}: {key}": value for t, one in fits.items() for key, value in one.delay_std.items()},
        notes=(*agreement, *(f"{t}: {text}" for t, one in fits.items() for text in one.notes)),
    )


def _refused(joined: Joined, known: set[str]) -> dict[str, str]:
    """Return why parameters have no number: what each set that could determine it says."""
    found: dict[str, str] = {}
    for name in joined.chain.parameters:
        if name in known:
            continue
        reasons = {
            t: e.not_identifiable[name] for t, e in joined.estimates.items() if name in e.not_identifiable
        }
        told = listed([f"{title}: {why}" for title, why in reasons.items()], most=3)
        open_still = f"no sensor set determines it, nor do all together ({told})" if told else "stays open"
        found[name] = joined.doubtful.get(name, open_still)
    return found


def _unseen(joined: Joined) -> tuple[str, ...]:
    """Return the parameters that these sensors could not determine even with ideal records."""
    values = joined.solution.values
    slopes = np.concatenate([model.base_jacobian(values) for model in joined.models.values()])
    size = np.array([abs(values[name]) or 1.0 for name in joined.chain.parameters])
    slopes = slopes * size
    slopes /= np.maximum(np.linalg.norm(slopes, axis=1, keepdims=True), np.finfo(float).tiny)
    _, sizes, directions = np.linalg.svd(slopes)
    rank = int(np.sum(sizes > RANK_TOLERANCE * sizes.max()))
    lost = np.abs(directions[rank:]).max(axis=0, initial=0.0) > NULL_SHARE
    return tuple(name for name, one in zip(joined.chain.parameters, lost, strict=True) if one)


def _advice(joined: Joined, failed: Mapping[str, str]) -> tuple[Advice, ...]:
    """Return what is to be known: that sets disagree, that one says nothing, and the advice of each."""
    found = []
    if joined.agreement is not None and joined.factor > 1.0:
        misses = joined.chain.base_from_physical(joined.solution.values) - _values(joined)
        std = np.sqrt(np.diag(joined.covariances.total))
        worst = int(np.argmax(np.abs(misses) / np.where(std > 0.0, std, np.inf)))
        found.append(
            Advice(
                "sensor sets disagree",
                joined.chain.base_parameters[worst],
                "is farthest from what the other sets say (chi square "
                f"{joined.agreement.statistic:.3g}, p = {joined.agreement.p_value:.2g}); the intervals are "
                f"{joined.factor:.2g} times as wide",
                "look at each set alone (--details): a unit, a delay or a sign of one is wrong, or the chain "
                "changed between the records",
            )
        )
    found += [
        Advice("not checked", f"sensors {title}", f"have no part in the answer: {why}", "identify them alone")
        for title, why in failed.items()
    ]
    for title, one in joined.estimates.items():
        # what one set cannot determine alone another one may
        own = [advice for advice in one.checks.advice if advice.kind != "dependent columns"]
        found += [replace(advice, where=f"{title}: {advice.where}") for advice in own]
    return tuple(found)


def _values(joined: Joined) -> FloatArray:
    return np.concatenate([part.values for part in joined.parts.values()])
