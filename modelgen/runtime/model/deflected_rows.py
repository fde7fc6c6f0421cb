"""Rows of an arm that hold positions which no sensor has: what is left of them, and their kernel."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from modelgen.runtime.model.arm_channels import ArmChannels, gear
from modelgen.runtime.model.arm_kernel import ArmKernel, Read, Sum
from modelgen.runtime.model.deflected_kernel import (
    DeflectedKernel,
    GivingRow,
    shift_key,
    slope_key,
)

Regressor = tuple[Mapping[int, Sum], ...]
# A position that is made of torques is differentiated twice in the rows of links, or of motors.
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
    kept = tuple(row for row in range(len(module.ROWS)) if row not in rows)
    giving = tuple(
        GivingRow(channel, left[row], regressor[row], _size(module, channel, left, regressor[row]))
        for row, channel in rows.items()
    )
    outer = _moved_lines(kernel, tuple(module.ESTIMATED))
    named = _given_names(module, channels)
    sums: dict[str, Sum] = {}
    places: dict[str, tuple[int, int | None]] = {}
    columns: dict[int, dict[int, Sum]] = {row: {} for row in kept}
    sides: dict[int, Sum] = {}
    for row in kept:
        for column, terms in regressor[row].items():
            columns[row][column] = _line(f"entry {row} {column}", terms, named, sums)
            places |= {key: (row, column) for key in _formed(columns[row][column], sums, kernel)}
        forces = tuple((w, key) for w, key in left[row] if key in channels.forces)
        others = tuple((w, key) for w, key in left[row] if key not in channels.forces)
        others = _line(f"known {row} sum", others, named, sums)
        places |= {key: (row, None) for key in _formed(others, sums, kernel)}
        sides[row] = (*forces, *others)
    held = {key for key in places if key in outer or key in sums}
    touched = tuple(dict.fromkeys(places[key][0] for key in places if key in held))
    reads = _reads(channels)
    made = DeflectedKernel(
        _without_given(kernel, {*kernel.keys} - outer, reads),
        _only(kernel, outer),
        sums,
        places,
        giving,
        reads,
        channels.given,
        touched,
        np.zeros(len(module.BASE_PARAMETERS)),
        all(one["side"] == "motor" or {*one["channels"]} <= {*module.ESTIMATED} for one in module.SENSORS),
    )
    for row in touched:
        for column in made.columns:
            columns[row][column] = (*columns[row].get(column, ()), (1.0, slope_key(row, column)))
        sides[row] = (*sides[row], (1.0, shift_key(row)))
    found = tuple(dict(sorted(columns[row].items())) for row in kept)
    further = {row: FURTHER if row in touched else 0 for row in kept}
    return DeflectedRows(kept, further, found, tuple(sides[row] for row in kept), made)


def _line(key: str, terms: Sum, held: set[str], sums: dict[str, Sum]) -> Sum:
    """Return terms as they are, or as a line of their own where they hold what is given."""
    if not any(name in held for _, name in terms):
        return terms
    sums[key] = terms
    return ((1.0, key),)


def _formed(terms: Sum, sums: Mapping[str, Sum], kernel: ArmKernel) -> list[str]:
    return [key for _, key in terms if key in sums or key in kernel.keys]


def held_positions(kernel: DeflectedKernel, row: int) -> frozenset[str]:
    """Return the channels of given positions that a row holds, or derivatives of which."""
    sums = {name for key, terms in kernel.sums.items() if kernel.places[key][0] == row for _, name in terms}
    lines = {key for key in kernel.kernel.keys if kernel.places[key][0] == row}
    channels = [one.channel for one in kernel.giving]
    found = (
        one for one in channels if sums & _names_of((one,)) or lines & _moved_lines(kernel.kernel, (one,))
    )
    return frozenset(found)


@lru_cache(maxsize=64)
def _moved_lines(kernel: ArmKernel, channels: tuple[str, ...]) -> frozenset[str]:
    """Return the lines that depend on positions which rows give, seen at random samples."""
    rng = np.random.default_rng(0)
    signals = {key: rng.uniform(-1.0, 1.0, 3) for key in kernel.inputs}
    here, given = kernel.lines(signals), _names_of(channels)
    there = kernel.lines({key: value + 0.1 * (key in given) for key, value in signals.items()})
    return frozenset(key for key in kernel.keys if np.any(here[key] != there[key]))


def _names_of(channels: Iterable[str]) -> set[str]:
    """Return the names of positions and of their derivatives."""
    return {f"{front}{key}" for key in channels for front in ("", "d1_", "d2_")}


def _given_names(module: Any, channels: ArmChannels) -> set[str]:
    """Return the names in sums of what no sensor reads: positions, speeds of motors, their directions."""
    found = _names_of(module.ESTIMATED)
    for one in channels.given:
        found.add(f"sign {one.name}")
        found |= {f"{way} {of}" for way in ("forward", "backward") for of in (one.name, one.key)}
    return found


def _only(kernel: ArmKernel, keys: Set[str]) -> ArmKernel:
    """Return a kernel of these lines only."""
    entries = {key: line for key, line in kernel.entries.items() if key in keys}
    left = {key: row for key, row in kernel.left.items() if key in keys}
    return replace(kernel, entries=entries, left=left)


def _without_given(kernel: ArmKernel, keys: Set[str], reads: Mapping[str, Read]) -> ArmKernel:
    """Return a kernel of these lines, which do not depend on what rows give: it is zero to them."""
    read = {key: reads[key] for key in kernel.inputs if key in reads}
    given = (key for key in kernel.inputs if key not in reads)
    forces = (*kernel.forces, *given)
    return replace(_only(kernel, keys), inputs=tuple(read), forces=forces, reads_of=read)


def _size(module: Any, channel: str, left: Sequence[Sum], row: Mapping[int, Sum]) -> tuple[Sum, Sum]:
    """Return sums of channels as large as what the spring carries, and as the motion of its joint."""
    sensor = next(one for one in module.SENSORS if channel in one["channels"])
    if sensor["side"] != "deflection":
        own = left[module.ROWS.index(module.ESTIMATED[channel])]
        springs = [terms for terms in row.values() if any(key == channel for _, key in terms)]
        return own, springs[0] if springs else ()
    joint = sensor["joint"]
    moved = tuple((f, key) for f, key, _ in module.SPEEDS[joint] if key not in module.ESTIMATED)
    lever = gear(module, joint) if module.ROW_KIND == "motor" else 1.0
    return tuple((lever * weight, key) for weight, key in left[module.ROWS.index(joint)]), moved


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
