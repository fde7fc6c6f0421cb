"""The search for what a model lacks: one effect after the other is estimated, what explains most first."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, IdentifiabilityError
from modelgen.runtime.advice import Advice
from modelgen.runtime.identification.explanation.look_at_residual import (
    Seen,
    believable,
    likely_of,
    look,
    moves_of_forms,
    varied,
)
from modelgen.runtime.identification.explanation.what_is_left import Equal, leaves_noise, left_of_each
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.thresholds import (
    AS_SURE,
    HALF_SAMPLE,
    INEXACT,
    LEAST_CLOCK_DRIFT,
    LEAST_SIZE,
    LITTLE_LEFT,
    MOST_EFFECTS,
    MOST_TRIED,
    RIPPLE_ALONE,
    ROUGH,
    SEARCH_STEPS,
    TRIED_TOO,
)
from modelgen.runtime.iv.effect import AT_REVERSALS, LATE, RIPPLE, Effect
from modelgen.runtime.iv.freed_effects import Freed
from modelgen.runtime.iv.score_tests import Score
from modelgen.runtime.iv.shapes.shaped_effects import fit_in_shape
from modelgen.runtime.iv.thresholds import AS_LIKELY, EFFECT_ROUNDS, LEVEL, LITTLE_OWN
from modelgen.runtime.iv.told_effects import below_noise, left_of
from modelgen.runtime.numerics.tails import normal_beyond


@dataclass(frozen=True, eq=False)
class Search:
    """Where a search stands.

    Attributes
    ----------
    job : Job
    slope : array, shape (c, p), optional
        How X grows with the parameters that were fitted in its place.
    now : Freed
        The fit with `effects` estimated.
    given : int
        So many effects more than `MOST_EFFECTS` may be estimated: those that it began with.
    ties : mapping of str to tuple of Equal
        What stood equal to an effect when it was taken, by the effect's name.
    drift : array, shape (c, c)
        Mean square of what is not estimated, or not exactly.
    changes : mapping of str to array, shape (c,)
        What X moved by that is not exact, by the effect that moved it.
    forms : mapping of str to array, shape (moves, c)
        What other forms of an effect move, by its name.
    advice : tuple of Advice
    ended : bool
        Whether nothing more is to be estimated.
    before : frozenset of frozenset of str
        The effects that were estimated at each step before: what leads back to them is not taken.
    held : Score, optional
        Of an effect in `drift` that is likely and not certain.
    """

    job: Job
    slope: FloatArray | None
    now: Freed
    effects: tuple[Effect, ...]
    given: int
    ties: dict[str, tuple[Equal, ...]]
    drift: FloatArray
    advice: tuple[Advice, ...] = ()
    ended: bool = False
    before: frozenset[frozenset[str]] = frozenset()
    held: Score | None = None
    changes: Mapping[str, FloatArray] = field(default_factory=dict)
    forms: Mapping[str, FloatArray] = field(default_factory=dict)

    def look(self) -> Seen:
        """Return what the residual shows of effects that are not estimated."""
        return look(self.job, self.now, self.effects, self.slope, shapes_too=len(self.effects) == self.given)

    def step(self, seen: Seen) -> Search:
        """Return the search with the effect estimated that leaves least, or at its end."""
        shown = [one for one in seen.found if one.matters and one.effect.possible(one.size)]
        room = len(self.effects) < self.given + MOST_EFFECTS and len(self.before) < SEARCH_STEPS
        likely = likely_of(seen.found)
        varying = [one.effect for one in likely if one.effect.varies and not one.matters]
        tried = [*self._in_shape((*seen.shapes, *varying[:MOST_TRIED]))] if room else []
        if not tried and not shown:
            return replace(self._holding(likely[0]), held=likely[0]) if likely else replace(self, ended=True)
        if not tried and _of_the_same(shown[0], self.effects):
            return self._holding(shown[0])
        solved = [*self._tried(shown)] if room else []
        tried += [one for one in solved if self._leads_on(*one[1:])]
        if not tried:
            best = self._as_solved(shown[0], solved)
            quiet = self._small(best.effect, best.size, seen)
            return self._holding(best, *(() if quiet else (left_of(best, shown),)))
        return self._with(tried)

    def _as_solved(self, score: Score, solved: Sequence[tuple[Effect, tuple[Effect, ...], Freed]]) -> Score:
        """Return the score of what is nearly a column as a fit with it says, unless half a period late."""
        late = 0.5 / self.job.choice.cutoff_hz if score.effect.kind in LATE else np.inf
        for effect, _, freed in solved:
            if effect is score.effect and score.own < LITTLE_OWN and abs(freed.sizes[-1]) < late:
                size, move = freed.sizes[-1], freed.fit.solution.x - self.now.fit.solution.x
                return replace(score, size=size, std=abs(size / score.size) * score.std, move=move)
        return score

    def _leads_on(self, effects: Sequence[Effect], freed: Freed) -> bool:
        """Tell whether effects are new together, and leave no more a sample than those estimated now."""
        most = AS_LIKELY * (1 + max(len(self.effects) + 1 - len(effects), 0))
        return _names(effects) not in self.before and self._gained(effects, freed) > -most

    def _gained(self, effects: Sequence[Effect], freed: Freed) -> float:
        now, then = self._left((self.effects, self.now), (effects, freed))
        return now - then

    def _left(self, *found: tuple[Sequence[Effect], Freed]) -> list[float]:
        # encoders round the same motion in all
        every = [(freed.fit, effects, freed.at or freed.sizes) for effects, freed in found]
        return left_of_each(self.job, every, self.now.fit.simulated)

    def told(self, seen: Seen) -> list[bool]:
        """Tell of each effect that is estimated whether it is certain, and large enough to be named."""
        certain = normal_beyond(0.5 * LEVEL / max(len(self.effects) + len(seen.tested), 1))
        return [
            abs(size) > certain * std and not self._small(effect, size, seen)
            for effect, size, std in zip(self.effects, self.now.sizes, self.now.stds, strict=True)
        ]

    def _in_shape(self, shapes: Sequence[Effect]) -> Iterator[tuple[Effect, tuple[Effect, ...], Freed]]:
        """Yield the fits with one more effect that is certain and leaves clearly less."""
        least = normal_beyond(0.5 * LEVEL)
        for effect in shapes:
            found = self._freed(effect)
            if found is None or abs(found[1].sizes[-1]) <= least * found[1].stds[-1]:
                continue
            if self._gained(*found) > AS_LIKELY:
                yield found[0][-1], *found

    def _holding(self, score: Score, *advice: Advice) -> Search:
        """Return the search at its end, with what a score moves in the intervals."""
        varies = varied(self.job, self.now.fit, score.effect, score.size)
        drift = self.drift + np.outer(score.move, score.move) + varies
        return replace(self, drift=drift, advice=(*self.advice, *advice), ended=True)

    def _tried(self, shown: Sequence[Score]) -> Iterator[tuple[Effect, tuple[Effect, ...], Freed]]:
        """Yield effects that explain much or are surest, all that is estimated with each, and the fit.

        Far from the truth the shares that effects explain are shares along a tangent only, and of rows that
        are mostly noise what is nearly a column explains next to nothing, however sure it is.
        """
        if not shown:
            return
        likely = [one for one in shown if one.explained >= TRIED_TOO * shown[0].explained][:MOST_TRIED]
        sure = [abs(one.size) / one.std for one in shown]
        surest = [one for one, many in zip(shown, sure, strict=True) if many >= AS_SURE * max(sure)]
        likely += [one for one in surest[:MOST_TRIED] if one not in likely]
        known = {effect.name for effect in self.effects}
        own = known | {one.effect.name for one in likely}
        every = [(one.effect, *(form for form in one.effect.forms if form.name not in own)) for one in likely]
        for effect in dict.fromkeys(one for forms in every for one in forms):
            found = self._freed(effect) if effect.name not in known else None
            if found is None:
                continue
            yield effect, *found
            for other in effect.alike:
                alike = self._freed(other, found[1].sizes[-1])
                if alike is not None:
                    yield other, *alike

    def _freed(self, effect: Effect, size: float = 0.0) -> tuple[tuple[Effect, ...], Freed] | None:
        """Return the fit with one more effect, from a size on; without those that it makes none of.

        What stood in for it (a clock for a delay, friction of one body for that of another) goes.
        """
        effects, sizes, certain = (*self.effects, effect), (*self.now.sizes, size), normal_beyond(0.5 * LEVEL)
        while True:
            solved = self._solved(effects, sizes)
            if solved is None:
                return None
            effects, found = solved
            sized = zip(effects, found.sizes, strict=True)
            real = [self._is_real(*one, found.late_forces) for one in sized]
            # zeros that a start brought along are nuisances: they stay, whatever their size is
            for place in range(self.given, len(effects) - 1):
                real[place] &= abs(found.sizes[place]) > certain * found.stds[place]
            if all(real):
                return effects, found
            if not real[-1]:
                return None
            effects = tuple(one for one, kept in zip(effects, real, strict=True) if kept)
            # what is tried keeps the samples that all others have, see `_with`
            sizes = (*(one for one, kept in zip(found.sizes[:-1], real, strict=False) if kept), size)

    def _solved(
        self, effects: tuple[Effect, ...], sizes: tuple[float, ...]
    ) -> tuple[tuple[Effect, ...], Freed] | None:
        """Return the effects, in the shape that is found, and the fit; None where there is none."""
        job, fit = self.job, self.now.fit
        with suppress(IdentifiabilityError, DataError):
            return fit_in_shape(job.setting(), job.calm, fit, effects, sizes, job.sharpened, EFFECT_ROUNDS)
        return None

    def _is_real(self, effect: Effect, size: float, late: Mapping[str, float]) -> bool:
        """Tell whether physics allows a size, and it is not next to nothing."""
        nothing = (effect.kind == "clock" and self._out_of_step(effect, size) < LEAST_CLOCK_DRIFT) or (
            effect.kind in LEAST_SIZE and abs(size) < LEAST_SIZE[effect.kind]
        )
        return effect.possible(size) and not nothing and believable(self.job, effect, size, late)

    def _inexact(self, effect: Effect, freed: Freed) -> float:
        """Return the share to which what an effect moves is unknown; a ripple's harmonics would be left."""
        seen = effect.kind == RIPPLE and leaves_noise(self.job, freed.fit)
        return RIPPLE_ALONE if seen else INEXACT.get(effect.kind, 0.0)

    def _out_of_step(self, effect: Effect, size: float) -> float:
        """Return by how many samples a delay, or a clock at the end, is out of step; infinite for others."""
        if effect.kind == "clock":
            return abs(size) * max(record.n for record in self.job.records)
        return abs(size) * max(record.fs for record in self.job.records) if effect.kind in LATE else np.inf

    def _rarity(self, effect: Effect) -> int:
        """Return how rare an effect is: forces are late more often than sensors, these than off a clock."""
        late = effect.kind == "delay" and effect.channel in self.job.late
        return 0 if late else 2 if effect.kind == "clock" else 1

    def _small(self, effect: Effect, size: float, seen: Seen) -> bool:
        """Tell whether an effect is below what a reading, or its instant, is known to.

        Directions that change late move the delay of a force where rows use samples near reversals.
        """
        turning = effect.kind == "delay" and effect.channel in self.job.late
        least = HALF_SAMPLE if turning else LEAST_CLOCK_DRIFT
        late, rounded = self._out_of_step(effect, size), effect.name in seen.rounded
        return late < least or rounded or below_noise(effect, size, self.job.records)

    def _with(self, tried: Sequence[tuple[Effect, tuple[Effect, ...], Freed]]) -> Search:
        """Return the search with the effect that leaves least; of equals the least rare, and surest."""
        left = self._left(*((every, freed) for _, every, freed in tried))
        equals = [one for one, misfit in zip(tried, left, strict=True) if misfit < min(left) + AS_LIKELY]
        least = AS_SURE * max(found.certainty for _, _, found in equals)
        (effect, effects, freed), *others = sorted(
            equals, key=lambda entry: (self._rarity(entry[0]), entry[2].certainty < least)
        )
        equal = tuple(Equal(one, found.sizes[-1], found.fit.solution.x) for one, _, found in others)
        if effect.turns:  # known now: without samples about reversals, which all that were tried had
            effects, freed = self._freed(effect, freed.sizes[-1]) or (effects, freed)
        names = _names(effects)
        kinds = {one.kind for one in self.effects if one.name in names}
        share = 1.0 if ROUGH & kinds else self._inexact(effect, freed)
        change = share * (freed.fit.solution.x - self.now.fit.solution.x)
        # what an effect moved that is estimated no more says nothing of the others
        changes = {one: self.changes[one] for one in self.changes if one in names} | {effect.name: change}
        moves = moves_of_forms(self.now.fit, effect, freed, [(one, found) for one, _, found in tried])
        forms = {one: self.forms[one] for one in self.forms if one in names} | {effect.name: moves}
        drift = np.sum([np.outer(one, one) for one in changes.values()], axis=0)
        if any(one.size for one in forms.values()) and not leaves_noise(self.job, freed.fit):
            drift = drift + np.sum([one.T @ one for one in forms.values()], axis=0)
        return replace(
            self,
            now=freed,
            effects=effects,
            given=min(self.given, len(effects)),
            ties={**self.ties, effect.name: equal},
            changes=changes,
            forms=forms,
            drift=drift,
            before=self.before | {_names(self.effects)},
        )


def _names(effects: Sequence[Effect]) -> frozenset[str]:
    return frozenset(effect.name for effect in effects)


def _of_the_same(score: Score, effects: Sequence[Effect]) -> bool:
    """Tell whether an effect is what is left of one that is estimated, whatever it looks like.

    What a reversal does has no form that is known, and other effects are simulated in first order.
    """
    kinds = {effect.kind for effect in effects}
    little = score.explained < LITTLE_LEFT
    return not kinds.isdisjoint(AT_REVERSALS) or (bool(kinds & INEXACT.keys()) and little)
