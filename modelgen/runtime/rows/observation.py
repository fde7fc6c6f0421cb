"""Matched filtering: record -> the rows of Y = W X, every signal through one and the same filter.

y = D x holds at every instant, so it holds for any linear filter of y and D, exactly, as long as the filter
is the same for both: forces, constants and signs of velocities included. The columns are linear in the
signals, so each signal is filtered and differentiated once, and columns are summed at the samples kept.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from modelgen.errors import DataError, Problem
from modelgen.progress import counted
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filters.reversals import reversals, standstills, widen
from modelgen.runtime.model.model import Model, RowInfo
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.filtered_record import FilteredRecord

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
IntArray = npt.NDArray[np.int64]

# A left-hand side below this share of the record's forces counts as none.
LEAST_FORCE = 1e-2
# sign() is meaningless while a mass sticks for longer than this many periods of the cut-off.
STANDSTILL_PERIODS = 2.0


@dataclass(frozen=True, eq=False)
class RowBlock:
    """The samples of one row of the model on one record.

    Attributes
    ----------
    record, row : int
        Index of the record and of the row; `record_name`, `row_name` name them.
    place : array of int, shape (n,)
        Position of each sample on the record's decimated grid of `grid` samples; what is masked is left out.
    Y : array, shape (n,)
        Left-hand side, in `unit`.
    W : array, shape (n, columns)
        Observation matrix.
    masked : int
        Samples of the grid left out.
    has_force : bool
        Whether a force fixes the scale of the row. The left-hand side of a load row is zero, or nearly so
        where its actuator rests.
    force_scale : float
        Rms on the grid of the forces, differentiated as often as the row: the size of what a row balances.
    start : int
        Sample of the record at the grid's first point.
    """

    record: int
    row: int
    record_name: str
    row_name: str
    unit: str
    place: IntArray
    grid: int
    Y: FloatArray
    W: FloatArray
    masked: int
    has_force: bool
    force_scale: float
    differentiated: int
    start: int = 0


@dataclass(frozen=True, eq=False)
class Observation:
    """Rows of Y = W X, one block per record and row of the model; `columns` names the columns of W."""

    columns: tuple[str, ...]
    blocks: tuple[RowBlock, ...]
    notes: tuple[str, ...] = ()


def observe(model: Model, records: Sequence[Record], choice: FilterChoice, drop: int = 0) -> Observation:
    """Return the matched-filtered rows of the records.

    Parameters
    ----------
    model : Model
    records : sequence of Record
        With all of ``model.channels``.
    choice : FilterChoice
        Order, cut-offs and decimation.
    drop : int
        Samples to leave out at the beginning of every record; never fewer than the filter's reach.

    Raises
    ------
    DataError
        When a record is too short for the filter.
    """
    blocks: list[RowBlock] = []
    notes = [f"drop = {drop} samples at the beginning of every record, as given"] if drop else []
    for index, record in enumerate(counted(records, "filtering")):
        signals = FilteredRecord(model, record, choice, choice.decimation[index], drop)
        for row in counted(range(len(model.rows)), f"rows of {record.name}"):
            block = _block(model, signals, index, row)
            blocks.append(block)
            if block.place.size == 0:
                notes.append(
                    f"{record.name}, row {block.row_name}: not used, every sample lies too near to a "
                    "reversal or a standstill"
                )
    return Observation(model.base_parameters, tuple(blocks), tuple(notes))


def runs_of(place: IntArray) -> list[IntArray]:
    """Return the indices of samples that are neighbours on the grid, gap by gap."""
    return np.split(np.arange(len(place)), np.flatnonzero(np.diff(place) != 1) + 1)


def rows_by_tag(
    observation: Observation, records: Sequence[Record], rows_for_tag: Mapping[str, Sequence[str]]
) -> Observation:
    """Return the observation with only those rows that a record's tag may feed; other tags feed all rows.

    Raises
    ------
    DataError
        When a tag is no record's, or a row's name is unknown.
    """
    tags = dict.fromkeys(record.tag for record in records)
    names = dict.fromkeys(block.row_name for block in observation.blocks)
    problems = [
        Problem("rows_for_tag", f"no record has the tag {tag!r}", "give the records' tags")
        for tag in rows_for_tag
        if tag not in tags
    ]
    problems += [
        Problem(f"rows_for_tag[{tag!r}]", f"{row!r} is no row", f"choose from {', '.join(names)}")
        for tag, rows in rows_for_tag.items()
        for row in rows
        if row not in names
    ]
    if problems:
        raise DataError(*problems)
    allowed = [rows_for_tag.get(record.tag or "", tuple(names)) for record in records]
    blocks = tuple(block for block in observation.blocks if block.row_name in allowed[block.record])
    return replace(observation, blocks=blocks)


def _block(model: Model, signals: FilteredRecord, index: int, row: int) -> RowBlock:
    info = model.rows[row]
    masked = _mask(model, signals, row)[signals.grid]
    place = np.flatnonzero(~masked).astype(np.int64)
    Y = signals.sum_of(model.measurement_columns[row])[place]
    W = np.zeros((len(place), len(model.base_parameters)))
    for column, terms in model.regressor_columns[row].items():
        W[:, column] = signals.sum_of(terms)[place]
    force_scale = _force_scale(model, signals, info)
    return RowBlock(
        record=index,
        row=row,
        record_name=signals.record.name,
        row_name=info.name,
        unit=info.unit,
        place=place,
        grid=len(signals.grid),
        Y=Y,
        W=W,
        masked=int(masked.sum()),
        has_force=bool(np.linalg.norm(Y) > LEAST_FORCE * force_scale * np.sqrt(len(Y))),
        force_scale=force_scale,
        differentiated=info.differentiated,
        start=int(signals.grid[0]),
    )


def _force_scale(model: Model, signals: FilteredRecord, info: RowInfo) -> float:
    """Return the rms of all forces on the grid, differentiated as often as the row and in its unit."""
    used = {signal.actuator for signal in model.signals if signal.actuator is not None}
    power = 0.0
    for actuator in model.actuators:
        if actuator.key in used:
            force = signals.smooth(actuator.key, info.differentiated)[signals.grid]
            power += float(np.mean((actuator.lever / info.lever * force) ** 2))
    return float(np.sqrt(power))


def _mask(model: Model, signals: FilteredRecord, row: int) -> BoolArray:
    """Return which samples the row must not use, at the full rate, shape (n,)."""
    info = model.rows[row]
    masked = np.zeros(signals.record.n, dtype=bool)
    late = signals.direction_reach()
    if info.reversals:
        # the row differentiates the friction as often as its order exceeds that of a motion: a jump enters as
        # an impulse, differentiated once less
        reach = max(signals.reach(k) for k in range(max(1, info.order - 2))) + late
        for key in info.reversals:
            masked |= widen(reversals(signals.direction(key)), reach)
        return masked
    shortest = int(np.ceil(STANDSTILL_PERIODS * signals.record.fs / signals.choice.cutoff_hz))
    for key in direction_keys(model, row):
        masked |= widen(standstills(signals.direction(key), shortest), signals.reach(0) + late)
    return masked


def direction_keys(model: Model, row: int) -> tuple[str, ...]:
    """Return the signals whose sign enters a row."""
    used = dict.fromkeys(key for terms in model.regressor_columns[row].values() for _, key in terms)
    signs = [feature.of for feature in model.features if feature.key in used and isinstance(feature.of, str)]
    brought = [
        signal.key
        for signal in model.signals
        if signal.key in used and signal.sensor is None and signal.actuator is None
    ]
    return tuple(dict.fromkeys(signs + brought))
