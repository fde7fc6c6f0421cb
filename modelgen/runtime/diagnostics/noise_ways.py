"""What white noise of the sensors does to the columns of rows, to first order, and to their mean.

A column changes by its slope in a derivative of a reading times that derivative of the reading's noise.
Slopes of columns that are linear in the readings are constants. Others change as slowly as the motion, noise
is fast: they are differences, at samples from stretches all over the record, and what counts of them is the
mean of their products over these samples.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np

from modelgen.array_types import FloatArray, IntArray
from modelgen.runtime.diagnostics.noisy_lines import NoisyLines, NoisySquares
from modelgen.runtime.diagnostics.thresholds import SLOPE_SAMPLES, SLOPE_STRETCHES
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filter_choice.signal_to_noise import NoiseBand
from modelgen.runtime.model.arm_kernel import Kernel, Read
from modelgen.runtime.model.deflected_kernel import DeflectedKernel
from modelgen.runtime.model.model import Model, Signal, Terms
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.filter_sections import matched_filtering
from modelgen.runtime.rows.kernel_lines import inner_orders, inner_reach, with_inner
from modelgen.runtime.rows.noise_in_front import noise_in_front
from modelgen.runtime.rows.record_rows import RecordRows, unmasked_rows
from modelgen.runtime.rows.signal_plan import signal_plan


@dataclass(frozen=True, eq=False)
class NoiseWays:
    """Ways of the readings' noise into a row, in SI.

    Attributes
    ----------
    columns : array of int, shape (c,)
        Columns that the row touches, of all the model's.
    slopes : mapping of str to mapping of int to array, shape (c + 1, samples)
        Channel to how often its noise is differentiated to what each column changes by, and last the left
        side; there is one sample where all are linear.
    means : array, shape (c + 1, samples)
        What noise adds to each on average, to second order.
    spread : array, shape (c + 1, c + 1)
        Mean products of what products of noise add to columns and left side about that, behind the low-pass.
    at : tuple of range
        Where the samples are: stretches of the record's samples; none where all are linear.
    """

    columns: IntArray
    slopes: Mapping[str, Mapping[int, FloatArray]]
    means: FloatArray
    spread: FloatArray
    at: tuple[range, ...]

    def of_residual(self, x: FloatArray) -> NoiseWays:
        """Return the ways into Y - W x, a left side without columns; x has shape (columns of the model,)."""
        mixed = np.append(-x[self.columns], 1.0)
        slopes = {
            channel: {order: (mixed @ slope)[None] for order, slope in by_order.items()}
            for channel, by_order in self.slopes.items()
        }
        spread = (mixed @ self.spread @ mixed)[None, None]
        return NoiseWays(self.columns[:0], slopes, (mixed @ self.means)[None], spread, self.at)

    def products(self, channel: str, band: NoiseBand) -> FloatArray:
        """Return the mean products of what noise of a channel adds to columns and left side, (c + 1, c + 1).

        Per unit of the density of that noise, behind the low-pass.
        """
        total: FloatArray = np.zeros((len(self.columns) + 1,) * 2)
        for (one, left), (other, right) in product(self.slopes[channel].items(), repeat=2):
            if (one - other) % 2 == 0:
                alike = (-1.0) ** ((one - other) // 2) * band.moment(one + other)
                total += alike * (left @ right.T) / left.shape[1]
        return total

    def followed(self, channel: str, band: NoiseBand, x: FloatArray, delays_s: FloatArray) -> FloatArray:
        """Return the mean products of Y - W x with each column as it was so long before, shape (c, delays).

        Per unit of the density of a channel's noise, behind the low-pass. `x` has shape (columns of the
        model,), in SI, `delays_s` shape (delays,).
        """
        omega = 2.0 * np.pi * band.frequency_hz
        turned = np.exp(1j * np.outer(omega, delays_s)) * band.power[:, None]
        left, total = self.of_residual(x).slopes[channel], np.zeros((len(self.columns), len(delays_s)))
        for (one, own), (other, row) in product(self.slopes[channel].items(), left.items()):
            # the real part of (-i omega)^one (i omega)^other exp(i omega delay)
            alike = np.real((-1j) ** one * 1j**other * (omega ** (one + other) @ turned))
            total += np.outer(own[:-1] @ row[0] / own.shape[1], alike)
        return total

    def spectrum(self, channel: str, frequency_hz: FloatArray) -> FloatArray:
        """Return the power of what white noise of a channel adds to the left side, shape (n,)."""
        omega, by_order = 2.0 * np.pi * frequency_hz, self.slopes[channel]
        left = np.array([slope[-1] for slope in by_order.values()])
        shared, power = left @ left.T / left.shape[1], np.zeros(len(omega))
        for (i, one), (j, other) in product(enumerate(by_order), repeat=2):
            if (one - other) % 2 == 0:  # the real part of (-i omega)^one (i omega)^other
                power += (-1.0) ** ((one - other) // 2) * shared[i, j] * omega ** (one + other)
        return power


def noise_ways(model: Model, record: Record, choice: FilterChoice, factor: int) -> tuple[NoiseWays, ...]:
    """Return the ways into every row; `factor` is the decimation of the record.

    Rows of elastic arms are made about one point again and again: their ways are looked for once.
    """
    return record.facts.kept((_made_of(model), choice, factor), lambda: _found(model, record, choice, factor))


def _made_of(model: Model) -> Hashable:
    """Return what is the same where ways are: the model, or its rows and the point that they are about."""
    kernel = model.kernel
    if not isinstance(kernel, DeflectedKernel):
        return model
    columns = tuple(tuple(one.items()) for one in model.regressor_columns)
    return kernel.inner, kernel.kernel, kernel.point.tobytes(), columns, model.measurement_columns


def _found(model: Model, record: Record, choice: FilterChoice, factor: int) -> tuple[NoiseWays, ...]:
    kernel = model.kernel
    of_lines: Mapping[str, Mapping[Read, FloatArray]] = {}
    squares = NoisySquares({}, {})
    samples, orders, at = 1, dict[str, int](), tuple[range, ...]()
    if kernel is not None:
        at = _stretches(model, record, choice, factor)
        values = _values(model, kernel, record, choice, factor, at)
        samples, orders = SLOPE_STRETCHES * SLOPE_SAMPLES, dict(kernel.orders)
        lines = NoisyLines(kernel, values, {signal.channel for signal in _readings(model)})
        of_lines, squares = lines.slopes(), lines.squares(partial(noise_in_front, kernel, record, choice))
    plain = {one.key: {(one.channel, one.derivative): np.ones(1)} for one in _readings(model)}
    found = []
    for touched, left in zip(model.regressor_columns, model.measurement_columns, strict=True):
        slopes: dict[str, dict[int, FloatArray]] = {}
        sums: list[Terms] = [*touched.values(), left]
        added = np.zeros((len(sums), samples))
        for place, (weight, key) in ((place, term) for place, terms in enumerate(sums) for term in terms):
            ways = of_lines[key] if key in of_lines else plain.get(key, {})
            for (channel, order), slope in ways.items():
                own = slopes.setdefault(channel, {})
                times = order + orders.get(key, 0)
                if times not in own:
                    own[times] = np.zeros((len(sums), samples))
                own[times][place] += weight * slope
            if key in squares.means and not orders.get(key, 0):  # a mean changes slowly
                added[place] += weight * squares.means[key]
        spread = _products(squares.spread, sums, orders, samples)
        found.append(NoiseWays(np.array(list(touched), dtype=int), slopes, added, spread, at))
    return tuple(found)


def _products(
    spread: Mapping[str, FloatArray], sums: Sequence[Terms], orders: Mapping[str, int], samples: int
) -> FloatArray:
    """Return the mean products of sums of lines, (sums, sums), whose spread is (axes, samples) each."""
    total: FloatArray = np.zeros((len(sums), len(sums)))
    made: dict[int, FloatArray] = {}
    for place, terms in enumerate(sums):
        for weight, key in terms:
            if key in spread and not orders.get(key, 0):
                made[place] = made.get(place, 0.0) + weight * spread[key].ravel()
    if made:
        table, at = np.array(list(made.values())), list(made)
        total[np.ix_(at, at)] = table @ table.T / samples
    return total


def _readings(model: Model) -> list[Signal]:
    """Return the signals that sensors and actuators read: what the record says is carried has no noise."""
    return [one for one in model.signals if (one.sensor or one.actuator) and one.channel not in model.loads]


def _stretches(model: Model, record: Record, choice: FilterChoice, factor: int) -> tuple[range, ...]:
    """Return stretches all over a record, at samples that rows keep."""
    grid = unmasked_rows(model, record, choice, factor).grid
    last = max(len(grid) - SLOPE_SAMPLES, 0)
    starts = np.linspace(0, last, SLOPE_STRETCHES + 2)[1:-1].astype(int) * factor + grid.start
    return tuple(range(start, start + SLOPE_SAMPLES * factor, factor) for start in starts.tolist())


def _values(
    model: Model,
    kernel: Kernel | DeflectedKernel,
    record: Record,
    choice: FilterChoice,
    factor: int,
    at: Sequence[range],
) -> dict[Read, FloatArray]:
    """Return what lines are made of, behind the low-pass, at the samples, shape (samples,) each."""
    inner = inner_orders(kernel)
    step = 1 if inner else factor  # what others are made of is differentiated at the full rate
    plan = signal_plan(model, matched_filtering(choice, record.fs, step), False)
    stencil = plan.filtering.stencil
    reach = inner_reach(kernel, stencil)
    orders: dict[str, list[int]] = {}
    for source, order in (read for read in dict.fromkeys(kernel.reads) if read[0] not in inner):
        orders.setdefault(source, []).append(order)
    found: dict[Read, list[FloatArray]] = {}
    for one in at:
        rows = RecordRows(record, plan, range(one.start - reach, one.stop + reach, step))
        read: dict[Read, FloatArray] = {}
        for source, of in orders.items():
            table = rows.derivatives(source, of)
            read |= {(source, order): table[:, column] for column, order in enumerate(of)}
        for place, value in with_inner(kernel, read, stencil, record.fs).items():
            found.setdefault(place, []).append(value[:: factor // step])
    return {place: np.concatenate(parts) for place, parts in found.items()}
