"""Speeds whose signs a row of an arm holds: its own, and those of what moves positions that it holds."""

from __future__ import annotations

from modelgen.runtime.model.deflected_kernel import DeflectedKernel, GivingRow
from modelgen.runtime.model.deflected_rows import held_positions
from modelgen.runtime.model.model import Model
from modelgen.runtime.rows.masks import own_speeds


def speeds_of_sensors(model: Model, row: int) -> tuple[str, ...]:
    """Return the keys of measured speeds whose signs a row of an arm holds, or what it holds of positions.

    A differentiated row holds no sign, but what friction jumps by at a reversal.
    """
    own = own_speeds(model, row) if model.is_arm else ()
    ways = {feature.key: feature.of for feature in model.features if isinstance(feature.of, str)}
    terms = (terms for one in moving_positions(model, row) for terms in (one.left, *one.columns.values()))
    return tuple(dict.fromkeys((*own, *(ways[key] for part in terms for _, key in part if key in ways))))


def moved_by_friction(model: Model, row: int) -> bool:
    """Tell whether a row holds positions that springs give by rows that hold friction."""
    signs = {feature.key for feature in model.features if isinstance(feature.of, str)}
    giving = (terms for one in moving_positions(model, row) for terms in (one.left, *one.columns.values()))
    return any(key in signs for terms in giving for _, key in terms)


def moving_positions(model: Model, row: int) -> tuple[GivingRow, ...]:
    """Return the rows that give positions which a row holds."""
    kernel = model.kernel
    if not isinstance(kernel, DeflectedKernel) or row not in kernel.rows:
        return ()
    held = held_positions(kernel, row)
    return tuple(one for one in kernel.giving if one.channel in held)


def rests_can_be_open(model: Model, row: int) -> bool:
    """Tell whether sensors say where all speeds whose signs a row of an arm holds are near zero.

    Not where it holds positions that other motors move: with the rests of all motors open, slow motion that
    motors alone see told springs of three joints an order of magnitude less well. A differentiated row has
    no other choice: a mask as wide as its low-pass reaches leaves nothing of a motor that turns often.
    """
    kernel, own = model.kernel, own_speeds(model, row)
    given = isinstance(kernel, DeflectedKernel) and bool(kernel.speeds)
    if not model.is_arm or (given and not model.rows[row].reversals):
        return False
    sensed = {one.key for one in model.signals if one.sensor is not None}
    return bool(own) and sensed.issuperset(own) and speeds_of_sensors(model, row) == own


def rows_with_open_rests(model: Model) -> tuple[int, ...]:
    """Return the rows of a model of which rests can be left open, in place of a mask."""
    return tuple(row for row in range(len(model.rows)) if rests_can_be_open(model, row))
