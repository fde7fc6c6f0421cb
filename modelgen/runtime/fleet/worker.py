"""What the workers of a fleet do: the records of one machine -> its estimate, by the same `identify`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from modelgen.array_types import FloatArray
from modelgen.errors import ModelgenError
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.model.known_parameters import with_known
from modelgen.runtime.model.model import Model, model_from_text
from modelgen.runtime.records.channels import Channels
from modelgen.runtime.records.record import Record
from modelgen.runtime.records.same_data import look, same_throughout


@dataclass(frozen=True, eq=False)
class FleetRecord:
    """One record of a machine; records of a fleet need names of their own.

    Attributes
    ----------
    machine : str
    source : Record, Channels or callable
        The record, or what reads it where it is called: on a worker.
    name : str
        By default that of the source.
    stamp : str
        Changes whenever the data does (path, size and time of a file); empty where it has to be looked at.
    """

    machine: str
    source: Channels | Callable[[], Record]
    name: str = ""
    stamp: str = ""

    def __post_init__(self) -> None:
        if not self.name:
            object.__setattr__(self, "name", getattr(self.source, "name", "record"))

    def opened(self) -> Record:
        """Return the record.

        Raises
        ------
        DataError
            When it cannot be read.
        """
        if isinstance(self.source, Record):
            return self.source
        return self.source() if callable(self.source) else Record.over(self.source)


@dataclass(frozen=True, eq=False)
class MachineReport:
    """What came of one machine.

    Attributes
    ----------
    document : mapping or None
        Its estimate, `Estimate.to_dict`; None where there is none.
    reason : str
        Why there is none.
    failed : mapping of str to str
        Record to the reason why it is not in the estimate.
    looks : mapping of str to array
        Samples here and there of each record that was read, see `same_data.look`.
    """

    document: Mapping[str, Any] | None
    reason: str
    failed: Mapping[str, str]
    looks: Mapping[str, FloatArray]


@lru_cache(maxsize=8)
def fleet_model(text: str, trust: bool = False, known: tuple[tuple[str, float], ...] = ()) -> Model:
    """Return the model of a generated module's text; with `trust` whoever wrote it.

    `known` are pairs of parameter and value (SI) that are not estimated.
    """
    return with_known(model_from_text(text, "fleet", trust), dict(known))


def identify_machine(
    module_text: str,
    records: Sequence[FleetRecord],
    options: Mapping[str, Any],
    trust: bool = False,
    known: tuple[tuple[str, float], ...] = (),
) -> MachineReport:
    """Return the estimate of one machine; a record that cannot be read is left out, and named."""
    model = fleet_model(module_text, trust, known)
    usable, failed, looks = [], {}, {}
    for one in records:
        try:
            record = one.opened()
            for key in model.channels:
                if key in record.keys:
                    record.facts.extent(key)  # every sample is looked at once: a damaged file shows here
            looks[one.name] = look(record, [key for key in model.channels if key in record.keys])
            usable.append(record)
        except ModelgenError as error:
            failed[one.name] = str(error)
    if not usable:
        return MachineReport(None, "none of its records can be read", failed, looks)
    try:
        return MachineReport(identify(model, usable, **options).to_dict(), "", failed, looks)
    except ModelgenError as error:
        return MachineReport(None, str(error), failed, looks)


def probe(record: FleetRecord, channels: Sequence[str]) -> None:
    """Read every sample of a record; to be run alone where a worker died, to find out of what."""
    opened = record.opened()
    for key in channels:
        opened.facts.extent(key)


def same_records(first: FleetRecord, second: FleetRecord, channels: Sequence[str]) -> bool:
    """Return whether two records hold the same data."""
    return same_throughout(first.opened(), second.opened(), channels)
