"""The cut-offs and the decimation, chosen from the records: distortion bounded where the dynamics are.

Pham 2002, section III, asks that the low-pass filter does not distort the dynamics of interest, and that the
record is sampled fast (eq. (9)). Here both are read off the records themselves:

1. force band: below it lies 99.9 % of the force's power; above it nothing was excited;
2. dynamics: within that band, the frequency below which a body's acceleration has 99.8 % of its power, and of
   all sensed bodies the lowest: what every body takes part in;
3. order: the highest derivative plus 2; more where tones stand out beyond the cut-off;
4. cut-off: the filter, run forward and backward, takes 5 % off at that frequency; a lower one where noise is
   more than 1 % of a highest derivative;
5. decimation: the new Nyquist frequency is 1/0.8 times the cut-off.

Power is that of the lines that stand out of a channel's own noise (`spectrum`); `derivative_noise` reads the
spectra for 3 and 4, `filter_sentences` says what was seen.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from numbers import Integral

from modelgen.errors import DataError
from modelgen.magnitudes import is_frequency
from modelgen.runtime.filter_choice.derivative_noise import (
    HighestDerivative,
    excited_to_hz,
    highest_derivatives,
    quiet_cutoff,
    steep_enough,
)
from modelgen.runtime.filter_choice.explain import (
    arm_sentence,
    direction_sentence,
    faster_sentence,
    lost_note,
    order_sentence,
    ordinal,
    quiet_sentence,
    sampling_said,
    seen_sentence,
)
from modelgen.runtime.filter_choice.motion_band import Band, band_sentence, record_band
from modelgen.runtime.filter_choice.record_length import decimation_for, fewest_samples, fitting_cutoff
from modelgen.runtime.filter_choice.thresholds import (
    ARM_BAND,
    DISTORTION,
    FEWEST_SAMPLES,
    HIGHEST_CUTOFF,
    POWER_BANDS,
    SIGNAL_BAND,
    SIGNAL_CUTOFF,
)
from modelgen.runtime.filter_choice.turning_band import FasterTurns, direction_cutoff, faster_turns
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record


@dataclass(frozen=True)
class FilterChoice:
    """Filter settings of one estimation, and the sentences that explain them.

    `decimation` holds one factor per record; frequencies in Hz. `dynamics_hz` is the highest common dynamics
    of the records, None where nothing moves; `notes` are warnings. `signal_cutoff_hz` is that of the wide
    low-pass in front of rows that are nonlinear in their signals (arms), None for others; `slow_speeds` are
    speeds in SI by their sensor, below which rows of the sensor's body leave samples out. `filtered_forces`
    is for the paper's procedure only, which leaves forces as they are unless asked; others filter all. With
    `between` bodies reverse between samples, and not at them; `directions` are the channels from which those
    come that no sensor gives. `faster` are those whose motion beyond `direction_cutoff_hz` counts as well.
    """

    filter_order: int
    cutoff_hz: float
    direction_cutoff_hz: float
    decimation: tuple[int, ...]
    dynamics_hz: float | None
    sampling_ratio: float | None
    bands: tuple[Band, ...]
    sentences: tuple[str, ...]
    notes: tuple[str, ...]
    signal_cutoff_hz: float | None = None
    slow_speeds: tuple[tuple[str, float], ...] = ()
    filtered_forces: bool = False
    between: bool = False
    directions: tuple[tuple[str, tuple[str, ...]], ...] = ()
    faster: tuple[FasterTurns, ...] = ()

    def steps_s(self, records: Sequence[Record]) -> list[float]:
        """Return the time in s between the instants that are used of each record."""
        return [factor / record.fs for factor, record in zip(self.decimation, records, strict=True)]


def choose_filter(
    model: Model,
    records: Sequence[Record],
    *,
    cutoff_hz: float | None = None,
    filter_order: int | None = None,
    decimation: int | None = None,
    direction_cutoff_hz: float | None = None,
    signal_cutoff_hz: float | None = None,
    paper: str | None = None,
) -> FilterChoice:
    """Choose filter order, cut-offs and decimation; what is given is taken as it is.

    One cut-off serves all records, the highest that any of them asks for: a trapezoid alone excites little.
    `paper` is what the sentences say of the paper's procedure, in place of directions of motion.

    Raises
    ------
    DataError
        When an option is out of its range, or nothing moves and no cut-off is given.
    """
    hertz = {
        "cutoff_hz": cutoff_hz,
        "direction_cutoff_hz": direction_cutoff_hz,
        "signal_cutoff_hz": signal_cutoff_hz,
    }
    _check_options(model, records, hertz, filter_order, decimation)
    highest = highest_derivatives(model, records)
    bands = tuple(
        record_band(model, record, [one.channel for one in highest if not one.spectra[index].lines])
        for index, record in enumerate(records)
    )
    dynamics = max((band.dynamics_hz for band in bands if band.dynamics_hz is not None), default=None)
    sentences = [band_sentence(band, "speed" if model.is_arm else "acceleration") for band in bands]
    order = filter_order if filter_order is not None else least_order(model)
    notes: list[str] = []
    if cutoff_hz is not None:
        cutoff = float(cutoff_hz)
        sentences.append(f"Cut-off {cutoff:.4g} Hz as given (order {order}, forward and backward).")
    elif dynamics is None:
        raise DataError.at(
            ", ".join(record.name for record in records),
            "no sensor of a body moves, so no cut-off can be chosen",
            "check the channels, or give cutoff_hz",
        )
    else:
        reach = dynamics * (ARM_BAND if model.is_arm else 1.0)
        sentences += [arm_sentence(dynamics)] if model.is_arm else []
        order, cutoff, explained, noted = _order_and_cutoff(
            model, records, bands, highest, reach, filter_order
        )
        sentences += explained
        notes += noted
    said, lost = _seen(highest, cutoff, order)
    sentences += said
    notes += lost
    direction = float(direction_cutoff_hz or direction_cutoff(model, records, cutoff, dynamics))
    faster = () if paper or direction_cutoff_hz else faster_turns(model, records, direction, cutoff)
    sentences.append(paper or direction_sentence(direction, direction_cutoff_hz is not None))
    sentences += [faster_sentence(one.channel, one.band_hz) for one in faster]
    wide, said = _signal_cutoff(model, records, cutoff, dynamics, signal_cutoff_hz)
    sentences += said
    factors, said = _decimations(records, decimation, cutoff)
    sentences += said
    ratio, explained, noted = sampling_said(records, dynamics)
    sentences += explained
    notes += noted
    found = FilterChoice(order, cutoff, direction, factors, dynamics, ratio, bands, (), (), wide)
    return replace(found, sentences=tuple(sentences), notes=tuple(notes), faster=faster)


def _seen(highest: Sequence[HighestDerivative], cutoff_hz: float, order: int) -> tuple[list[str], list[str]]:
    """Return which highest derivatives stand out of their noise, and warnings of the others."""
    moving = [one for one in highest if one.order and not one.still]
    found = [(one, one.snr_db(cutoff_hz, order)) for one in moving]
    lost = [lost_note(one) for one, (snr_db, _) in found if snr_db <= 0.0]
    return [seen_sentence(one, *best) for one, best in found if best[0] > 0.0], lost


def _decimations(
    records: Sequence[Record], given: int | None, cutoff_hz: float
) -> tuple[tuple[int, ...], list[str]]:
    """Return the factor of each record, and the sentences that say so."""
    factors = tuple(given or decimation_for(record.fs, cutoff_hz) for record in records)
    why = "as given" if given else "a new Nyquist frequency of 1/0.8 times the cut-off"
    return factors, [
        f"{record.name}: every {ordinal(factor)} sample of {record.fs:.6g} Hz ({why})."
        for record, factor in zip(records, factors, strict=True)
    ]


def _signal_cutoff(
    model: Model,
    records: Sequence[Record],
    cutoff_hz: float,
    dynamics_hz: float | None,
    given: float | None,
) -> tuple[float | None, list[str]]:
    """Return the cut-off in Hz in front of rows that are nonlinear in their signals, and what says so."""
    if model.kernel is None:
        return None, []
    highest = HIGHEST_CUTOFF * min(record.fs for record in records)
    band, ratio = (SIGNAL_BAND, SIGNAL_CUTOFF) if model.is_arm else POWER_BANDS
    wide = float(given or min(max(band * (dynamics_hz or 0.0), ratio * cutoff_hz), highest))
    why = "as given" if given else "far beyond the motion, which the rows are nonlinear in"
    return wide, [f"Positions are low-passed at {wide:.4g} Hz before that ({why})."]


def least_order(model: Model) -> int:
    """Return the order that makes up for the highest derivative, and leaves two orders of roll-off."""
    return max(row.order for row in model.rows) + 2


def distortion_bound_hz(dynamics_hz: float, order: int) -> float:
    """Return the cut-off at which two passes of a Butterworth take 5 % off the amplitude at `dynamics_hz`.

    Their amplitude is 1 / (1 + (f / cutoff)**(2 order)).
    """
    return float(dynamics_hz * (1.0 / DISTORTION - 1.0) ** (1.0 / (2.0 * order)))


def _order_and_cutoff(
    model: Model,
    records: Sequence[Record],
    bands: Sequence[Band],
    highest: Sequence[HighestDerivative],
    dynamics_hz: float,
    given: int | None,
) -> tuple[int, float, list[str], list[str]]:
    """Return order and cut-off, sentences that explain them, and warnings; `given` is an order or None."""
    fs = min(record.fs for record in records)
    force_hz = [band.force_hz for band in bands]
    order, sentences = given or least_order(model), []
    if given is None:
        least = order

        def ceiling_for(order: int) -> float:
            return min(distortion_bound_hz(dynamics_hz, order), HIGHEST_CUTOFF * fs)

        order, loud, level_db = steep_enough(highest, least, ceiling_for, excited_to_hz(highest, force_hz))
        sentences.append(order_sentence(order, least, loud, level_db))
    ceiling, explained, notes = _cutoff_from(dynamics_hz, order, fs)
    cutoff, noisy = quiet_cutoff(highest, ceiling, order, max(force_hz))
    sentences.append(explained if noisy is None else quiet_sentence(noisy, cutoff, ceiling, order))
    cutoff, said = fitting_cutoff(model, records, cutoff, order)
    return order, cutoff, sentences + said, notes


def _cutoff_from(dynamics_hz: float, order: int, fs: float) -> tuple[float, str, list[str]]:
    """Return the cut-off, the sentence that explains it, and warnings."""
    cutoff = distortion_bound_hz(dynamics_hz, order)
    highest = HIGHEST_CUTOFF * fs
    if cutoff <= highest:
        sentence = (
            f"Cut-off {cutoff:.4g} Hz: a Butterworth of order {order}, forward and backward, takes 5 % off "
            f"at {dynamics_hz:.4g} Hz."
        )
        return cutoff, sentence, []
    sentence = f"Cut-off {highest:.4g} Hz: {HIGHEST_CUTOFF} of the sampling frequency (order {order})."
    note = f"the dynamics ask for a cut-off of {cutoff:.4g} Hz, more than sampling allows; sample faster"
    return highest, sentence, [note]


def _check_options(
    model: Model,
    records: Sequence[Record],
    hertz: Mapping[str, float | None],
    filter_order: int | None,
    decimation: int | None,
) -> None:
    for record in records:
        if record.n < FEWEST_SAMPLES:
            fewest = max(FEWEST_SAMPLES, fewest_samples(model, least_order(model), record.fs))
            remedy = f"give a longer record, at least {fewest} samples"
            raise DataError.at(record.name, f"has {record.n} samples: too few to filter", remedy)
    half = 0.5 * min(record.fs for record in records)
    for name, value in hertz.items():
        if value is not None and not (is_frequency(value) and value < half):
            remedy = f"give a frequency between 0 and half the sampling frequency, {half:g} Hz"
            raise DataError.at(name, f"is {value!r}", remedy)
    for name, count, most in (("filter_order", filter_order, 20), ("decimation", decimation, None)):
        if count is None:
            continue
        if isinstance(count, bool) or not isinstance(count, Integral) or not 1 <= count <= (most or count):
            remedy = "give an integer from 1 to 20" if most else "give an integer, 1 or more"
            raise DataError.at(name, f"is {count!r}", remedy)
