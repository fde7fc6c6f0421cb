"""Channels read otherwise than they were recorded: moved, held, by another clock, behind a filter."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from functools import lru_cache
from math import erfc

import numpy as np

from modelgen.array_types import ComplexArray, FloatArray, IntArray
from modelgen.runtime.filters.power_spectrum import quick_length
from modelgen.runtime.least_squares.thresholds import EDGE_WIDTHS, LAGS, RESOLVED, SHORTEST_REACH, UNDISTORTED
from modelgen.runtime.records.channels import Edit
from modelgen.runtime.records.record import Record

# Points that channels are interpolated through: one delay for all samples, or one that grows.
POINTS, CLOCK_POINTS = 32, 16


def shift(channel: str, by: float) -> Edit:
    """Return what makes samples(k + by) of a channel by Lagrange interpolation through 32 points.

    `by` in samples. Exact for polynomials, so that positions may travel far; at a quarter of the sampling
    frequency off by less than 1e-5, at 0.3 of it by 1e-3: eight points would be a low-pass there.
    """
    whole = int(np.floor(by))
    margin = abs(whole) + POINTS
    weights = [(whole + node, float(weight)) for node, weight in interpolation_weights(by - whole, POINTS)]

    def make(samples: FloatArray, _: int) -> FloatArray:
        n = len(samples) - 2 * margin
        result = np.zeros(n)
        for place, weight in weights:
            if weight:
                result += weight * samples[margin + place : margin + place + n]
        return result

    return Edit(channel, make, margin)


def interpolation_weights(fraction: float | FloatArray, points: int) -> list[tuple[int, FloatArray]]:
    """Return Lagrange's weights of so many neighbours of a place so far behind a sample, by their distance.

    `fraction` in samples, of any shape, which the weights share.
    """
    nodes, scale = _nodes(points)
    products = _products_of_others(fraction, nodes)
    return [(node, np.asarray(one / of)) for node, one, of in zip(nodes, products, scale, strict=True)]


@lru_cache(maxsize=8)
def _nodes(points: int) -> tuple[tuple[int, ...], tuple[float, ...]]:
    """Return so many neighbours, and by what their products are divided: one by itself, at a node."""
    nodes = tuple(place - points // 2 + 1 for place in range(points))
    return nodes, tuple(float(_products_of_others(float(at), nodes)[place]) for place, at in enumerate(nodes))


def _products_of_others(at: float | FloatArray, nodes: Sequence[int]) -> list[float | FloatArray]:
    """Return for each node the product of the distances of a place from all others, shape of the place."""
    before: list[float | FloatArray] = [1.0]
    behind: list[float | FloatArray] = [1.0]
    for node, last in zip(nodes[:-1], nodes[:0:-1], strict=True):
        before.append(before[-1] * (at - node))
        behind.append(behind[-1] * (at - last))
    return [one * other for one, other in zip(before, reversed(behind), strict=True)]


def hold(channel: str, length: float = 1.0, later: float | None = None) -> Edit:
    """Return what a zero-order hold over so many samples makes of a command: late by half, and averaged.

    Late by so many halves of a sample where `later` is given. Frequencies above half the sampling frequency,
    which a hold adds, are left out.
    """
    late = length if later is None else later
    return behind(
        channel, lambda f: np.sinc(length * f) * np.exp(-1j * np.pi * late * f), max(1.0, abs(late))
    )


def plus(channel: str, other: Record, times: float = 1.0) -> Edit:
    """Return a channel with so many times that of another record added."""

    def make(samples: FloatArray, start: int) -> FloatArray:
        return np.asarray(samples + times * other.read(channel, start, start + len(samples)))

    return Edit(channel, make)


def steps_only(record: Record, channels: Collection[str]) -> Record:
    """Return a record whose channels are the sums of the steps they have taken, see `RecordFacts.steps`."""
    return record.edited({key: _sum_of_steps(key, *record.facts.steps(key)) for key in channels})


def _sum_of_steps(channel: str, places: IntArray, sizes: FloatArray) -> Edit:
    total = np.r_[0.0, np.cumsum(sizes)]

    def make(samples: FloatArray, start: int) -> FloatArray:
        at = np.arange(start, start + len(samples))
        return np.asarray(total[np.searchsorted(places, at, side="right")])

    return Edit(channel, make)


def mean_undone(channel: str, length: float) -> Edit:
    """Return the force of which a channel holds means over so many samples before: earlier, and larger.

    What lies above half the sampling frequency folds into means as into samples, and stays.
    """
    return behind(channel, lambda f: np.exp(1j * np.pi * length * f) / np.sinc(length * f), 1.0)


def behind(
    channel: str, response: Callable[[FloatArray], ComplexArray], memory: float, still: float = 1.0
) -> Edit:
    """Return a channel behind a frequency response, which takes frequencies in cycles a sample, shape (n,).

    Parameters
    ----------
    response : callable
        Kept to `UNDISTORTED` of the sampling frequency.
    memory : float
        Time constant in samples.
    still : float
        What it makes of a constant; zero means nothing, to rounding.
    """
    reach = int(np.ceil(LAGS * memory)) + SHORTEST_REACH
    # sampled so finely that the response does not wrap around
    count = quick_length(RESOLVED * reach)
    frequency = np.asarray(np.fft.rfftfreq(count), dtype=float)
    weights = np.fft.irfft(still + _kept(frequency) * (response(frequency) - still), count)
    weights = np.r_[weights[-reach:], weights[: reach + 1]]
    if still:
        weights *= still / weights.sum()
    return Edit(channel, lambda samples, _: np.convolve(samples, weights, "valid"), reach)


def _kept(frequency: FloatArray) -> FloatArray:
    """Return the share of a response that is kept, shape (n,): one up to `UNDISTORTED`, then falling.

    No step at half the sampling frequency, nor in any derivative: behind a Gaussian edge the weights die away
    within the reach, where what is cut off would be an error of the gain.
    """
    middle, width = 0.5 * (UNDISTORTED + 0.5), (0.5 - UNDISTORTED) / (2.0 * EDGE_WIDTHS)
    return np.array([0.5 * erfc((one - middle) / width) for one in frequency.tolist()])


def on_one_clock(channel: str, size: float, record: Record) -> Edit:
    """Return what makes samples at k / fs of those that another clock took at k (1 + size) / fs."""
    margin = int(np.ceil(abs(size) * record.n)) + CLOCK_POINTS

    def make(samples: FloatArray, start: int) -> FloatArray:
        n = len(samples) - 2 * margin
        k = start + np.arange(n)
        by = k / (1.0 + size) - k
        whole = np.floor(by).astype(np.int64)
        place = np.arange(n) + margin + whole
        found = np.zeros(n)
        for node, weight in interpolation_weights(by - whole, CLOCK_POINTS):
            found += weight * samples[place + node]
        return found

    return Edit(channel, make, margin)
