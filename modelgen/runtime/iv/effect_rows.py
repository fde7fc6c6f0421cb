"""How the mismatch Y - W X of a fit's rows grows with the size of an effect that the model lacks."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import replace
from typing import TypeVar

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.runtime.filters.block_numpy import largest
from modelgen.runtime.iv.companion_simulation import Simulated, followed_closely, simulated_beside
from modelgen.runtime.iv.divergence import simulation_failed
from modelgen.runtime.iv.effect import Changes, Effect
from modelgen.runtime.iv.instrumental_variables import Setting, simulation_parameters
from modelgen.runtime.iv.pushed_chain import Pushed
from modelgen.runtime.iv.pushed_rows import PushedRows
from modelgen.runtime.iv.thresholds import AT_REST, SLOW_QUANTILE, TRIED_SHARE, TURNED_SHARE
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.model.model import Model
from modelgen.runtime.numerics.block_column import BlockColumn
from modelgen.runtime.numerics.threads import each
from modelgen.runtime.records.channels import EditedChannels
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.record_rows import RecordRows, unmasked_rows
from modelgen.runtime.rows.row_terms import channels_of_keys, channels_of_rows, mismatch_terms
from modelgen.runtime.simulation.plant import possible

Found = TypeVar("Found")
# Features that say in which direction a body moves.
DIRECTIONS = ("sign", "forward", "backward")


def simulated_records(
    fit: Fit, setting: Setting, effects: Sequence[Effect] = (), sizes: Sequence[float] = ()
) -> tuple[Simulated, ...]:
    """Return what a simulation with a fit's parameters reads, record by record, with effects that act on it.

    Raises
    ------
    IdentifiabilityError
        When the simulation fails.
    """
    found = simulated_with(simulation_parameters(setting.model, fit), fit, setting)
    for effect, size in zip(effects, sizes, strict=True):
        if effect.acting is not None and effect.possible(size):
            found = tuple(effect.acting(one, size) for one in found)
    return found


def simulated_with(values: Mapping[str, float], fit: Fit, setting: Setting) -> tuple[Simulated, ...]:
    """Return what a simulation with physical parameters (SI) reads; as `simulated_records`."""
    model = setting.model
    parameters = possible(model, values)

    def of(index: int) -> Simulated:
        record = setting.records[index]
        return simulated_beside(model, parameters, record, setting.choice, setting.loop, index)

    found = _simulations(of, fit, setting)
    slow = _LowSpeeds(found)
    return tuple(replace(one, slow=slow) for one in found)


def followed_records(simulated: Sequence[Simulated], fit: Fit, setting: Setting) -> tuple[Simulated, ...]:
    """Return simulations kept close to the records, see `followed_closely`; as `simulated_records`."""
    return _simulations(
        lambda index: followed_closely(simulated[index], setting.choice, setting.loop), fit, setting
    )


def _simulations(of: Callable[[int], Simulated], fit: Fit, setting: Setting) -> tuple[Simulated, ...]:
    try:
        return tuple(_over_records(of, range(len(setting.records)), setting.records))
    except DataError as error:
        raise simulation_failed(error, fit, setting.model) from error


class _LowSpeeds(dict[str, float]):
    """A speed of each body that is low for it, over all records: a size means the same in each.

    Worked out when it is asked for: one effect does, and not in every round.
    """

    def __init__(self, simulated: Sequence[Simulated]) -> None:
        super().__init__()
        self._simulated = simulated

    def __missing__(self, body: str) -> float:
        speeds = np.abs(np.concatenate([one.led[body].speed for one in self._simulated]))
        # a body that sticks has a speed of rounding only
        moving = speeds[speeds > AT_REST * np.max(speeds)]
        self[body] = float(np.quantile(moving, SLOW_QUANTILE)) if moving.size else 1.0
        return self[body]


def effect_rows(
    fit: Fit,
    setting: Setting,
    simulated: Sequence[Simulated],
    effects: Sequence[Effect],
    sizes: Sequence[float] = (),
) -> tuple[BlockColumn, ...]:
    """Return d(Y - W X) / d size of each effect: one array a block of the fit, shape (n,).

    `sizes` are those to which the first effects are set right in the channels.
    """
    if not effects:
        return ()
    reads, every = channels_of_keys(setting.model), mismatch_of(fit, setting)
    # away from reversals a direction stays: that of a body at rest would be one of rounding, at any size
    jumps = {one.key for one in setting.model.features if one.function in DIRECTIONS and one.times is None}

    def of(record: int) -> list[dict[int, FloatArray]]:
        one = simulated[record]
        found: list[dict[int, FloatArray]] = []
        blocks = {index: fit.blocks[index] for index in fit.by_record[record]}
        turning = {block.row for block in blocks.values() if block.turning}
        calm = rows_of(setting, one.record, record)
        pushes = PushedRows(calm)
        for effect, known in zip(effects, (*sizes, *[0.0] * len(effects)), strict=False):
            changes = effect.added(one, known)
            touched, read = _seen_in(setting.model, changes)
            if not _moves(one.record, changes, read):
                found.append({})
                continue
            # what is made of other channels stays as it is
            moved = [
                {
                    key: w
                    for key, w in every[row].items()
                    if (row in turning or key not in jumps) and not read.isdisjoint(reads.get(key, ()))
                }
                for row in touched
            ]
            rows_moved = _moved_rows(pushes, one.record, moved, changes, read, jumps)
            change = dict(zip(touched, rows_moved, strict=True))
            found.append(
                {index: change[row.row][row.place] for index, row in blocks.items() if row.row in change}
            )
        return found

    counts = [block.count for block in fit.blocks]
    rows: list[dict[int, FloatArray]] = [{} for _ in effects]
    for found in _over_records(of, fit.by_record, setting.records):
        for own, made in zip(rows, found, strict=True):
            own |= made
    return tuple(BlockColumn(own, counts) for own in rows)


def _moved_rows(
    pushes: PushedRows,
    record: Record,
    terms: Sequence[Mapping[str, float]],
    changes: Changes,
    read: Set[str],
    jumps: Set[str],
) -> FloatArray:
    """Return what sums of signals and features change per unit of the changes of channels, (sums, grid).

    `read` are the channels that they read. Filters pass what is added to a signal by itself. Features are
    formed with and without a small multiple of it; `jumps`, directions of motion, with a larger one, so that
    many change: one that does by chance would count as thousands.
    """
    calm = pushes.rows
    signals = calm.plan.signals
    linear = [{key: w for key, w in one.items() if key in signals} for one in terms]
    formed = [{key: w for key, w in one.items() if key not in signals} for one in terms]
    own: Changes = {}
    if not isinstance(changes, Pushed) or any(formed):
        own = changes.among(read) if isinstance(changes, Pushed) else {key: changes[key] for key in read}
    if isinstance(changes, Pushed):
        found = pushes.mixed(changes, linear)
    else:
        found = replace(calm, source=EditedChannels(record, record.name, record.n, own)).mixed(linear)
    for jump, share in ((False, TRIED_SHARE), (True, TURNED_SHARE)):
        part = [{key: w for key, w in one.items() if (key in jumps) == jump} for one in formed]
        # a simulation that stays at rest changes by nothing, which no multiple can be formed of
        if any(part) and (size := share * _whole_size(record, own)) > 0.0:
            more = {key: record.signals[key] + size * change for key, change in own.items()}
            changed = replace(calm, source=EditedChannels(record, record.name, record.n, more))
            found += (changed.mixed(part) - calm.mixed(part)) / size
    return found


def _over_records(
    work: Callable[[int], Found], indices: Iterable[int], records: Sequence[Record]
) -> Iterator[Found]:
    """Yield what a function makes of some records, by their places; those in files by a thread each.

    In memory the steps are so short that threads would wait for each other; see `RecordRows.shared_out`.
    """
    every = list(indices)
    files = not all(records[index].in_memory for index in every)
    return each(work, every, len(every)) if files else map(work, every)


def _seen_in(model: Model, changes: Changes) -> tuple[tuple[int, ...], Set[str]]:
    """Return the rows that changes of channels change, and the channels of these rows that are changed."""
    of_rows = channels_of_rows(model)
    if isinstance(changes, Pushed):
        touched = changes.felt_rows()
    else:
        touched = tuple(row for row, own in enumerate(of_rows) if not own.isdisjoint(changes))
    return touched, {key for row in touched for key in of_rows[row]}.intersection(changes)


def _moves(record: Record, changes: Changes, read: Set[str]) -> bool:
    """Tell whether the channels that are read move, and something is added to one of them."""
    if isinstance(changes, Pushed):
        return changes.acts and all(_spread(record, key) for key in read)
    return _whole_size(record, {key: changes[key] for key in read}) > 0.0


def mismatch_of(fit: Fit, setting: Setting) -> tuple[dict[str, float], ...]:
    """Return the weights of signals in Y - W X, row by row of the model."""
    return mismatch_terms(setting.model, fit.all_parameters(setting.model.base_parameters))


def rows_of(setting: Setting, record: Record, index: int) -> RecordRows:
    """Return the rows of a record, the `index`-th, at all samples of the grid."""
    choice = setting.choice
    return unmasked_rows(setting.model, record, choice, choice.decimation[index], setting.drop)


def _whole_size(record: Record, changes: Changes) -> float:
    """Return the size at which what changes is as large as the standard deviation of a channel."""
    peaks = ((key, largest(change)) for key, change in changes.items())
    return min((_spread(record, key) / peak for key, peak in peaks if peak), default=0.0)


def _spread(record: Record, key: str) -> float:
    """Return the standard deviation of a channel, in SI."""
    return record.facts.channels[key].once("spread", lambda: float(np.std(record.signals[key])))
