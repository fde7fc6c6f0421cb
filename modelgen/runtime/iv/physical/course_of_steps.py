"""How far Gauss-Newton steps go from a start, and whether they lead on.

Rows are linear only near the estimate: a step is shortened where it leaves their range, or where rows leave
far more at its end. What is impossible on the way is refused.
"""

from __future__ import annotations

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import IdentifiabilityError
from modelgen.runtime.iv.physical.gauss_newton_step import GaussNewtonStep, Rules, Unknowns
from modelgen.runtime.iv.thresholds import (
    LARGEST_STEP,
    LEAST_PART,
    LEAVES_LESS,
    LEAVES_MORE,
    LINEAR_SHARE,
    ROUGH_ROUNDS,
)
from modelgen.runtime.model.model import Model

SIGNED = ("offset", "viscous", "coulomb", "damping")
MORE = (
    "sense more (modelgen show --sensors all), give one of them as known, excite more, or give the delays of "
    "forces where they are known (--delay none)"
)


class Course:
    """Steps from a start, one after the other."""

    def __init__(self, model: Model, first: FloatArray, rules: Rules, sample_s: float) -> None:
        """Take the first parameters, in SI, (parameters,); no step changes a delay by more than a sample."""
        self._model, self._first, self._rules, self._sample_s = model, first, rules, sample_s
        self._lefts: list[float] = []
        self._begin, self._move, self._part = Unknowns(first, {}), np.zeros(0), 0.5

    def instead(self, step: GaussNewtonStep) -> Unknowns | None:
        """Return where to go in place of the last end, if rows leave far more there; None if not.

        Rows that effects change leave other noise, and do not tell: undoing a low-pass makes it larger.
        """
        worse = bool(self._lefts) and step.left > self._lefts[-1] + LEAVES_MORE
        if not worse or self._begin.sizes or self._part <= LEAST_PART:
            return None
        self._part *= 0.5
        return self._end()

    def leads_on(self, step: GaussNewtonStep) -> bool:
        """Take what rows leave at the end of a step; tell whether the last few leave clearly less."""
        self._lefts.append(step.left)
        before = min(self._lefts[:-ROUGH_ROUNDS], default=-np.inf)
        return min(self._lefts[-ROUGH_ROUNDS:]) < before - LEAVES_LESS

    def on(self, now: Unknowns, move: FloatArray) -> Unknowns:
        """Return the unknowns after a step, in SI, (n,), or after twice the part of the last one."""
        self._begin, self._move, self._part = now, move, min(1.0, 2.0 * self._part)
        return self._end()

    def is_linear(self, now: Unknowns, move: FloatArray, spread: FloatArray) -> bool:
        """Tell whether the rows are nearly linear as far as a step and its spread, in SI, (n,), reach."""
        bound = self._bound
        reach, size = (np.abs(move) + spread)[: len(bound)], np.abs(now.p)
        return bool(np.all(reach[bound] <= LINEAR_SHARE * size[bound]))

    def refuse_led_away(self, now: Unknowns, factor: float) -> None:
        """Raise where steps have made parameters of a chain so many times smaller or larger."""
        found, first = [], self._first.tolist()
        for name, value, start in zip(self._model.parameters, now.p.tolist(), first, strict=True):
            most = min(factor, self._rules.farthest) if is_solid(self._model, name) else factor
            away = start and not abs(start) / most <= abs(value) <= abs(start) * most
            if away and self._keeps_sign(name):
                found.append(name)
        if found:
            what = f"the records do not hold {', '.join(found)}: steps lead to where there is no such chain"
            raise IdentifiabilityError.at("method iv", what, MORE)

    def _end(self) -> Unknowns:
        """Return the unknowns after a part of a step, less where that would leave the range of the rows."""
        now, move = self._begin, self._part * self._move
        c, bound = len(now.p), self._bound
        share = np.abs(move[:c][bound]) / np.maximum(np.abs(now.p[bound]), np.finfo(float).tiny)
        length = min(1.0, LARGEST_STEP / max(float(share.max(initial=0.0)), LARGEST_STEP))
        late, apart = np.split(length * move[c:], [len(now.delays)])
        steps = np.clip(late, -self._sample_s, self._sample_s).tolist()
        delays = {key: delay + step for (key, delay), step in zip(now.delays.items(), steps, strict=True)}
        return Unknowns(now.p + length * move[:c], delays, tuple((apart + now.sizes).tolist()))

    @property
    def _bound(self) -> FloatArray:
        return np.array([self._keeps_sign(name) for name in self._model.parameters])

    def _keeps_sign(self, name: str) -> bool:
        """Tell whether a parameter keeps its sign as no step goes far: a bound lets damping go to zero."""
        if name not in self._model.roles or name in self._rules.at_zero:
            return False
        role = self._model.roles[name].role
        return role not in SIGNED and not (self._rules.bounded and role == "damping")


def is_solid(model: Model, name: str) -> bool:
    """Tell whether a parameter is an inertia or a stiffness: friction and damping may be next to nothing."""
    return name in model.roles and model.roles[name].role in ("inertia", "stiffness")
