"""What noise of the sensors does to columns that are nonlinear in the signals, to first order.

A column changes by its slope in a signal times the noise of that signal. Slopes change as slowly as the
motion, noise is fast: a column's noise is that of the signal behind the low-pass, with the mean square of the
slope as its factor. Slopes are differences, at samples from stretches all over the record.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.diagnostics.thresholds import SLOPE_SAMPLES, SLOPE_STEP, SLOPE_STRETCHES
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.model.arm_kernel import Kernel
from modelgen.runtime.model.deflected_kernel import DeflectedKernel
from modelgen.runtime.model.model import Model, Terms
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.filter_sections import matched_filtering
from modelgen.runtime.rows.record_rows import RecordRows
from modelgen.runtime.rows.signal_plan import signal_plan

#: Of a row: channel -> how often its noise is differentiated -> slopes, shape (columns + 1, samples).
RowSlopes = dict[str, dict[int, FloatArray]]


def row_slopes(model: Model, record: Record, choice: FilterChoice, factor: int) -> tuple[RowSlopes, ...]:
    """Return the slopes of every row's columns, of all the model's, and last of its left side.

    `factor` is the decimation of the record.
    """
    kernel = model.kernel
    # rows without one are linear (`channel_terms`), those that springs give have `added_noise`
    assert kernel is not None and not isinstance(kernel, DeflectedKernel)
    signals = {signal.key: signal for signal in model.signals}
    lines = _line_slopes(kernel, _values(model, kernel, record, choice, factor))
    width = len(model.base_parameters)
    found = []
    for touched, left in zip(model.regressor_columns, model.measurement_columns, strict=True):
        slopes: RowSlopes = {}
        columns: list[tuple[int, Terms]] = [*touched.items(), (width, left)]
        for column, terms in columns:
            for weight, key in terms:
                ways = lines[key] if key in lines else {key: np.array(1.0)} if key in signals else {}
                further = kernel.orders.get(key, 0)
                for of, slope in ways.items():
                    order = signals[of].derivative + further
                    own = slopes.setdefault(signals[of].channel, {})
                    if order not in own:
                        own[order] = np.zeros((width + 1, SLOPE_STRETCHES * SLOPE_SAMPLES))
                    own[order][column] += weight * slope
        found.append(slopes)
    return tuple(found)


def shared_noise(slopes: Mapping[int, FloatArray], frequency_hz: FloatArray, power: FloatArray) -> FloatArray:
    """Return the mean products of what noise of one channel adds to columns, shape (columns, columns).

    `power`, shape (n,), is that of the noise in each line behind the low-pass; `slopes` are by the number of
    derivatives, shape (columns, samples) each.
    """
    total: FloatArray = np.zeros(())
    s = 2j * np.pi * frequency_hz
    for one, left in slopes.items():
        for other, right in slopes.items():
            alike = float(np.real(np.conj(s**one) * s**other) @ power)
            total = total + alike * (left @ right.T) / left.shape[1]
    return total


def _values(
    model: Model, kernel: Kernel, record: Record, choice: FilterChoice, factor: int
) -> dict[str, FloatArray]:
    """Return the kernel's signals behind the low-pass at the samples, shape (samples,) each."""
    plan = signal_plan(model, matched_filtering(choice, record.fs, factor), False)
    stride = SLOPE_SAMPLES * factor
    starts = np.linspace(0, max(record.n - stride, 0), SLOPE_STRETCHES + 2)[1:-1].astype(int).tolist()
    grids = [range(start, start + stride, factor) for start in starts]
    signals = {signal.key: signal for signal in model.signals}
    orders: dict[str, list[int]] = {}
    for key in kernel.inputs:
        orders.setdefault(signals[key].channel, []).append(signals[key].derivative)
    tables = {
        channel: np.concatenate([RecordRows(record, plan, grid).derivatives(channel, of) for grid in grids])
        for channel, of in orders.items()
    }
    return {
        key: tables[channel][:, orders[channel].index(signals[key].derivative)]
        for key in kernel.inputs
        for channel in [signals[key].channel]
    }


def _line_slopes(kernel: Kernel, values: Mapping[str, FloatArray]) -> dict[str, dict[str, FloatArray]]:
    """Return d line / d signal at the samples, by line and signal; without those that are zero."""
    found: dict[str, dict[str, FloatArray]] = {key: {} for key in kernel.keys}
    for key, value in values.items():
        size = float(np.sqrt(np.mean(value**2)))
        step = SLOPE_STEP * (size or 1.0)
        above, below = (kernel.lines({**values, key: value + sign * step}) for sign in (1.0, -1.0))
        for line in kernel.keys:
            slope = (above[line] - below[line]) / (2.0 * step)
            if slope.any():
                found[line][key] = slope
    return found
