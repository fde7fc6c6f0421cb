"""The paper's procedure to the letter: record -> rows, sensors low-passed, forces not, columns decimated.

M.T. Pham, Ph. Poignet, M. Gautier, ICRA 2002, sections II and III. What the filter takes from the sensors it
leaves in the forces, so the estimate is biased wherever the filter reaches into the dynamics; the method is
here to be compared with. Published results (the EMPS bench) come out to every printed decimal.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filters.derivatives import paper_difference
from modelgen.runtime.filters.zero_phase import DECIMATE_ORDER, matlab_decimate, zero_phase
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.observation import Observation
from modelgen.runtime.rows.row_block import RowBlock


def observe_paper(
    model: Model, records: Sequence[Record], choice: FilterChoice, drop: int = 0
) -> Observation:
    """Return the paper's rows of the records.

    Sensors are low-passed forward and backward, forces are not; both are differenced alike (order 2,
    one-sided at the ends). After `drop` samples every column and the left-hand side are decimated as MATLAB's
    `decimate` does. No sample is masked.

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
        for row, info in enumerate(model.rows):
            blocks.append(
                RowBlock(
                    record=index,
                    row=row,
                    record_name=record.name,
                    row_name=info.name,
                    unit=info.unit,
                    place=np.arange(len(Y), dtype=np.int64),
                    grid=len(Y),
                    Y=Y[:, row],
                    W=W[:, row],
                    masked=0,
                    has_force=bool(np.any(Y[:, row])),
                    force_scale=1.0,
                    differentiated=info.differentiated,
                )
            )
    return Observation(model.base_parameters, tuple(blocks))


def _signals(model: Model, record: Record, choice: FilterChoice) -> dict[str, FloatArray]:
    """Return every signal of the model at the full rate: sensors low-passed, forces as they are."""
    smooth = {
        sensor.key: zero_phase(record.signals[sensor.key], choice.filter_order, choice.cutoff_hz, record.fs)
        for sensor in model.sensors
        if sensor.key in record.signals
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
