"""What channels may have been taken for: two that are exchanged, or one that is reversed."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.diagnostics.samples.unit_errors import amplitudes_off
from modelgen.runtime.diagnostics.thresholds import REVERSED
from modelgen.runtime.model.arm_channels import DRIVE
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.channels import Edit
from modelgen.runtime.records.record import Record


@dataclass(frozen=True)
class ChannelChange:
    """What is done to the channels; `alike` tells whether filters chosen before hold after it, too."""

    words: str
    channels: str
    alike: bool
    apply: Callable[[Record], Record]


def channel_changes(
    model: Model, records: Sequence[Record], still: Container[str]
) -> Iterator[ChannelChange]:
    """Yield exchanges of channels that measure the same, reversals, and exchanges of any other two.

    But of two sensors whose amplitudes agree as they are. Of an arm there are many: what neighbours read on
    one side of their springs is taken for each other first, and all else that measures the same last.
    """
    kinds = {sensor.key: (sensor.measures, sensor.unit) for sensor in model.sensors}
    kinds |= {actuator.key: ("force", actuator.unit) for actuator in model.actuators}
    # one that reads the same everywhere explains nothing in another's place
    known = [key for key in model.channels if key in kinds and key not in still]
    pairs = list(combinations(known, 2))
    alike = [(one, other) for one, other in pairs if kinds[one] == kinds[other]]
    near = _of_neighbours(model, known) if model.is_arm else alike
    yield from (_exchange(one, other, True) for one, other in near)
    yield from (_reversal(key) for key in known)
    yield from (_exchange(one, other, True) for one, other in alike if (one, other) not in near)
    for one, other in pairs:
        change = _exchange(one, other, False)
        if (one, other) not in alike and _may_be(change, {one, other}, model, records):
            yield change


def _of_neighbours(model: Model, keys: Sequence[str]) -> list[tuple[str, str]]:
    """Return pairs of channels that follow each other among those of one kind and one side of springs."""
    sides = {one.key: (one.measures, one.unit, (one.body or "").endswith(" motor")) for one in model.sensors}
    sides |= {one.key: ("force", one.unit, one.key.startswith(DRIVE)) for one in model.actuators}
    by_side: dict[tuple[str, str, bool], list[str]] = {}
    for key in keys:
        by_side.setdefault(sides[key], []).append(key)
    return [pair for same in by_side.values() for pair in pairwise(same)]


def _may_be(change: ChannelChange, keys: Container[str], model: Model, records: Sequence[Record]) -> bool:
    """Tell whether amplitudes do not speak against an exchange of channels that measure something else.

    A gear, or a derivative, shows in those of two sensors however much noise there is.
    """
    pair = [sensor for sensor in model.sensors if sensor.key in keys]
    given = amplitudes_off(model, records, *pair) if len(pair) == 2 else None
    if given is None:
        return True
    other = amplitudes_off(model, [change.apply(record) for record in records], *pair)
    return other is None or other < given + np.log(REVERSED)


def _exchange(one: str, other: str, alike: bool) -> ChannelChange:
    def apply(record: Record) -> Record:
        return record.edited({one: Edit(other, _same), other: Edit(one, _same)})

    return ChannelChange("swapped with each other", f"{one} and {other}", alike, apply)


def _reversal(key: str) -> ChannelChange:
    def apply(record: Record) -> Record:
        return record.edited({key: Edit(key, _mirrored)})

    return ChannelChange("reversed in sign", key, True, apply)


def _same(samples: FloatArray, _: int) -> FloatArray:
    return samples


def _mirrored(samples: FloatArray, _: int) -> FloatArray:
    return -samples
