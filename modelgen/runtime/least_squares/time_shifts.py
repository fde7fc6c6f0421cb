"""Channels read at other instants than they were recorded at: moved, held, or by another clock."""

from __future__ import annotations

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.records.channels import Edit
from modelgen.runtime.records.record import Record

POINTS = 8


def shift(channel: str, by: float) -> Edit:
    """Return what makes samples(k + by) of a channel by Lagrange interpolation through 8 points.

    `by` in samples. Exact for polynomials of degree 7; at a tenth of the sampling frequency off by less than
    1e-4.
    """
    whole = int(np.floor(by))
    margin = abs(whole) + POINTS
    weights = [(whole + node, float(weight)) for node, weight in interpolation_weights(by - whole)]

    def make(samples: FloatArray, _: int) -> FloatArray:
        n = len(samples) - 2 * margin
        result = np.zeros(n)
        for place, weight in weights:
            if weight:
                result += weight * samples[margin + place : margin + place + n]
        return result

    return Edit(channel, make, margin)


def interpolation_weights(fraction: float | FloatArray) -> list[tuple[int, FloatArray]]:
    """Return Lagrange's weights of the neighbours of a place so far behind a sample, by their distance."""
    nodes = np.arange(POINTS) - POINTS // 2 + 1
    found = []
    for node in nodes.tolist():
        others = nodes[nodes != node].tolist()
        weight = np.ones_like(np.asarray(fraction, dtype=float))
        for other in others:
            weight = weight * ((fraction - other) / (node - other))
        found.append((node, weight))
    return found


def hold(channel: str) -> Edit:
    """Return what a zero-order hold makes of a command: late by half a sample, and averaged over one.

    The average over a sample is taken to second order, (1, 22, 1) / 24.
    """
    late = shift(channel, -0.5)

    def make(samples: FloatArray, start: int) -> FloatArray:
        return late.make((samples[:-2] + 22.0 * samples[1:-1] + samples[2:]) / 24.0, start)

    return Edit(channel, make, late.margin + 1)


def on_one_clock(channel: str, size: float, record: Record) -> Edit:
    """Return what makes samples at k / fs of those that another clock took at k (1 + size) / fs."""
    margin = int(np.ceil(abs(size) * record.n)) + POINTS

    def make(samples: FloatArray, start: int) -> FloatArray:
        n = len(samples) - 2 * margin
        k = start + np.arange(n)
        by = k / (1.0 + size) - k
        whole = np.floor(by).astype(np.int64)
        place = np.arange(n) + margin + whole
        found = np.zeros(n)
        for node, weight in interpolation_weights(by - whole):
            found += weight * samples[place + node]
        return found

    return Edit(channel, make, margin)
