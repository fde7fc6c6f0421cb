"""Stick and slip along steps that are linear in the states and in the friction of every speed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from modelgen.array_types import FloatArray
from modelgen.runtime.simulation.arms.thresholds import SWEEPS, SWEPT


@dataclass(frozen=True, eq=False)
class FrictionSteps:
    """Steps x+ = states (x, 1) + signs s of states x = (q, v), s between -1 and 1 a speed.

    Attributes
    ----------
    states : ndarray, shape (K, 2 n, 2 n + 1)
    signs : ndarray, shape (K, 2 n, C)
    levers : ndarray, shape (C, n)
        Every speed that rubs, as a sum of those of the joints.
    parts : callable, optional
        Takes a step to the states and signs of its parts. A step in which a speed stops, starts or turns is
        taken part by part: within it friction is a constant only as far as the step is short.
    """

    states: FloatArray
    signs: FloatArray
    levers: FloatArray
    parts: Callable[[int], tuple[FloatArray, FloatArray]] | None = None

    def run(
        self, start: FloatArray, step_s: float, before: FloatArray | None = None
    ) -> tuple[FloatArray, npt.NDArray[np.int8], FloatArray]:
        """Return states, shape (2 n, K + 1), modes (+1, -1, sticking 0) and friction's share, (C, K + 1).

        `before` are the modes of the speeds at the start, shape (C,), by default their signs.
        """
        count, size = self.states.shape[:2]
        n, levers = size // 2, self.levers
        x = np.append(np.asarray(start, dtype=float), 1.0)
        found = np.empty((count + 1, size))
        found[0] = x[:size]
        shares = np.zeros((count + 1, len(levers)))
        s = np.sign(levers @ x[n:size]) if before is None else before
        for k in range(count):
            push = self.signs[k]
            free = self.states[k] @ x
            after = free + push @ s
            # the usual step: what slips goes on slipping
            if levers.size and not np.all(s * (levers @ after[n:]) > 0.0):
                after, shares[k], turned = self._turned(free, push, s, x[:size], step_s)
                last = shares[max(k - 1, 0)]
                if self.parts is not None and np.any((turned != s) | _about_to_start(shares[k], last)):
                    fine = FrictionSteps(*self.parts(k), levers)
                    states, _, friction = fine.run(x[:size], step_s / len(fine.states), s)
                    after, shares[k], turned = states[:, -1], friction[:, 0], friction[:, -1]
                s = turned
            else:
                shares[k] = s
            x[:size] = after
            found[k + 1] = after
        shares[-1] = s
        modes = np.where(np.abs(shares) >= 1.0, np.sign(shares), 0.0).astype(np.int8)
        return found.T.copy(), modes.T.copy(), shares.T.copy()

    def _turned(
        self, free: FloatArray, push: FloatArray, before: FloatArray, begun: FloatArray, step_s: float
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the states behind a step in which speeds stop or start, and shares of friction at its ends.

        A speed that stops within the step rubs one way until it is zero, and what is left of the step it
        is held, or rubs the other way; the position is that of both parts.
        """
        n, levers = len(free) // 2, self.levers
        through, speed = levers @ push[n:], levers @ begun[n:]
        s = self._held(levers @ free[n:], through, before)
        first, mean = s.copy(), s.copy()
        at = free + push @ first
        for c in range(len(s)):
            if before[c] == 0.0 or s[c] == before[c] or speed[c] * before[c] <= 0.0:
                continue
            # speed at the end if it went on rubbing this way
            on = levers[c] @ at[n:] + through[c, c] * (before[c] - s[c])
            share = min(speed[c] / (speed[c] - on), 1.0) if speed[c] != on else 1.0
            # what would hold it at zero from then on; where that is too much, it is off the other way
            second = (s[c] - share * before[c]) / max(1.0 - share, 1e-6)
            if abs(s[c]) >= 1.0 or abs(second) > 1.0:
                second = s[c] = float(np.sign(second))
                mean[c] = share * before[c] + (1.0 - share) * second
            pull = push[n:, c] * step_s
            both = before[c] * (share - 0.5 * share**2) + second * 0.5 * (1.0 - share) ** 2
            at[:n] += pull * (both - 0.5 * (share * before[c] + (1.0 - share) * second))
        at += push @ (mean - first)
        held = np.abs(s) < 1.0
        if held.any():  # exactly at rest, where rounding leaves something
            at[n:] -= _along(levers[held], at[n:])
        stuck = levers[held & (before == 0.0)]
        if stuck.size:  # a force that is constant holds the end of a step, not all of it
            at[:n] -= _along(stuck, at[:n] - begun[:n])
        return at, np.where(before != 0.0, before, s), np.where(held, 0.0, np.sign(s))

    def _held(self, speed: FloatArray, through: FloatArray, first: FloatArray) -> FloatArray:
        """Return s between -1 and 1 with which every speed + through s is zero, or s its sign.

        Projected Gauss and Seidel: through is negative definite, or nearly so.
        """
        s = first.copy()
        diagonal = np.diag(through)
        for _ in range(SWEEPS):
            last = s.copy()
            for c in range(len(s)):
                wanted = s[c] - (speed[c] + through[c] @ s) / diagonal[c]
                s[c] = min(max(wanted, -1.0), 1.0)
            if np.max(np.abs(s - last)) < SWEPT:
                break
        return s


def _about_to_start(share: FloatArray, last: FloatArray) -> npt.NDArray[np.bool_]:
    """Return which speeds stick by a mean share of friction that may exceed 1 within the step."""
    return np.asarray((np.abs(share) < 1.0) & (np.abs(share) + np.abs(share - last) >= 1.0))


def _along(levers: FloatArray, values: FloatArray) -> FloatArray:
    """Return the part of values of coordinates, shape (n,), that these speeds see."""
    return np.asarray(levers.T @ np.linalg.lstsq(levers @ levers.T, levers @ values, rcond=None)[0])
