"""How the mismatch Y - W X of a fit's rows grows with the size of an effect that the model lacks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.iv.companion_simulation import Simulated, possible, simulated_beside
from modelgen.runtime.iv.divergence import diverged
from modelgen.runtime.iv.effect import Changes, Effect
from modelgen.runtime.iv.instrumental_variables import Setting, simulation_parameters
from modelgen.runtime.iv.pushed_chain import Pushed
from modelgen.runtime.iv.thresholds import AT_REST, SLOW_QUANTILE, TRIED_SHARE
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.record_rows import unmasked_rows
from modelgen.runtime.rows.row_terms import channels_of_rows, row_terms


def simulated_records(fit: Fit, setting: Setting) -> tuple[Simulated, ...]:
    """Return what a simulation with a fit's parameters reads, record by record.

    Raises
    ------
    IdentifiabilityError
        When the simulation fails.
    """
    return simulated_with(simulation_parameters(setting.model, fit), fit, setting)


def simulated_with(values: Mapping[str, float], fit: Fit, setting: Setting) -> tuple[Simulated, ...]:
    """Return what a simulation with physical parameters (SI) reads; as `simulated_records`."""
    model = setting.model
    parameters = possible(model, values)
    try:
        found = tuple(
            simulated_beside(model, parameters, record, setting.choice, setting.loop, index)
            for index, record in enumerate(setting.records)
        )
    except DataError as error:
        raise diverged(f"its simulation fails ({error.problems[0].what})", fit, model) from error
    slow = _LowSpeeds(found)
    return tuple(replace(one, slow=slow) for one in found)


class _LowSpeeds(dict[str, float]):
    """A speed of each body that is low for it, over all records: a size means the same in each.

    Worked out when it is asked for: one effect does, and not in every round.
    """

    def __init__(self, simulated: Sequence[Simulated]) -> None:
        super().__init__()
        self._simulated = simulated

    def __missing__(self, body: str) -> float:
        speeds = np.abs(np.concatenate([one.motion[f"v_{body}"] for one in self._simulated]))
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
) -> tuple[tuple[FloatArray, ...], ...]:
    """Return d(Y - W X) / d size of each effect: one array a block of the fit, shape (n,).

    `sizes` are those to which the first effects are set right in the channels.
    """
    nothing = [np.zeros(len(block.place)) for block in fit.blocks]
    found = [list(nothing) for _ in effects]
    for record, indices in fit.by_record.items():
        one = simulated[record]
        calm = _mismatch(fit, setting, one.record, record)
        spreads = {key: float(np.std(samples)) for key, samples in one.record.signals.items()}
        for effect, known, rows in zip(effects, (*sizes, *[0.0] * len(effects)), found, strict=False):
            touched, changes = _seen_in(setting.model, effect.added(one, known))
            size = _tried_size(spreads, changes)
            if size == 0.0:
                continue
            changed = _mismatch(fit, setting, _changed(one.record, changes, size), record, touched)
            for index in indices:
                block = fit.blocks[index]
                if block.row in changed:
                    rows[index] = (changed[block.row] - calm[block.row])[block.place] / size
    return tuple(tuple(rows) for rows in found)


def _seen_in(model: Model, changes: Changes) -> tuple[tuple[int, ...], Changes]:
    """Return the rows that changes of channels change, and the changes of the channels of these rows."""
    of_rows = channels_of_rows(model)
    if isinstance(changes, Pushed):
        touched = changes.felt_rows()
    else:
        touched = tuple(row for row, own in enumerate(of_rows) if not own.isdisjoint(changes))
    read = frozenset(key for row in touched for key in of_rows[row])
    return touched, {key: changes[key] for key in changes if key in read}


def noise_rows(
    fit: Fit, setting: Setting, effects: Sequence[Effect], grown: Sequence[Sequence[FloatArray]]
) -> tuple[tuple[FloatArray, ...], tuple[tuple[FloatArray, ...], ...]]:
    """Return what noise of the forces adds to the residual, and to what each effect does to it.

    The simulation is driven by the measured forces: their noise is in both, and looks like a lag. It is drawn
    anew, as large as the record's.

    Returns
    -------
    tuple of array
        One a block of the fit, shape (n,).
    tuple of tuple of array
        Likewise for each effect.
    """
    rng = np.random.default_rng(0)
    noisy = []
    for record in setting.records:
        louder = {}
        for actuator in setting.model.actuators:
            if actuator.key in record.signals:
                density = record.facts.spectrum(actuator.key).noise
                level = float(np.sqrt(0.5 * density * record.fs))
                louder[actuator.key] = record.signals[actuator.key] + level * rng.standard_normal(record.n)
        noisy.append(record.edited(louder))
    noisy_setting = replace(setting, records=tuple(noisy))
    added = effect_rows(fit, noisy_setting, simulated_records(fit, noisy_setting), effects)
    residuals = []
    mismatches = {
        index: (_mismatch(fit, setting, noisy[index], index), _mismatch(fit, setting, record, index))
        for index, record in enumerate(setting.records)
    }
    for block in fit.blocks:
        with_noise, without = mismatches[block.record]
        residuals.append((with_noise[block.row] - without[block.row])[block.place])
    changes = tuple(
        tuple(more - less for more, less in zip(one, other, strict=True))
        for one, other in zip(added, grown, strict=True)
    )
    return tuple(residuals), changes


def _mismatch(
    fit: Fit, setting: Setting, record: Record, index: int, chosen: Sequence[int] | None = None
) -> dict[int, FloatArray]:
    """Return Y - W X of rows of the model, all or some, on a record, at all samples of the grid."""
    model: Model = setting.model
    choice: FilterChoice = setting.choice
    x = fit.all_parameters(model.base_parameters)
    rows = unmasked_rows(model, record, choice, choice.decimation[index], setting.drop)
    every = row_terms(model)
    asked = range(len(every)) if chosen is None else chosen
    return {
        row: lines[-1] - x[list(every[row].columns)] @ lines[:-1]
        for row, lines in zip(asked, rows.lines(asked), strict=True)
    }


def _tried_size(spreads: Mapping[str, float], changes: Changes) -> float:
    """Return the size that is tried, from the standard deviations of the channels."""
    shares = [
        spreads[key] / float(np.max(np.abs(change))) for key, change in changes.items() if np.any(change)
    ]
    return TRIED_SHARE * min(shares, default=0.0)


def _changed(record: Record, changes: Mapping[str, FloatArray], size: float) -> Record:
    return record.edited(
        {key: record.signals[key] + size * change for key, change in changes.items() if key in record.signals}
    )
