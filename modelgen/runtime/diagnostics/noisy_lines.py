"""What noise of readings does to the lines of a kernel at samples: their slopes, what it adds on average."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import combinations

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.diagnostics.thresholds import (
    CHANGED_TOGETHER,
    FELT_SQUARES,
    LEAST_LENGTH,
    LEAST_PRODUCT,
    MOST_AXES,
    SLOPE_STEP,
)
from modelgen.runtime.model.arm_kernel import Kernel, Read
from modelgen.runtime.model.deflected_kernel import DeflectedKernel
from modelgen.runtime.rows.kernel_lines import formed
from modelgen.runtime.rows.noise_in_front import NoiseInFront


@dataclass(frozen=True, eq=False)
class NoisySquares:
    """What products of noise add to lines, in SI.

    Attributes
    ----------
    means : mapping of str to array, shape (samples,)
        On average.
    spread : mapping of str to array, shape (products, samples)
        Rms of what varies about that behind the low-pass, of products that are uncorrelated.
    """

    means: Mapping[str, FloatArray]
    spread: Mapping[str, FloatArray]


@dataclass(frozen=True, eq=False)
class NoiseAxis:
    """A principal axis of the derivatives of a channel's noise.

    Attributes
    ----------
    channel : str
    moved : mapping of (str, int) to array, shape (samples,) or ()
        By how much one deviation along it moves what lines are made of, in SI.
    length : float
        One deviation, of derivatives each over its own.
    mixed : array, shape (orders + late,)
        How far noise is along it, in deviations, per unit of each derivative.
    noise : NoiseInFront
        These derivatives.
    """

    channel: str
    moved: Mapping[Read, FloatArray]
    length: float
    mixed: FloatArray
    noise: NoiseInFront


@dataclass(frozen=True, eq=False)
class NoisyLines:
    """The lines of a kernel at values of what makes them, shape (samples,) each, and what is noisy of it."""

    kernel: Kernel | DeflectedKernel
    values: Mapping[Read, FloatArray]
    noisy: Set[str]

    def formed(self, values: Mapping[Read, FloatArray]) -> Mapping[str, FloatArray]:
        """Return the lines, shape (samples,) each in SI, with directions as those of samples."""
        kernel = self.kernel
        return formed(
            kernel.at(kernel.point, sampled=True) if isinstance(kernel, DeflectedKernel) else kernel, values
        )

    @cached_property
    def keys(self) -> tuple[str, ...]:
        """The lines without directions of what is given: these jump, and as measured ones have no noise."""
        if not isinstance(self.kernel, DeflectedKernel):
            return tuple(self.kernel.keys)
        sums, speeds = self.kernel.sums, self.kernel.speeds
        directions = {f"{way} {one.name}" for one in speeds for way in ("sign", "forward", "backward")}
        return tuple(
            key for key in self.kernel.keys if not directions.intersection(k for _, k in sums.get(key, ()))
        )

    @cached_property
    def below(self) -> dict[str, dict[Read, FloatArray]]:
        """Slopes of lines that others are made of, shape (samples,) each, in SI."""
        if not isinstance(self.kernel, DeflectedKernel) or not self.kernel.inner.keys:
            return {}
        inner = self.kernel.inner
        reads = {place: self.values[place] for place in inner.reads_of.values()}
        return _slopes(partial(formed, inner), inner.keys, reads, self.noisy)

    def slopes(self) -> dict[str, dict[Read, FloatArray]]:
        """Return d line / d reading, shape (samples,) each, by line and reading; without those that are zero.

        All is in SI. A line that others are made of takes its noise there, differentiated as often as the
        line is.
        """
        found = _slopes(self.formed, self.keys, self.values, self.noisy | self.below.keys())
        for ways in found.values():
            for key, more in [place for place in ways if place[0] in self.below]:
                along = ways.pop((key, more))
                for (channel, order), slope in self.below[key].items():
                    ways[channel, order + more] = ways.get((channel, order + more), 0.0) + along * slope
        return found

    def squares(self, shared: Callable[[str, Sequence[int]], NoiseInFront]) -> NoisySquares:
        """Return what noise does to lines to second order.

        Along each principal axis of the derivatives of a channel's noise it is what deviations to both sides
        add (Julier and Uhlmann 2004), and along two of them what both add beyond that. `shared` gives these
        derivatives.
        """
        here, axes = self.formed(self.values), self._axes(shared)
        alone = self._beyond(here, [axis.moved for axis in axes])
        means = {key: added.sum(axis=0) for key, added in alone.items()}
        some = _felt(axes, here, alone)
        if not some:
            return NoisySquares(means, {})
        pairs = list(combinations(range(len(some)), 2))
        chosen = [axes[at] for at in some]
        both = self._beyond(here, [_together(chosen[i].moved, chosen[j].moved) for i, j in pairs])
        root = _root_of_products(chosen, [(i, i) for i in range(len(some))] + pairs)
        spread = {}
        for key in list(alone):
            own, together = alone.pop(key)[some], both.pop(key)
            if own.any() or together.any():
                mixed = [together[at] - own[i] - own[j] for at, (i, j) in enumerate(pairs)]
                spread[key] = root @ np.array([*own, *mixed])
        return NoisySquares(means, spread)

    def _beyond(
        self, here: Mapping[str, FloatArray], steps: Sequence[Mapping[Read, FloatArray]]
    ) -> dict[str, FloatArray]:
        """Return what steps to both sides add to lines on average, shape (steps, samples) each."""
        sides = [{read: sign * by for read, by in step.items()} for step in steps for sign in (1.0, -1.0)]
        made = changed(self.formed, self.keys, self.values, sides)
        # one line after the other: of many joints they take hundreds of MB
        return {key: 0.5 * ((one := made.pop(key))[::2] + one[1::2]) - here[key] for key in list(made)}

    def _axes(self, shared: Callable[[str, Sequence[int]], NoiseInFront]) -> list[NoiseAxis]:
        """Return the principal axes of the derivatives of each channel's noise."""
        found = []
        for channel in sorted(self.noisy):
            moves = self._moves(channel)
            orders = sorted({order for ways in moves.values() for order in ways})
            if not orders:
                continue
            noise = shared(channel, orders)
            size = np.sqrt(np.diag(noise.covariance))
            if not size.all():
                continue
            sizes, axes = np.linalg.eigh(noise.covariance / np.outer(size, size))
            for length, axis in zip(np.sqrt(np.maximum(sizes, 0.0)), axes.T, strict=True):
                step = dict(zip([*orders, *noise.late], size * axis * length, strict=True))
                moved = {
                    read: sum(slope * step[order] for order, slope in ways.items())
                    for read, ways in moves.items()
                }
                moved |= {read: np.array(step[read]) for read in noise.late}
                mixed = axis / size / max(length, LEAST_LENGTH)
                found.append(NoiseAxis(channel, moved, float(length), mixed, noise))
        return found

    def _moves(self, channel: str) -> dict[Read, dict[int, FloatArray]]:
        """Return what changes with the noise of a channel, by its derivatives: their slopes."""
        found: dict[Read, dict[int, FloatArray]] = {}
        for source, order in self.values:
            if source == channel:
                found[source, order] = {order: np.ones(1)}
            for (one, own), slope in self.below.get(source, {}).items():
                if one == channel:
                    found.setdefault((source, order), {})[own + order] = slope
        return found


