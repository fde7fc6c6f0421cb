"""The highest derivative of each channel behind a filter: signal, noise, and lines that the filter lets by.

A row needs every channel up to some derivative; of these the highest suffers most from the noise. From the
spectra of the readings follow the order and the cut-off that keep what is no signal down to 1 % of its rms:

- the order, from the tones beyond the cut-off and beyond what the forces excite, the hum of a drive or the
  ripple of an encoder: the smallest that takes them down. Friction moves a body up there, too, but not in a
  single line;
- the cut-off, from the noise itself, which grows with the cut-off's power of 2 d + 1 where the signal does
  not: the highest at which the signal stands so far out, as far as half of the signal's power is kept.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf, log10

import numpy as np

from modelgen.runtime.filter_choice.thresholds import (
    CUTOFF_STEP,
    LEAST_KEPT,
    LEAST_SNR_DB,
    MOST_STEEPER,
    STRONGEST,
)
from modelgen.runtime.filters.noise_spectrum import ReadingSpectrum, low_pass, tones
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record


@dataclass(frozen=True, eq=False)
class HighestDerivative:
    """The highest derivative `order` of a channel that the rows need, and the channel's spectra by record.

    `force` says whether an actuator is read.
    """

    channel: str
    order: int
    force: bool
    records: tuple[str, ...]
    spectra: tuple[ReadingSpectrum, ...]

    @property
    def seen(self) -> tuple[int, ...]:
        """The records in which the channel moves."""
        return tuple(index for index, spectrum in enumerate(self.spectra) if spectrum.moves)

    @property
    def still(self) -> bool:
        """Whether the channel reads the same throughout all records: a force at rest has no noise either."""
        return not any(spectrum.density.any() for spectrum in self.spectra)

    def power(self, within_hz: float) -> float:
        """Return the signal's power up to a frequency, of all records."""
        return sum(
            float(np.sum(spectrum.signal(self.order)[spectrum.frequency_hz <= within_hz]))
            for spectrum in self.spectra
        )

    def visible_to_hz(self) -> float | None:
        """Return up to which frequency any record shows it above its noise; None where none does."""
        found = [spectrum.visible_to_hz(self.order) for spectrum in self.spectra]
        return max((hz for hz in found if hz is not None), default=None)

    def snr_db(self, cutoff_hz: float, order: int) -> tuple[float, int]:
        """Return signal against noise behind a filter in dB where it is best, and that record's index."""
        found = []
        for index in self.seen:
            spectrum = self.spectra[index]
            passed = low_pass(spectrum.frequency_hz, cutoff_hz, order) ** 2
            signal = float(np.sum(passed * spectrum.signal(self.order)))
            noise = float(np.sum(passed * spectrum.differentiated(spectrum.noise, self.order)))
            found.append((_decibels(signal, noise), index))
        return max(found, key=lambda one: one[0], default=(-inf, 0))

    def kept(self, cutoff_hz: float, order: int, within_hz: float) -> float:
        """Return which share of `power` a filter keeps."""
        passed = 0.0
        for spectrum in self.spectra:
            inside = spectrum.frequency_hz <= within_hz
            signal = spectrum.signal(self.order)[inside]
            passed += float(np.sum(signal * low_pass(spectrum.frequency_hz[inside], cutoff_hz, order) ** 2))
        return passed / self.power(within_hz)

    def tones_db(self, cutoff_hz: float, order: int, excited_hz: Sequence[float]) -> float:
        """Return the tones beyond cut-off and excitation against the signal within, behind a filter.

        In dB, where it is least; `excited_hz` holds a frequency a record.
        """
        found = []
        for index in self.seen:
            spectrum = self.spectra[index]
            behind = spectrum.signal(self.order) * low_pass(spectrum.frequency_hz, cutoff_hz, order) ** 2
            beyond = spectrum.frequency_hz > max(excited_hz[index], cutoff_hz)
            within = float(behind[~beyond].sum())
            level = _decibels(float(behind[beyond].sum()), within)
            if level > -LEAST_SNR_DB:
                strongest = np.argsort(np.where(beyond, -behind, 0.0), kind="stable")[:STRONGEST]
                alone = tones(spectrum.density, strongest[beyond[strongest]])
                level = _decibels(float(behind[alone].sum()), within)
            found.append(level)
        return min(found, default=-inf)


