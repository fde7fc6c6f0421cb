"""The values of a pair of poles, and the interval of each: delta method, or the ends worked out.

An interval is the range that a number takes within the ellipsoid of the parameters that a deviation of 1.96
along the number's own slope reaches (Hasofer and Lind 1974; the delta method where the number is linear).
It is then the same whatever function of the parameters one chooses to look at.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.modes.pole_pairs import PolePair
from modelgen.runtime.modes.thresholds import CRITICAL_SHARE, LINEAR_SHARE, NEAR_CRITICAL, SHARPEST, Z95
from modelgen.runtime.modes.uncertain_chain import UncertainChain

At = Callable[[dict[str, float]], PolePair | None]


@dataclass(frozen=True)
class ModalValue:
    """A number with its standard deviation and 95 % interval, which need not lie evenly around it.

    An end that the records leave open is None, and with it the standard deviation.
    """

    value: float
    std: float | None
    low: float | None
    high: float | None


@dataclass(frozen=True)
class PairValues:
    """What a pair of poles says: natural frequency in Hz, damping ratio, time constants in s, slowest first.

    A free motion has neither frequency nor damping ratio; without friction, no time constant either.
    """

    frequency_hz: ModalValue | None
    damping_ratio: ModalValue | None
    time_constants_s: tuple[ModalValue, ...]


def pair_values(
    pair: PolePair, slopes: FloatArray, free: bool, chain: UncertainChain, at: At, inertias: frozenset[str]
) -> PairValues:
    """Return the numbers of a pair with their intervals.

    Parameters
    ----------
    slopes : array, shape (2, parameters)
        Of the pair's sum and product, in SI.
    free : bool
        Whether one of the poles is zero, as the chain moves freely.
    chain : UncertainChain
    at : callable
        Gives the pair for other values of the parameters; None where there is none.
    inertias : frozenset of str
        Parameters that stay above zero.
    """

    def told(number: Callable[[PolePair], float], slope: FloatArray, straight: bool = True) -> ModalValue:
        value = number(pair)
        weights = chain.root.T @ (slope @ slopes)
        reach = float(np.linalg.norm(weights))
        if not reach or (straight and reach <= LINEAR_SHARE * abs(value)):
            return ModalValue(value, reach, value - Z95 * reach, value + Z95 * reach)
        ends = [value]
        for z in (-Z95, Z95):
            moved = at(chain.moved(z * chain.root @ weights / reach, inertias))
            ends.append(math.copysign(math.inf, z) if moved is None else number(moved))
        low, high = (end if math.isfinite(end) else None for end in (min(ends), max(ends)))
        std = None if low is None or high is None else (high - low) / (2.0 * Z95)
        return ModalValue(value, std, low, high)

    if free:
        if not pair.sum:
            return PairValues(None, None, ())
        return PairValues(None, None, (_inverse(told(lambda pair: pair.sum, np.array([1.0, 0.0]))),))
    s, p = pair.sum, pair.product
    frequency = told(_frequency_hz, np.array([0.0, _frequency_hz(pair) / (2.0 * p)]))
    half = 0.5 / math.sqrt(p)
    damping = told(_damping_ratio, np.array([half, -0.5 * s * half / p]))
    constants: tuple[ModalValue, ...] = ()
    if abs(damping.value) >= 1.0:
        margin = abs(damping.value) - 1.0
        std = math.inf if damping.std is None else damping.std
        straight = margin > max(NEAR_CRITICAL * std, CRITICAL_SHARE)
        rates = (told(one, _slope(one(pair), s), straight) for one in (_slow_rate, _fast_rate))
        constants = tuple(_inverse(rate) for rate in rates)
    return PairValues(frequency, damping, constants)


def _inverse(rate: ModalValue) -> ModalValue:
    """Return a time constant from its rate: where that may be zero, the time constant is open above."""
    value = 1.0 / rate.value
    low, high = rate.low, rate.high
    if low is None or high is None or not low * high > 0.0:
        end = high if rate.value > 0.0 else low
        near = None if end is None else 1.0 / end
        return ModalValue(value, None, *((near, None) if rate.value > 0.0 else (None, near)))
    return ModalValue(value, (1.0 / low - 1.0 / high) / (2.0 * Z95), 1.0 / high, 1.0 / low)


def _frequency_hz(pair: PolePair) -> float:
    return math.sqrt(max(pair.product, 0.0)) / (2.0 * math.pi)


def _damping_ratio(pair: PolePair) -> float:
    if pair.product <= 0.0:
        return math.copysign(math.inf, pair.sum)
    return 0.5 * pair.sum / math.sqrt(pair.product)


def _slow_rate(pair: PolePair) -> float:
    fast = _fast_rate(pair)
    return pair.product / fast if fast else 0.0


def _fast_rate(pair: PolePair) -> float:
    """Return the larger rate of decay in 1/s of two real poles; half their sum where they are complex."""
    half = 0.5 * pair.sum
    return half + math.copysign(math.sqrt(max(half**2 - pair.product, 0.0)), half)


def _slope(rate: float, s: float) -> FloatArray:
    """Return the slopes of a rate by sum and product: r^2 - s r + p = 0."""
    apart = 2.0 * rate - s
    apart = math.copysign(max(abs(apart), SHARPEST * abs(s)), apart)
    return np.array([rate / apart, -1.0 / apart])