def _felt(
    axes: Sequence[NoiseAxis], here: Mapping[str, FloatArray], alone: Mapping[str, FloatArray]
) -> list[int]:
    """Return which axes have products that matter: those of channels whose squares are a share of lines.

    Their axes of small noise count, too: balances of momentum hold a position's times an acceleration's.
    `here` is (samples,) by line, `alone` what squares add to it, (axes, samples).
    """
    felt = np.zeros(len(axes))
    for key, added in alone.items():
        size = float(np.mean(here[key] ** 2))
        if size > 0.0:
            felt = np.maximum(felt, np.mean(added**2, axis=1) / size)
    of_channel: dict[str, float] = {}
    for axis, share in zip(axes, felt.tolist(), strict=True):
        of_channel[axis.channel] = max(of_channel.get(axis.channel, 0.0), share)
    ranked = sorted(range(len(axes)), key=lambda at: (-of_channel[axes[at].channel], -axes[at].length))
    loud = [at for at in ranked if of_channel[axes[at].channel] > FELT_SQUARES]
    return [at for at in loud if axes[at].length > LEAST_LENGTH][:MOST_AXES]


def _together(one: Mapping[Read, FloatArray], other: Mapping[Read, FloatArray]) -> dict[Read, FloatArray]:
    """Return the sum of two changes."""
    none = np.zeros(1)
    return {read: one.get(read, none) + other.get(read, none) for read in {**one, **other}}


