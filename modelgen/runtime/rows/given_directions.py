"""Directions of bodies that a record brings: rows that use samples near reversals take them for their own.

Such rows multiply friction by the sign of a low-passed velocity, which bends where friction jumps and turns
late; and a body that sticks needs less than its friction. Who has simulated the motion knows both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.dropped_friction import SignTerm, sign_terms
from modelgen.runtime.rows.observation import Observation
from modelgen.runtime.rows.record_rows import unmasked_rows


def direction_channel(body: str) -> str:
    """Return the channel of a record that says in which direction a body moves, -1 to 1."""
    return f"direction of {body}"


@lru_cache(maxsize=8)
def signs_of_rows(model: Model) -> tuple[tuple[SignTerm, ...], ...]:
    """Return the signs of velocities in every row."""
    return tuple(sign_terms(model, row) for row in range(len(model.rows)))


def bodies_with_signs(model: Model) -> list[str]:
    """Return the bodies whose direction rows hold, in the order of their names."""
    return sorted({one.body for row in signs_of_rows(model) for one in row})


def brings_directions(model: Model, record: Record) -> bool:
    """Tell whether a record brings the direction of a body of a model."""
    return any(direction_channel(body) in record.signals for body in bodies_with_signs(model))


def with_given_directions(
    observation: Observation,
    model: Model,
    records: Sequence[Record],
    choice: FilterChoice,
    drop: int,
    every: bool = False,
) -> Observation:
    """Return rows with the directions that their records bring; of others those that they have.

    Parameters
    ----------
    observation : Observation
        Of the records.
    model : Model
    records : sequence of Record
    choice : FilterChoice
    drop : int
        As for `observe`.
    every : bool
        Whether all rows are to take them; by default those that use samples near reversals.
    """
    found = list(observation.blocks)
    for index, block in enumerate(found):
        record = records[block.record]
        signs = signs_of_rows(model)[block.row] if every or block.turning else ()
        terms = [one for one in signs if direction_channel(one.body) in record.signals]
        if not terms:
            continue
        rows = unmasked_rows(model, record, choice, choice.decimation[block.record], drop)
        kept = block.kept()
        W = kept.W.copy()
        columns = np.arange(W.shape[1]) if block.touched is None else block.touched
        for one in terms:
            more = rows.derivatives(direction_channel(one.body), (0,)) - rows.derivatives(one.key, (0,))
            W[:, int(np.searchsorted(columns, one.column))] += one.factor * more[block.place, 0]
        found[index] = replace(kept, W=W)
    return replace(observation, blocks=tuple(found))
