"""What the balances of power of chains and of arms have in common."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from modelgen.runtime.model.arm_kernel import Read
from modelgen.runtime.model.model import Signal


@dataclass(frozen=True, eq=False, kw_only=True)
class BalanceLines:
    """Energies and works of which a row of power is made.

    Attributes
    ----------
    inputs : tuple of str
        Signals that are read: all that the rows of forces hold but accelerations, and speeds.
    risen : mapping of str to str
        Acceleration to the speed that it is the derivative of.
    keys : tuple of str
        Lines: ``energy C``, ``work C`` of column C, and ``energy measured``, ``work measured``.
    further : tuple of Signal
        Signals that are read, which the rows of forces do not need.
    reads_of : mapping of str to (str, int)
        What each of the inputs is made of: a channel, and how often it is differentiated.
    """

    inputs: tuple[str, ...]
    risen: Mapping[str, str]
    keys: tuple[str, ...] = ()
    further: tuple[Signal, ...] = ()
    reads_of: Mapping[str, Read] = field(default_factory=dict)

    @property
    def reads(self) -> tuple[Read, ...]:
        """What the lines are formed from."""
        return tuple(self.reads_of.values())

    @property
    def orders(self) -> Mapping[str, int]:
        """How often the filter differentiates each line."""
        return {key: int(key.startswith("energy")) for key in self.keys}
