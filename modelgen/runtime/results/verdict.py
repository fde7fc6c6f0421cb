"""One word on an estimate (trust, check, measure again), why, and the one thing to do next.

The word is that of the first finding in an order in which causes stand before what follows from them: data
that are wrong, an experiment that cannot answer, parameters without a number, a model that lacks something,
wide intervals. Nothing found means trust.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from modelgen.errors import listed
from modelgen.runtime.diagnostics.parameter_checks import REMEDIES
from modelgen.runtime.parameters.dependence import INSEPARABLE
from modelgen.runtime.parameters.grouped_reasons import DEPENDS
from modelgen.runtime.parameters.parameter import may_be_zero
from modelgen.runtime.results.thresholds import EXPLAINED, WIDE_PERCENT

if TYPE_CHECKING:
    from modelgen.runtime.advice import Advice
    from modelgen.runtime.results.estimate import Estimate

TRUST, CHECK, AGAIN = "trust", "check", "measure again"
# kinds of advice by what they say of the numbers, causes before consequences
DATA = {
    "unit": CHECK,
    "swapped": CHECK,
    "leap": CHECK,
    "constant": AGAIN,
    "copied": AGAIN,
    "clipped": AGAIN,
    "stuck": AGAIN,
    "coarse": AGAIN,
}
EXPERIMENT = {
    "never moving": AGAIN,
    "null solution": AGAIN,
    "never reversing": AGAIN,
    "too short": AGAIN,
    "noisy derivative": AGAIN,
}
MODEL = {
    "negative": CHECK,
    "bounds": CHECK,
    "kept on request": CHECK,
    "more than the model": CHECK,
    "unexplained": CHECK,
    "dependent columns": CHECK,
    "too slow": CHECK,
    "too small": CHECK,
    "decimation band above the filter band": CHECK,
    "biased by noise": CHECK,
    "held-out records disagree": CHECK,
    "periods differ": CHECK,
    "more than noise": CHECK,
    "not checked": CHECK,
    "sensor sets disagree": CHECK,
}
KINDS: Mapping[str, str] = {**DATA, **EXPERIMENT, **MODEL}
# A parameter that is known to be none: nothing speaks against the estimate.
NEGLIGIBLE = "negligible"
FIRST, SECOND, REFUSED, LATER, LAST = range(5)

# what a reason for having no number begins with or holds, and what to do about it
UNRELATED, ZEROS = (
    "zeros are unrelated",
    "begin every record with the links at rest, and set the encoders to zero",
)
TOGETHER = "cannot be distinguished"
APART = "give one of them as known, sense more (modelgen show --sensors all), or move differently"
OTHERWISE = "record another motion, or sense more (modelgen show --sensors all)"
RESIDUAL = "compare with the default method, which tests what it leaves"


@dataclass(frozen=True)
class Verdict:
    """A word ("trust", "check" or "measure again"), why, first things first, and what to do next.

    `action` is empty where there is nothing to do.
    """

    word: str
    reasons: tuple[str, ...]
    action: str = ""


@dataclass(frozen=True)
class _Finding:
    rank: int
    word: str
    why: str
    action: str


def verdict(estimate: Estimate) -> Verdict:
    """Return what is to be thought of an estimate, from what it holds itself."""
    found = sorted(_findings(estimate), key=lambda one: one.rank)
    if not found:
        widest = f"no interval is wider than {2 * WIDE_PERCENT:.0f} % of the value either way"
        if none := _negligible(estimate):
            widest += f", but for what is negligible ({listed(none, most=6)})"
        why = f"the residual is no more than noise, {widest}"
        return Verdict(TRUST, (why,))
    return Verdict(found[0].word, tuple(one.why for one in found), found[0].action)


def _findings(estimate: Estimate) -> Iterator[_Finding]:
    for advice in estimate.checks.advice:
        if advice.kind == NEGLIGIBLE:
            continue
        rank = FIRST if advice.kind in DATA else SECOND if advice.kind in EXPERIMENT else LATER
        word = KINDS.get(advice.kind, CHECK)
        yield _Finding(rank, word, f"{advice.kind}: {advice.where} {advice.what}", advice.remedy)
    yield from _refused(estimate)
    yield from _untested(estimate)
    yield from _wide(estimate)


def refused_by_records(estimate: Estimate) -> dict[str, str]:
    """Return what the sensors could answer and the records did not, with the reason."""
    unseen = estimate.model.unseen
    return {name: why for name, why in estimate.unanswered.items() if name not in unseen}


def _refused(estimate: Estimate) -> Iterator[_Finding]:
    refused = refused_by_records(estimate)
    roots = {name: why for name, why in refused.items() if not why.startswith(DEPENDS)} or refused
    for name, why in list(roots.items())[:1]:
        others = f" (and {listed(list(roots)[1:], most=6)})" if len(roots) > 1 else ""
        action = _action(name, why, estimate)
        yield _Finding(REFUSED, AGAIN, f"no number for {name}{others}: {why}", action)


def _action(name: str, why: str, estimate: Estimate) -> str:
    """Return what gives a refused parameter a number: what a warning on it says, or what its role needs."""
    for advice in estimate.checks.advice:
        if _names(name, advice):
            return advice.remedy
    if UNRELATED in why:
        return ZEROS
    if why.startswith(TOGETHER) or INSEPARABLE in why:
        return APART
    return REMEDIES.get(estimate.model.roles.get(name, ""), OTHERWISE)


def _names(name: str, advice: Advice) -> bool:
    return re.search(rf"(?<!\w){re.escape(name)}(?!\w)", f"{advice.where} {advice.what}") is not None


def _untested(estimate: Estimate) -> Iterator[_Finding]:
    """Yield what speaks against intervals that nothing has tested, or that contradict each other."""
    tests, fit = estimate.checks.residuals, estimate.fit
    if fit.covariance_kind != "hac":
        why = "the intervals are the paper's, eq. (11), and hold for white residuals only"
        yield _Finding(LATER, CHECK, why, RESIDUAL)
    elif not tests:
        yield _Finding(LATER, CHECK, "the residual was not tested", RESIDUAL)
    elif fit.relative_error > EXPLAINED and all(
        test.whiteness is None and test.correlation is None for test in tests
    ):
        why = "the records are too short to test the residual"
        yield _Finding(LATER, CHECK, why, "record for longer")
    for note in fit.notes:
        if note.startswith(("model error", "the composites contradict")):
            yield _Finding(LATER, CHECK, note, "add what is missing to the spec, or sense more")
    if estimate.parameters.other_solutions:
        why = "other values of the physical parameters fit as well"
        yield _Finding(LATER, CHECK, why, "sense more (modelgen show --sensors all)")


def _negligible(estimate: Estimate) -> list[str]:
    return [advice.where for advice in estimate.checks.advice if advice.kind == NEGLIGIBLE]


def _wide(estimate: Estimate) -> Iterator[_Finding]:
    """Yield the parameter with the widest interval: more than noise may be told from, but not how much."""
    roles, physical, negligible = estimate.model.roles, estimate.parameters.physical, _negligible(estimate)
    entries = [
        entry
        for entry in (*estimate.parameters.identified, *physical)
        # a composite is not what was asked for where physical parameters are
        if (role := roles.get(entry.name, "" if physical else "composite"))
        and not may_be_zero(entry.name, role)
        and entry.name not in negligible
        and not entry.relative_std <= WIDE_PERCENT
    ]
    if entries:
        widest = max(entries, key=lambda entry: entry.relative_std)
        names = [entry.name for entry in entries if entry.name != widest.name]
        others = f" (and {listed(dict.fromkeys(names), most=6)})" if names else ""
        half = 1.96 * widest.relative_std
        why = (
            f"{widest.name}{others} is known to +-{half:.0f} % only"
            if half < 1e4
            else f"{widest.name} is open"
        )
        yield _Finding(LAST, CHECK, why, REMEDIES.get(roles.get(widest.name, ""), OTHERWISE))
