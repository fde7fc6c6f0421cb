"""What an estimate was made from, kept while it is in memory: the model and its records."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from modelgen.runtime.model.model import Model
from modelgen.runtime.modes.chain_of_fit import Again
from modelgen.runtime.modes.uncertain_chain import UncertainChain
from modelgen.runtime.records.record import Record


@dataclass(frozen=True, eq=False)
class EstimateSource:
    """The model and the records (directions found, known delays compensated) behind an estimate.

    `known` is what the fit knows of all parameters, refused ones too, and what gives it near other values;
    None where that is no chain.

    They are what plots need. They are no part of what is saved, pickled or copied deeply: an estimate that
    comes from there holds none, and its plots ask for them.
    """

    model: Model
    records: tuple[Record, ...]
    known: tuple[UncertainChain, Again] | None

    @property
    def chain(self) -> UncertainChain | None:
        """What the fit determines of all parameters; None where that is no chain."""
        return None if self.known is None else self.known[0]

    def __reduce__(self) -> tuple[Any, ...]:
        return _nothing, ()


def _nothing() -> None:
    return None
