"""What noise of forces, and rounding of encoders, add to rows of a fit, to effects and to instruments."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.iv.companion_simulation import Simulated
from modelgen.runtime.iv.effect import Effect
from modelgen.runtime.iv.effect_rows import effect_rows, mismatch_of, rows_of, simulated_records
from modelgen.runtime.iv.instrumental_variables import Setting, instruments
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.records.record import Record


class NoiseRows(NamedTuple):
    """What noise of the forces adds to the rows of a fit, one array a block, in the unit of its row.

    Attributes
    ----------
    residual : tuple of array, shape (n,)
    effects : tuple of tuple of array, shape (n,)
        Per unit of the size of each effect.
    instruments : tuple of array, shape (n, k)
        The columns of the block.
    """

    residual: tuple[FloatArray, ...]
    effects: tuple[tuple[FloatArray, ...], ...]
    instruments: tuple[FloatArray, ...]


def noise_rows(
    fit: Fit,
    setting: Setting,
    simulated: Sequence[Simulated],
    effects: Sequence[Effect],
    grown: Sequence[Sequence[FloatArray]],
    known: Sequence[Effect] = (),
    sizes: Sequence[float] = (),
) -> NoiseRows:
    """Return what noise of the forces adds to the residual, to what each effect does to it, and to columns.

    The simulation is driven by the measured forces: their noise is in both, and looks like a lag. It is drawn
    anew, as large as the record's. `known` act on the simulation, in their sizes; `grown`, what `effect_rows`
    gives of the effects, is one array a block of the fit, in the unit of its row, shape (n,).
    """
    rng = np.random.default_rng(0)
    noisy = []
    for record in setting.records:
        louder = {}
        for actuator in setting.model.actuators:
            if actuator.key in record.signals:
                level = record.facts.spectrum(actuator.key).spread(record.fs)
                louder[actuator.key] = record.signals[actuator.key] + level * rng.standard_normal(record.n)
        noisy.append(record.edited(louder))
    noisy_setting = replace(setting, records=tuple(noisy))
    driven = simulated_records(fit, noisy_setting, known, sizes)
    added = effect_rows(fit, noisy_setting, driven, effects)
    changes = tuple(
        tuple(more - less for more, less in zip(one, other, strict=True))
        for one, other in zip(added, grown, strict=True)
    )
    more, less = (
        instruments(fit, setting, {index: one.record for index, one in enumerate(every)})
        for every in (driven, simulated)
    )
    columns = tuple(one - other for one, other in zip(more, less, strict=True))
    return NoiseRows(next(_added_to_residual(fit, setting, [noisy])), changes, columns)


def rounded_rows(
    fit: Fit, setting: Setting, simulated: Sequence[Simulated], phases: Sequence[float]
) -> Iterator[tuple[FloatArray, ...]]:
    """Yield what encoders add to the residual that round the simulated motion as they did the measured one.

    Rounding follows the motion, and stays where a body rests: what it looks like hangs on where in a step
    that is. `phases` are by what part of a step the first encoder is turned, each next one by as much more.
    There is one array a block of the fit, in the unit of its row, shape (n,), for each phase.
    """
    positions = [sensor.key for sensor in setting.model.sensors if sensor.measures == "position"]

    def rounded(record: Record, exact: Record, phase: float) -> Record:
        coarse = {}
        for place, key in enumerate(key for key in positions if key in record.signals):
            step = record.facts.rounding(key)
            if step > 0.0:
                turned = exact.signals[key] / step + (place + 1) * phase
                coarse[key] = record.signals[key] + step * (np.round(turned) - turned)
        return record.edited(coarse)

    pairs = [*zip(setting.records, simulated, strict=True)]
    every = ([rounded(record, one.record, phase) for record, one in pairs] for phase in phases)
    return _added_to_residual(fit, setting, every)


def _added_to_residual(
    fit: Fit, setting: Setting, edited: Iterable[Sequence[Record]]
) -> Iterator[tuple[FloatArray, ...]]:
    """Yield what edits of the records add to the residual: one array a block of the fit, shape (n,)."""
    terms = mismatch_of(fit, setting)
    plain = [rows_of(setting, record, index).mixed(terms) for index, record in enumerate(setting.records)]
    for records in edited:
        more = [rows_of(setting, record, index).mixed(terms) for index, record in enumerate(records)]
        added = [one - other for one, other in zip(more, plain, strict=True)]
        yield tuple(added[block.record][block.row][block.place] for block in fit.blocks)
