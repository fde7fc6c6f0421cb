"""Motion of two sensors at low frequencies, where bodies of a chain that nothing holds move as one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modelgen.array_types import ComplexArray, FloatArray
from modelgen.runtime.diagnostics.thresholds import (
    BANDS,
    COHERENCE,
    DEVIATIONS,
    FIRST_BIN,
    FLAT,
    SMALLEST_BAND,
    THIRD_OCTAVE,
)
from modelgen.runtime.model.mechanical_parts import Sensor
from modelgen.runtime.records.record import Record


@dataclass(frozen=True, eq=False)
class Ratios:
    """How many times as much as one sensor says another moves, in the lowest bands where they are coherent.

    `values`, of SI units, below zero where they move against each other; `noise`: by how much that may be off
    in its logarithm because of noise; `squares`: of the frequencies of the motion, lines of the spectrum
    squared. All of shape (bands,).
    """

    values: FloatArray
    noise: FloatArray
    squares: FloatArray


def low_frequency_ratios(record: Record, one: Sensor, other: Sensor) -> Ratios | None:
    """Return how many times as much as `one` says `other` moves, both in SI.

    None where too few bands are coherent, or where the ratio changes with the frequency, or its sign: beyond
    an antiresonance.
    """
    first, second = alike_lines(record, one, other)
    ratios, along, noise, squares = list[float](), list[float](), list[float](), list[float]()
    low = FIRST_BIN
    while low < len(first) and len(ratios) < BANDS:
        band = slice(low, max(low + SMALLEST_BAND, int(THIRD_OCTAVE * low)))
        x, y = first[band], second[band]
        power, product = float(np.vdot(x, x).real), complex(np.vdot(x, y))
        cross = abs(product)
        powers = float(np.vdot(y, y).real)
        largest = float(np.sqrt(power) * np.sqrt(powers))
        if power > 0.0 and cross > COHERENCE * largest > 0.0:
            ratios.append(cross / power)
            along.append(product.real / cross)
            squares.append(float(np.abs(x) ** 2 @ np.arange(band.start, band.start + len(x)) ** 2.0) / power)
            # noise of the first sensor alone lowers the ratio by the square of the coherence
            squared = min(cross / largest, 1.0) ** 2
            noise.append(-np.log(squared) + DEVIATIONS * np.sqrt((1.0 - squared) / (2.0 * squared * len(x))))
        low = band.stop
    if len(ratios) < BANDS or max(ratios) > FLAT * min(ratios) or min(along) < 0.0 < max(along):
        return None
    return Ratios(np.copysign(ratios, np.median(along)), np.asarray(noise), np.asarray(squares))


def alike_lines(record: Record, one: Sensor, other: Sensor) -> tuple[ComplexArray, ComplexArray]:
    """Return the lines of two sensors, (lines,) in SI, both of the same derivative.

    Of a long record where it moves most.
    """
    parts = record.facts.stretches(one.key)
    moves = [float(np.ptp(part)) for part in parts]
    most = moves.index(max(moves))
    first, second = (record.facts.lines(sensor.key, most) for sensor in (one, other))
    derivatives = other.order - one.order
    if derivatives > 0:
        first = _derived(record, one.key, most, derivatives)
    elif derivatives < 0:
        second = _derived(record, other.key, most, -derivatives)
    return first, second


def _derived(record: Record, key: str, part: int, order: int) -> ComplexArray:
    """Return the lines of a derivative of a channel, from differences and under the same window.

    A motion that does not end where it began has lines of its own, which (j omega)^order would take for
    motion.
    """
    samples = record.facts.stretches(key)[part]
    derived = np.diff(samples, order) * record.fs**order
    return np.asarray(np.fft.rfft(derived * np.hanning(len(derived)), len(samples)))
