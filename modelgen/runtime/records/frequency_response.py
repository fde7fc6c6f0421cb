"""Measured frequency response of one channel over another: H1 with coherence, or means over whole periods.

Segments under Hann's window, half overlapping, give H1 = S_uy / S_uu (Bendat and Piersol 2010, chapter 9). Of
a periodic excitation whole periods are taken, without window or leakage: the means of output and input over
the periods are divided, so that noise of the input biases nothing (Pintelon and Schoukens 2012, section 2.4).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from modelgen.array_types import BoolArray, ComplexArray, FloatArray
from modelgen.errors import DataError
from modelgen.frozen_values import FrozenValues
from modelgen.lazy_accessor import LazyAccessor
from modelgen.magnitudes import is_frequency, shown_number
from modelgen.optional_library import optional_library
from modelgen.runtime.filters.power_spectrum import hann
from modelgen.runtime.records.channels import READ_SAMPLES
from modelgen.runtime.records.period import found_period
from modelgen.runtime.records.thresholds import (
    EXCITED_SHARE,
    EXCITED_STD,
    LOWEST_LINE,
    OVERLAP_CORRELATION,
    SEGMENTS,
    SHORTEST_SEGMENT,
)

if TYPE_CHECKING:
    from modelgen.runtime.records.record import Record

TINY = np.finfo(float).tiny


@dataclass(frozen=True, eq=False)
class FrequencyResponse(FrozenValues):
    """Output over input at `frequency_hz`, shape (lines,), in their units (SI).

    Attributes
    ----------
    record, output, input : str
        Names of the record and of its channels.
    frequency_hz : array, shape (lines,)
        Above zero, ascending; of a periodic input those that it excites.
    response : array of complex, shape (lines,)
    coherence : array, shape (lines,)
        Share of the output's power that the input explains, 0 to 1.
    averages : int
        Segments, or periods, that were averaged.
    period_s : float or None
        The period in s where whole periods were taken.
    """

    record: str
    output: str
    input: str
    frequency_hz: FloatArray
    response: ComplexArray
    coherence: FloatArray
    averages: int
    period_s: float | None = None

    plot = LazyAccessor("modelgen.runtime.plots.response_plots", "ResponsePlot")

    @property
    def std(self) -> FloatArray:
        """Standard deviation of the magnitude that noise makes, shape (lines,); over it, that of the phase.

        |H| sqrt((1 - g^2) / (2 n g^2)) with the coherence g^2 and n independent averages.
        """
        independent: float = self.averages
        if self.period_s is None:
            independent /= 1.0 + 2.0 * OVERLAP_CORRELATION * (1.0 - 1.0 / self.averages)
        unexplained = (1.0 - self.coherence) / np.maximum(self.coherence, TINY)
        return np.asarray(np.abs(self.response) * np.sqrt(unexplained / (2.0 * independent)))

    def to_control(self) -> Any:
        """Return it as ``control.FRD`` of python-control (extra `control`), its frequencies in rad/s.

        Raises
        ------
        DataError
            When control is not installed.
        """
        control = optional_library("control", "control", "to_control")
        omega = 2.0 * np.pi * self.frequency_hz
        return control.frd(self.response, omega, inputs=[self.input], outputs=[self.output], name=self.record)

    def __repr__(self) -> str:
        f = self.frequency_hz
        span = f"{f[0]:.4g} to {f[-1]:.4g} Hz" if f.size else "no lines"
        kind = "segments" if self.period_s is None else "periods"
        return (
            f"FrequencyResponse({self.record}: {self.output} over {self.input}, {span}, "
            f"{f.size} lines, {self.averages} {kind})"
        )


def frequency_response(
    record: Record, output: str, input: str, resolution_hz: float | None, period_s: float | str | None
) -> FrequencyResponse:
    """Return the response of a record; see `Record.frequency_response`."""
    # both are walked through: a sample that is no number is named
    spans = [record.facts.extent(key).span for key in (input, output)]
    if spans[0] == 0.0:
        remedy = "choose an input that moves, usually a measured force"
        raise DataError.at(f"{record.name}: channel {input}", "is constant: it excites nothing", remedy)
    length = _period_samples(record, input, period_s, resolution_hz)
    found = None if length is None else _over_periods(record, output, input, length)
    if found is not None:
        return found
    if period_s not in (None, "none"):
        what = f"is {period_s} s, and {input} does not repeat itself then"
        raise DataError.at(f"{record.name}: period_s", what, "give the excitation's own period, or none")
    return _over_segments(record, output, input, _segment_samples(record, resolution_hz))


def _period_samples(
    record: Record, input: str, period_s: float | str | None, resolution_hz: float | None
) -> int | None:
    """Return the period in samples; None where there is none, or no whole number of them."""
    if period_s == "none":
        return None
    if period_s is None:
        found = found_period(record, (input,)) if resolution_hz is None else None
        return None if found is None else round(found * record.fs)
    where = f"{record.name}: period_s"
    if isinstance(period_s, str) or not 2.0 < period_s * record.fs < np.inf:
        remedy = 'give the period in s, longer than two samples, or "none"'
        raise DataError.at(where, f"is {shown_number(period_s)}", remedy)
    samples = float(period_s) * record.fs
    if abs(samples - round(samples)) > 1e-6 * samples:
        what = f"is {samples:.6g} samples, no whole number of them"
        raise DataError.at(where, what, 'give "none": segments need no whole periods')
    if record.n < 2 * round(samples):
        what = f"is {period_s:g} s, and the record has {record.duration_s:g} s"
        raise DataError.at(where, what, "give a period that the record holds twice at least")
    return round(samples)


def _segment_samples(record: Record, resolution_hz: float | None) -> int:
    if resolution_hz is None:
        length = min(2 * record.n // (SEGMENTS + 1), READ_SAMPLES)
        if length < SHORTEST_SEGMENT:
            fewest = SHORTEST_SEGMENT * (SEGMENTS + 1) // 2
            what = f"has {record.n} samples, too few for {SEGMENTS} segments"
            raise DataError.at(record.name, what, f"record {fewest} samples at least, or give resolution_hz")
        return length - length % 2
    where = f"{record.name}: resolution_hz"
    finest, coarsest = 1.5 * record.fs / record.n, record.fs / SHORTEST_SEGMENT
    if not is_frequency(resolution_hz) or not finest <= resolution_hz <= coarsest:
        remedy = f"give {finest:.4g} to {coarsest:.4g} Hz: two segments of {SHORTEST_SEGMENT} samples or more"
        raise DataError.at(where, f"is {shown_number(resolution_hz)}", remedy)
    length = round(record.fs / resolution_hz)
    return length - length % 2


def _over_segments(record: Record, output: str, input: str, length: int) -> FrequencyResponse:
    """Return H1 and the coherence of half overlapping segments, read one at a time."""
    window, x = hann(length), np.linspace(-1.0, 1.0, length)
    starts = range(0, record.n - length + 1, length // 2)
    Suu, Syy = np.zeros((2, length // 2 + 1))
    Suy: ComplexArray = np.zeros(length // 2 + 1, complex)
    for start in starts:
        lines = []
        for key in (input, output):
            samples = record.read(key, start, start + length)
            centred = samples - samples.mean()
            lines.append(np.fft.rfft(window * (centred - x * (x @ centred) / (x @ x))))
        U, Y = lines
        Suu += np.abs(U) ** 2
        Syy += np.abs(Y) ** 2
        Suy += np.conj(U) * Y
    keep = np.arange(length // 2 + 1) >= LOWEST_LINE
    H: ComplexArray = Suy / np.maximum(Suu, TINY)
    return _response(record, output, input, (Suu, Syy, Suy), H, keep, len(starts))


def _over_periods(record: Record, output: str, input: str, length: int) -> FrequencyResponse | None:
    """Return the quotient of the means over whole periods, the last ones of the record, and the coherence.

    None where no line of the input stands out of how it differs from period to period.
    """
    count = record.n // length
    begin = record.n - count * length
    slopes = {key: _slope(record, key, begin, length, count) for key in (input, output)}
    lines = length // 2 + 1
    sums, squares, Suy = np.zeros((2, lines), complex), np.zeros((2, lines)), np.zeros(lines, complex)
    ramp = np.arange(length, dtype=float)
    for start in range(begin, record.n, length):
        U, Y = (
            np.fft.rfft(record.read(key, start, start + length) - slopes[key] * ramp)
            for key in (input, output)
        )
        sums += U, Y
        squares += np.abs(U) ** 2, np.abs(Y) ** 2
        Suy += np.conj(U) * Y
    mean = np.abs(sums[0]) / count
    scatter = np.sqrt(np.maximum(squares[0] / count - mean**2, 0.0) / max(count - 1, 1))
    keep = (mean > EXCITED_STD * scatter) & (mean > EXCITED_SHARE * mean[1:].max())
    keep[0] = False
    if not keep.any():
        return None
    H = np.asarray(sums[1] / np.where(keep, sums[0], 1.0))
    found = (squares[0], squares[1], Suy)
    return _response(record, output, input, found, H, keep, count, length / record.fs)


def _slope(record: Record, key: str, begin: int, length: int, count: int) -> float:
    """Return by how much a channel rises a sample from period to period: a position travels."""
    ends = [float(np.mean(record.read(key, at, at + length))) for at in (begin, begin + (count - 1) * length)]
    return (ends[1] - ends[0]) / ((count - 1) * length)


def _response(
    record: Record,
    output: str,
    input: str,
    spectra: tuple[FloatArray, FloatArray, ComplexArray],
    H: ComplexArray,
    keep: BoolArray,
    averages: int,
    period_s: float | None = None,
) -> FrequencyResponse:
    Suu, Syy, Suy = spectra
    length = 2 * (len(Suu) - 1) if period_s is None else round(period_s * record.fs)
    frequency_hz = np.asarray(np.fft.rfftfreq(length, record.dt))
    coherence = np.abs(Suy) ** 2 / np.maximum(Suu * Syy, TINY)
    return FrequencyResponse(
        record.name,
        output,
        input,
        frequency_hz[keep],
        np.asarray(H[keep]),
        np.clip(coherence, 0.0, 1.0)[keep],
        averages,
        period_s,
    )