def highest_derivatives(model: Model, records: Sequence[Record]) -> tuple[HighestDerivative, ...]:
    """Return the highest derivative of every channel that all records hold, in the model's order."""
    orders: dict[str, int] = {}
    forces = {actuator.key for actuator in model.actuators}
    for signal in model.signals:
        channel = signal.sensor or signal.actuator
        if channel is not None and all(channel in record.signals for record in records):
            orders[channel] = max(orders.get(channel, 0), signal.derivative)
    names = tuple(record.name for record in records)
    return tuple(
        HighestDerivative(
            channel,
            order,
            channel in forces,
            names,
            tuple(record.facts.spectrum(channel) for record in records),
        )
        for channel, order in orders.items()
    )


def excited_to_hz(highest: Sequence[HighestDerivative], force_hz: Sequence[float]) -> list[float]:
    """Return up to where the forces excite each record, at the derivative that the rows need of them.

    `force_hz` is where the forces themselves end.
    """
    ends = list(force_hz)
    for one in highest:
        if one.force:
            seen = [spectrum.visible_to_hz(one.order) for spectrum in one.spectra]
            ends = [max(end, hz or 0.0) for end, hz in zip(ends, seen, strict=True)]
    return ends


def steep_enough(
    highest: Sequence[HighestDerivative],
    least: int,
    cutoff_for: Callable[[int], float],
    excited_hz: Sequence[float],
) -> tuple[int, HighestDerivative | None, float]:
    """Return the smallest order from `least` that takes down the tones beyond the cut-off.

    Also the channel that asked for more than `least`, None where none did, and its level in dB at `least`.
    """
    at_least = [one.tones_db(cutoff_for(least), least, excited_hz) for one in highest]
    loudest = max(range(len(highest)), key=at_least.__getitem__, default=None)
    if loudest is None or at_least[loudest] <= -LEAST_SNR_DB:
        return least, None, -inf
    for order in range(least + 1, least + MOST_STEEPER + 1):
        if all(one.tones_db(cutoff_for(order), order, excited_hz) <= -LEAST_SNR_DB for one in highest):
            break
    return order, highest[loudest], at_least[loudest]


def quiet_cutoff(
    highest: Sequence[HighestDerivative], ceiling_hz: float, order: int, within_hz: float
) -> tuple[float, HighestDerivative | None]:
    """Return the highest cut-off up to `ceiling_hz` behind which every derivative is quiet, in Hz.

    Also the channel that asked for less than the ceiling, None where none did. At least half of the power
    that a derivative has up to `within_hz` is kept. Only derivatives of sensors count: noise of a reading
    itself is white, and noise of a force is in no column of W; for both a wider band gives more information.
    """
    # a derivative that no record shows, or only by lines beyond, is warned of: no cut-off brings it back
    sensed = [one for one in highest if one.order > 0 and not one.force and one.power(within_hz) > 0.0]
    asking = [one for one in sensed if one.snr_db(ceiling_hz, order)[0] > -inf]
    loud = [one for one in asking if one.snr_db(ceiling_hz, order)[0] < LEAST_SNR_DB]
    if not loud:
        return ceiling_hz, None
    loudest = min(loud, key=lambda one: one.snr_db(ceiling_hz, order)[0])
    cutoff = ceiling_hz
    while any(one.snr_db(cutoff, order)[0] < LEAST_SNR_DB for one in loud):
        lower = CUTOFF_STEP * cutoff
        if any(one.kept(lower, order, within_hz) < LEAST_KEPT for one in asking):
            break
        cutoff = lower
    return cutoff, loudest if cutoff < ceiling_hz else None


def _decibels(power: float, reference: float) -> float:
    """Return a ratio of powers in dB."""
    if power <= 0.0:
        return -inf
    return 10.0 * log10(power / reference) if reference > 0.0 else inf
