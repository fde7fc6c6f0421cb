"""Rows of an arm that hold positions which no sensor has: what is left of them, and their kernel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from modelgen.runtime.model.arm_channels import ArmChannels
from modelgen.runtime.model.arm_kernel import ArmKernel, Read, Sum
from modelgen.runtime.model.deflected_kernel import (
    DeflectedKernel,
    GivingRow,
    shift_key,
    slope_key,
)

Regressor = tuple[Mapping[int, Sum], ...]
# A position that is made of torques is differentiated twice in the rows of links.
FURTHER = 2


@dataclass(frozen=True)
class DeflectedRows:
    """The rows of a module that are not used up for positions: their places, columns and left sides.

    `further` says how much more often than the motion of a row its readings are differentiated, by its place.
    """

    kept: tuple[int, ...]
    further: Mapping[int, int]
    regressor: Regressor
    left: tuple[Sum, ...]
    kernel: DeflectedKernel


def deflected_rows(
    module: Any,
    channels: ArmChannels,
    regressor: Sequence[Mapping[int, Sum]],
    left: Sequence[Sum],
    kernel: ArmKernel,
) -> DeflectedRows:
    """Return the rows of a module whose `ESTIMATED` names channels and the rows that give them.

    Parameters
    ----------
    module
    channels : ArmChannels
        Those that the record has.
    regressor, left
        Of all rows, as sums in which estimated channels still are.
    kernel : ArmKernel
        Lines that are no sums.
    """
    rows = {module.ROWS.index(name): channel for channel, name in module.ESTIMATED.items()}
    estimated = {f"{front}{key}" for key in module.ESTIMATED for front in ("", "d1_", "d2_")}
    giving = tuple(GivingRow(channel, left[row], regressor[row]) for row, channel in rows.items())
    line_of = {place: line for line, place in enumerate(module.ENTRIES)}
    kept = tuple(row for row in range(len(module.ROWS)) if row not in rows)
    entries, known, places = {}, {}, {}
    columns: dict[int, dict[int, Sum]] = {}
    sides: dict[int, Sum] = {}
    for row in kept:
        columns[row] = {}
        for column, terms in regressor[row].items():
            line = line_of[row, column]
            key = f"entry {line}"
            if any(name in estimated or name == key for _, name in terms):
                entries[key], places[key], terms = line, (row, column), ((1.0, key),)
            columns[row][column] = terms
        forces = tuple((w, key) for w, key in left[row] if key in channels.forces)
        others = tuple((w, key) for w, key in left[row] if key not in channels.forces)
        key = f"known {row}"
        if any(name in estimated or name == key for _, name in others):
            known[key], others = row, ((1.0, key),)
        sides[row] = (*forces, *others)
    touched = tuple(dict.fromkeys([*(row for row, _ in places.values()), *known.values()]))
    made = DeflectedKernel(
        ArmKernel(module, kernel.inputs, kernel.forces, entries, known),
        places,
        giving,
        _reads(channels),
        touched,
        np.zeros(len(module.BASE_PARAMETERS)),
    )
    for row in touched:
        for column in made.columns:
            columns[row][column] = (*columns[row].get(column, ()), (1.0, slope_key(row, column)))
        sides[row] = (*sides[row], (1.0, shift_key(row)))
    found = tuple(dict(sorted(columns[row].items())) for row in kept)
    further = {row: FURTHER if row in touched else 0 for row in kept}
    return DeflectedRows(kept, further, found, tuple(sides[row] for row in kept), made)


def _reads(channels: ArmChannels) -> dict[str, Read]:
    """Return what signals are made of: a channel or a feature, and how often it is differentiated."""
    found: dict[str, Read] = {
        str(one["key"]): (str(one["sensor"] or one["actuator"] or one["key"]), int(one["derivative"]))
        for one in channels.signals
    }
    for speed in channels.speeds:
        for name in (
            f"sign {speed.name}",
            *(f"{way} {of}" for way in ("forward", "backward") for of in (speed.name, speed.key)),
        ):
            found[name] = (name, 0)
    return found
