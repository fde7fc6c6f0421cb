"""Rows: sums of parameter times coefficient times signal, with signals that a sensor set can give."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, NamedTuple

from sympy.polys.rings import PolyElement

from modelgen.spec.chain import ChainSpec, Sensor
from modelgen.symbolic.equations.signals import Exact


class KeyTerm(NamedTuple):
    """parameter * coefficient * signals[key]; a parameter of None belongs to the left-hand side."""

    parameter: str | None
    key: str
    coefficient: Exact


@dataclass(frozen=True)
class NeededSignal:
    """A signal the module needs: a sensor's or an actuator's reading, differentiated."""

    key: str
    sensor: str | None
    actuator: str | None
    derivative: int


@dataclass(frozen=True)
class Feature:
    """A nonlinear function of signals, see FEATURES in a generated module."""

    key: str
    function: Literal["sign", "forward", "backward", "cube"]
    of: str | tuple[tuple[Exact, str], ...]
    times: str | None = None


@dataclass(frozen=True)
class Row:
    """One scalar equation, linear in its parameters, in signals that the sensor set gives."""

    name: str
    origin: str
    bodies: tuple[str, ...]
    differentiated: int
    order: int
    terms: tuple[KeyTerm, ...]
    reversals: tuple[str, ...]
    unit: str


@dataclass(frozen=True)
class Composite:
    """A quotient of two polynomials in the physical parameters, without common factors."""

    numerator: PolyElement
    denominator: PolyElement
    formula: str

    @property
    def parameters(self) -> tuple[str, ...]:
        """The physical parameters in the quotient, in the order of the spec."""
        symbols, used = self.numerator.ring.symbols, [0] * self.numerator.ring.ngens
        for poly in (self.numerator, self.denominator):
            for exponents in poly:
                used = [max(pair) for pair in zip(used, exponents, strict=True)]
        return tuple(symbol.name for symbol, power in zip(symbols, used, strict=True) if power)


@dataclass(frozen=True)
class IdentificationRows:
    """All rows of one sensor set, with the signals and features their terms name.

    `composites` are the parameters of eliminated rows that are no physical parameters themselves.
    """

    spec: ChainSpec
    sensor_set: str
    sensors: tuple[Sensor, ...]
    rows: tuple[Row, ...]
    signals: tuple[NeededSignal, ...]
    features: tuple[Feature, ...]
    composites: Mapping[str, Composite]