def _root_of_products(axes: Sequence[NoiseAxis], pairs: Sequence[tuple[int, int]]) -> FloatArray:
    """Return a root of the covariance of products of noise along axes, (products, pairs).

    Behind the low-pass. Of normal noise the covariance of two products is the sum of the products of the
    correlations of their parts. A sum that is a derivative, as in balances of momentum, varies little there.
    """
    noise = axes[0].noise
    follow = np.zeros((len(axes), len(axes), len(noise.kept)))
    for channel in sorted({axis.channel for axis in axes}):
        own = [at for at, axis in enumerate(axes) if axis.channel == channel]
        mixed = np.array([axes[at].mixed for at in own])
        follow[np.ix_(own, own)] = axes[own[0]].noise.correlation(mixed)
    table = follow.reshape(len(axes) ** 2, -1)
    fourth = ((table * noise.kept) @ table.T).reshape((len(axes),) * 4)
    i, j = np.array(pairs).T
    shared = fourth[i[:, None], i, j[:, None], j] + fourth[i[:, None], j, j[:, None], i]
    sizes, turned = np.linalg.eigh(shared)
    held = sizes > LEAST_PRODUCT * sizes[-1]
    return np.asarray((turned[:, held] * np.sqrt(sizes[held])).T)


def _slopes(
    lines: Callable[[Mapping[Read, FloatArray]], Mapping[str, FloatArray]],
    keys: Sequence[str],
    values: Mapping[Read, FloatArray],
    noisy: Set[str],
) -> dict[str, dict[Read, FloatArray]]:
    """Return d line / d value at the samples, by line and what is noisy of the values."""
    steps = {
        read: SLOPE_STEP * (float(np.sqrt(np.mean(value**2))) or 1.0)
        for read, value in values.items()
        if read[0] in noisy
    }
    changes = [{read: np.array(sign * step)} for read, step in steps.items() for sign in (1.0, -1.0)]
    found, reads = {key: dict[Read, FloatArray]() for key in keys}, list(steps)
    for first, made in in_parts(lines, keys, values, changes, 2):
        for key, line in made.items():
            width = line[::2] - line[1::2]
            for at in np.flatnonzero(width.any(axis=1)).tolist():  # a line is made of few readings
                read = reads[first // 2 + at]
                found[key][read] = width[at] / (2.0 * steps[read])
    return found


def changed(
    lines: Callable[[Mapping[Read, FloatArray]], Mapping[str, FloatArray]],
    keys: Sequence[str],
    values: Mapping[Read, FloatArray],
    changes: Sequence[Mapping[Read, FloatArray]],
) -> dict[str, FloatArray]:
    """Return lines where values, shape (N,) each, are changed by each of `changes`, shape (changes, N) each.

    A change of what has no value is that of zero. All are in SI.
    """
    found = {key: np.zeros((len(changes), len(next(iter(values.values()))))) for key in keys}
    for first, made in in_parts(lines, keys, values, changes):
        for key, line in made.items():
            found[key][first : first + len(line)] = line
    return found


def in_parts(
    lines: Callable[[Mapping[Read, FloatArray]], Mapping[str, FloatArray]],
    keys: Sequence[str],
    values: Mapping[Read, FloatArray],
    changes: Sequence[Mapping[Read, FloatArray]],
    of: int = 1,
) -> Iterator[tuple[int, dict[str, FloatArray]]]:
    """Yield the first of some changes, and lines where values are changed by them, shape (some, N) each.

    Many changes, a multiple of `of`, are made at once, one behind the other: a line takes as long for a few
    hundred samples as for a few thousand. The other arguments are those of `changed`.
    """
    count = len(next(iter(values.values())))
    most = of * max(1, CHANGED_TOGETHER // (of * count))
    plain = dict[Read, FloatArray]()
    for first in range(0, len(changes), most):
        some = changes[first : first + most]
        plain = plain or {read: np.tile(value, len(some)) for read, value in values.items()}
        known = {read: line[: len(some) * count] for read, line in plain.items()}
        for read in dict.fromkeys(read for one in some for read in one):
            table = known[read].reshape(-1, count).copy() if read in known else np.zeros((len(some), count))
            for line, one in zip(table, some, strict=True):
                if read in one:
                    line += one[read]
            known[read] = table.ravel()
        made = lines(known)
        yield first, {key: np.reshape(made[key], (len(some), count)) for key in keys}
