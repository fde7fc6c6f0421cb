"""The paper's procedure to the letter: record -> rows, sensors low-passed, forces not, columns decimated.

M.T. Pham, Ph. Poignet, M. Gautier, ICRA 2002, sections II and III. What the filter takes from the sensors it
leaves in the forces, so the estimate is biased wherever the filter reaches into the dynamics; the method is
here to be compared with. Published results (the EMPS bench) come out to every printed decimal. What was
published later filters forces as well and leaves slow samples out: both can be asked for.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from modelgen.array_types import BoolArray, FloatArray
from modelgen.errors import DataError
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filters.derivatives import paper_difference
from modelgen.runtime.filters.zero_phase import (
    DECIMATE_ORDER,
    decimation_start,
    matlab_decimate,
    zero_phase,
)
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.masks import direction_keys
from modelgen.runtime.rows.observation import Observation
from modelgen.runtime.rows.row_block import RowBlock


def observe_paper(
    model: Model, records: Sequence[Record], choice: FilterChoice, drop: int = 0
) -> Observation:
    """Return the paper's rows of the records.

    Sensors are low-passed forward and backward, forces only where the choice says so; both are differenced
    alike (order 2, one-sided at the ends). After `drop` samples every column and the left-hand side are
    decimated as MATLAB's `decimate` does. Only samples below the choice's slow speeds are masked.

    Raises
    ------
    DataError
        When a record is too short for its filters.
    """
    blocks: list[RowBlock] = []
    for index, record in enumerate(records):
        factor = choice.decimation[index]
        _check_length(record, choice.filter_order, factor, drop, len(model.base_parameters))
        signals = _signals(model, record, choice)
        Y = matlab_decimate(model.measurement(signals)[drop:], factor)
        D = model.regressor(signals)[drop:]
        W = matlab_decimate(D.reshape(len(D), -1), factor).reshape(len(Y), *D.shape[1:])
        kept = range(drop + decimation_start(record.n - drop, factor), record.n, factor)
        for row, info in enumerate(model.rows):
            fast = _fast(model, row, choice, signals)[kept]
            blocks.append(
                RowBlock(
                    record=index,
                    row=row,
                    record_name=record.name,
                    row_name=info.name,
                    unit=info.unit,
                    place=np.flatnonzero(fast),
                    grid=len(Y),
                    Y=Y[fast, row],
                    W=W[fast, row],
                    masked=int(np.sum(~fast)),
                    has_force=bool(np.any(Y[:, row])),
                    force_scale=1.0,
                    differentiated=info.differentiated,
                )
            )
    return Observation(model.base_parameters, tuple(blocks))


def paper_sentence(filtered_forces: bool) -> str:
    """Return what is said of the filters of these rows."""
    forces = (
        "Sensors and forces are low-passed" if filtered_forces else "Sensors are low-passed, forces are not"
    )
    return f"{forces}; MATLAB's decimate filters all columns."


def _fast(model: Model, row: int, choice: FilterChoice, signals: Mapping[str, FloatArray]) -> BoolArray:
    """Return at which samples, at the full rate, no velocity of a row's friction is slow, shape (n,)."""
    slow, keys = dict(choice.slow_speeds), direction_keys(model, row)
    fast = np.ones(len(next(iter(signals.values()))), dtype=bool)
    for key in keys:
        fast &= np.abs(signals[key]) >= slow.get(key, 0.0)
    return fast


def _signals(model: Model, record: Record, choice: FilterChoice) -> dict[str, FloatArray]:
    """Return every signal of the model at the full rate: sensors low-passed, forces where asked for."""
    channels = [sensor.key for sensor in model.sensors]
    channels += [force.key for force in model.actuators if choice.filtered_forces]
    smooth = {
        key: zero_phase(record.signals[key], choice.filter_order, choice.cutoff_hz, record.fs)
        for key in channels
        if key in record.signals
    }
    signals: dict[str, FloatArray] = {}
    for signal in model.signals:
        channel = signal.sensor or signal.actuator or signal.key
        samples = smooth.get(channel, record.signals[channel])
        signals[signal.key] = paper_difference(samples, record.dt, signal.derivative)
    return signals


def _check_length(record: Record, order: int, factor: int, drop: int, columns: int) -> None:
    needed = drop + max(3 * order, 3 * DECIMATE_ORDER, factor * (columns + 1)) + 1
    if record.n < needed:
        raise DataError.at(
            record.name,
            f"has {record.n} samples; the filters and {columns} columns need at least {needed}",
            "give a longer record",
        )
