"""ArmKernel: what a generated arm's module computes that is nonlinear in the signals, as lines of arrays.

Of every entry of the regressor it is found out at random samples (seeded) whether it is a sum of derivatives,
directions and constants. Such sums are terms as those of chains, and filters act on their signals; the other
entries are lines of the kernel, formed at the full rate and filtered afterwards.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, Protocol

import numpy as np

from modelgen.array_types import FloatArray

# Samples in which entries are compared with sums of candidates: more than there are candidates.
SAMPLES_A_CANDIDATE = 3
# Relative to the largest value of an entry; a sum differs by rounding only.
TOLERANCE = 1e-10
# Coefficients are ratios of gears: fractions with short denominators, within rounding.
LARGEST_DENOMINATOR = 1_000_000

Sum = tuple[tuple[float, str], ...]
#: A channel or a feature, and how often it is differentiated.
Read = tuple[str, int]


class Kernel(Protocol):
    """What forms lines that are nonlinear in several signals; see `ArmKernel` for the attributes."""

    @property
    def inputs(self) -> tuple[str, ...]:
        """Signals that it reads."""

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys of the features."""

    @property
    def orders(self) -> Mapping[str, int]:
        """How often the filter differentiates a line; not at all those that are not named."""

    @property
    def reads_of(self) -> Mapping[str, Read]:
        """What each of the inputs is made of: a channel, and how often it is differentiated."""

    @property
    def reads(self) -> tuple[Read, ...]:
        """What the lines are formed from."""

    def lines(self, signals: Mapping[str, FloatArray]) -> Mapping[str, FloatArray]:
        """Return every feature, shape (N,) each, from the inputs, shape (N,) each; all in SI."""


@dataclass(frozen=True, eq=False)
class ArmKernel:
    """Lines that are nonlinear in the signals, all in SI.

    Attributes
    ----------
    module
        The generated module.
    inputs : tuple of str
        Signals of coordinates that the kernel reads.
    forces : tuple of str
        Signals of forces, which are zero to the lines of the left side.
    reads_of : mapping of str to (str, int)
        What each of the inputs is made of: a channel, and how often it is differentiated.
    entries : mapping of str to int
        Key of a feature to its line of `ENTRIES`.
    left : mapping of str to int
        Key of a feature to the row whose left side holds it: what known parameters contribute.
    """

    module: Any
    inputs: tuple[str, ...]
    forces: tuple[str, ...]
    entries: Mapping[str, int]
    left: Mapping[str, int]
    reads_of: Mapping[str, Read] = field(default_factory=dict)

    @property
    def reads(self) -> tuple[Read, ...]:
        """What the lines are formed from."""
        return tuple(self.reads_of.values())

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys of the features, in the order of the lines."""
        return (*self.entries, *self.left)

    @property
    def orders(self) -> Mapping[str, int]:
        """How often the filter differentiates a line; not at all those that are not named."""
        return {}

    def lines(self, signals: Mapping[str, FloatArray]) -> Mapping[str, FloatArray]:
        """Return every feature, shape (N,) each, from signals of the coordinates, shape (N,) each."""
        rest = np.zeros(len(signals[self.inputs[0]]) if self.inputs else 0)
        every = {**signals, **dict.fromkeys(self.forces, rest)}
        found: dict[str, FloatArray] = {}
        if self.entries:
            lines = self.module.entries(every)
            found |= {key: lines[line] for key, line in self.entries.items()}
        if self.left:
            left = self.module.measurement(every)
            found |= {key: left[:, row] for key, row in self.left.items()}
        return found


@dataclass(frozen=True, eq=False)
class CandidateSignals:
    """Signals and features, in SI, that an entry may be made of, at random samples: shape (N,) each.

    `summed` are independent of each other: entries are sums of them, or else a multiple of one of `alone`.
    """

    summed: Mapping[str, FloatArray]
    alone: Mapping[str, FloatArray]

    def also(self, further: Mapping[str, FloatArray]) -> CandidateSignals:
        """Return the same with further ones to be summed, shape (n,) each."""
        return CandidateSignals({**self.summed, **further}, self.alone)

    def sums(self, lines: FloatArray) -> list[Sum | None]:
        """Return each line, shape (lines, N), as terms of candidates, None where it is none."""
        keys, values = tuple(self.summed), np.column_stack(list(self.summed.values()))
        found, *_ = np.linalg.lstsq(values, lines.T, rcond=None)
        exact = np.where(np.abs(found) > TOLERANCE, np.vectorize(_ratio, otypes=[float])(found), 0.0)
        terms: list[Sum | None] = []
        for line, coefficients in zip(lines, exact.T, strict=True):
            missed = np.max(np.abs(values @ coefficients - line))
            close = missed <= TOLERANCE * np.max(np.abs(line))
            terms.append(_terms(keys, coefficients) if close else self._multiple(line))
        return terms

    def _multiple(self, line: FloatArray) -> Sum | None:
        for key, value in self.alone.items():
            factor = _ratio(float(line @ value) / float(value @ value))
            if np.max(np.abs(factor * value - line)) <= TOLERANCE * np.max(np.abs(line)):
                return ((factor, key),)
        return None


def _ratio(value: float) -> float:
    near = Fraction(value).limit_denominator(LARGEST_DENOMINATOR)
    return float(near) if abs(float(near) - value) <= TOLERANCE * abs(value) else value


def _terms(keys: Sequence[str], coefficients: FloatArray) -> Sum:
    return tuple((float(c), key) for c, key in zip(coefficients.tolist(), keys, strict=True) if c)
