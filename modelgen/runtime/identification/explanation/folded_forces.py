"""What a force does between its samples where it bends: neither its record nor a residual shows it.

The spectrum of a force whose slope jumps falls with 1 / f^2, and what lies beyond half the sampling frequency
is folded. A signal that is straight between samples, as a commanded force is that bends at samples, has
1 / sinc(f / fs)^2 times its own spectrum in them, (pi f / fs)^2 / 3 more: at every bend an impulse of minus a
twelfth of what its slope, a sample, grows by. The motion has no such share. What the force has too much looks
like inertia, the same in every record of one motion.

Such effects are of a known size, about 1, if they are there at all; so are lags in place of delays.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from modelgen.array_types import FloatArray, IntArray
from modelgen.runtime.filters.jumps import bends
from modelgen.runtime.identification.explanation.commands.rest_of_commands import rest_of
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.thresholds import LEAST_BENT
from modelgen.runtime.iv.companion_simulation import Simulated
from modelgen.runtime.iv.effect import LOW_PASSES, Changes, Effect, Moved
from modelgen.runtime.iv.freed_effects import Freed
from modelgen.runtime.iv.low_pass import lag_for_delay
from modelgen.runtime.iv.score_tests import Span, moves_within
from modelgen.runtime.least_squares.efficient_weights import block_whiteners
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.least_squares.thresholds import WHITENING_ORDER
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record


def folded_forces(model: Model) -> tuple[Effect, ...]:
    """Return what is folded into each force of a model, of the size 1 where it bends at its samples."""
    remedy = "sample it faster, or all channels behind one low-pass"
    return tuple(
        Effect(f"fold of {key}", "fold", words, words, remedy, partial(_folded, channel=key), key)
        for key, words in ((one.key, f"{one.key} bends between samples") for one in model.actuators)
    )


def bending_forces(model: Model) -> tuple[Effect, ...]:
    """Return the same of each force, of the size 1 where it bends at every sample.

    So does that of a current loop behind a controller that gives a command a sample: no record shows it.
    """
    remedy = "record it more often than its controller acts"
    return tuple(
        Effect(f"bends of {key}", "fold", words, words, remedy, partial(_bent, channel=key), key)
        for key, words in ((one.key, f"{one.key} bends at its samples") for one in model.actuators)
    )


def forces_bend(model: Model, records: Iterable[Record]) -> bool:
    """Tell whether a force bends between samples in any of some records."""
    return any(_bends(record, one.key)[0].size for record in records for one in model.actuators)


def _bends(record: Record, channel: str) -> tuple[IntArray, FloatArray]:
    """Return where a force bends, and by how much, as `bends` does; nowhere in a record without it."""
    if channel not in record.signals:
        return np.zeros(0, dtype=np.int64), np.zeros(0)
    return record.facts.kept(("bends", channel), lambda: bends(record.signals[channel]))


def _folded(simulated: Simulated, channel: str) -> Changes:
    """Return what is folded where the measured force bends; nothing for a record in which it does not."""
    record = simulated.measured
    if record is None:
        return {}
    places, growth = _bends(record, channel)
    if not places.size:
        return {}
    folded = np.zeros(record.n)
    folded[places] = -growth / 12.0
    return {channel: folded}


def _bent(simulated: Simulated, channel: str) -> Changes:
    """Return what is folded into a measured force that bends at every sample, as far as `_folded` has not.

    Of its noise nothing is: it is weighed by the share of the force in each band.
    """
    record = simulated.measured
    if record is None or channel not in record.signals or record.n < 3:
        return {}
    seen, force = record.facts.spectrum(channel), record.signals[channel]
    share = np.clip(1.0 - seen.noise / np.maximum(seen.density, np.finfo(float).tiny), 0.0, 1.0)
    at = np.interp(np.fft.rfftfreq(record.n, record.dt), seen.frequency_hz, share)
    smooth = np.fft.irfft(at * np.fft.rfft(force), record.n)
    folded = np.zeros(record.n)
    folded[1:-1] = -np.diff(smooth, 2) / 12.0
    folded[_bends(record, channel)[0]] = 0.0
    # what a force does that steps is that of commands that are held
    steps = record.facts.jumps(channel)
    folded[np.clip(steps[:, None] + np.arange(-1, 2), 0, record.n - 1)] = 0.0
    return {channel: folded}


@dataclass(frozen=True, eq=False)
class Unsized:
    """Folds of forces where these bend, bends that may be at every sample, and lags in place of delays."""

    folds: tuple[Effect, ...]
    bends: tuple[Effect, ...]
    lags: tuple[Effect, ...]

    @property
    def every(self) -> tuple[Effect, ...]:
        """All of them, in this order."""
        return (*self.folds, *self.bends, *self.lags)


@dataclass(frozen=True, eq=False)
class MovedByUnsized:
    """A mean square, (c, c) in SI; the channels whose bends it holds, and whose lags exceed noise."""

    square: FloatArray
    bent: tuple[str, ...]
    either: tuple[str, ...]


def unsized_effects(job: Job, now: Freed, known: Sequence[Effect]) -> Unsized:
    """Return the effects of sizes about 1 beside those that are known."""
    lags = tuple(_lags_for_delays(job, now, known))
    # it is known of a force that is held where it steps what it does between its samples
    held = {key for key in job.late for record in job.records if rest_of(key) in record.signals}
    bends_of = tuple(one for one in bending_forces(job.model) if one.channel not in held)
    return Unsized(folded_forces(job.model), bends_of, lags)


def moved_by_unsized(span: Span, unsized: Unsized, grown: Sequence[Sequence[FloatArray]]) -> MovedByUnsized:
    """Return what unsized effects move; `grown` is in their order, in SI, (n,) a block."""
    folds, bends = len(unsized.folds), len(unsized.bends)
    square, noise = moves_within(span, grown[:folds]), np.diag(hac_covariance(span.fit, grown=False))
    bent, either = list[str](), list[str]()
    for effect, column in zip(unsized.bends, grown[folds : folds + bends], strict=True):
        # no force bends more, and one that is smooth does not: what hardly shows is not told
        own = moves_within(span, [column], doubtful=True, most=1.0)
        if np.any(np.diag(own) > LEAST_BENT**2 * noise):
            square = square + own
            bent.append(effect.channel)
    for effect, column in zip(unsized.lags, grown[folds + bends :], strict=True):
        own = moves_within(span, [column], doubtful=True)
        square = square + own
        if np.any(np.diag(own) > noise):
            either.append(effect.channel)
    return MovedByUnsized(square, tuple(bent), tuple(either))


def white_moves(job: Job, fit: Fit, slope: FloatArray | None) -> Moved | None:
    """Return what takes a change of the rows of a fit of physical parameters to that of X; None for others.

    `slope` says how X grows with these parameters, in SI, shape (c, p). A change is what Y - W X grows by, in
    SI, (n,) a block; what is estimated beside the parameters, delays say, takes its part of it. Rows that
    have one weight each have another solution where columns are nearly sums of each other: a link that is
    damped much moved by a tenth of what it does beside a delay.
    """
    if fit.carried is None or slope is None:
        return None
    linear, parameters = fit.carried.linear, slope.shape[1]
    white_rows = block_whiteners(fit, job.choice.steps_s(job.records), WHITENING_ORDER)

    def moved(change: Sequence[FloatArray]) -> FloatArray:
        parts = zip(linear.regressors, linear.weights, white_rows, fit.blocks, change, strict=True)
        across = sum(
            one.across(weight**2 * white_of(part[:, None], block.place)[:, 0])
            for one, weight, white_of, block, part in parts
        )
        return np.asarray(slope @ (linear.solution.inverse @ across)[:parameters])

    return moved


def _lags_for_delays(job: Job, now: Freed, known: Sequence[Effect]) -> Iterator[Effect]:
    """Yield a lag for each delay that is estimated: which of the two it is shows at high frequencies only."""
    forces = {one.key for one in job.model.actuators}
    sized: Mapping[Effect, float] = dict(zip(job.effects, job.all_sizes, strict=True)) | dict(
        zip(known, now.sizes, strict=True)
    )
    bent = {one.channel for one in sized if one.kind in LOW_PASSES}
    delays = {channel: delay for channel, delay, _ in now.fit.delays}
    delays |= {one.channel: size for one, size in sized.items() if one.kind == "delay"}
    for channel, delay in delays.items():
        if channel not in bent and delay:
            yield lag_for_delay(channel, delay, channel in forces)
