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

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from numbers import Integral

import numpy as np

from modelgen.errors import DataError
from modelgen.runtime.filter_choice.derivative_noise import (
    HighestDerivative,
    excited_to_hz,
    highest_derivatives,
    quiet_cutoff,
    steep_enough,
)
from modelgen.runtime.filter_choice.explain import (
    lost_note,
    order_sentence,
    ordinal,
    quiet_sentence,
    seen_sentence,
)
from modelgen.runtime.filter_choice.thresholds import (
    ARM_BAND,
    DECIMATION_MARGIN,
    DISTORTION,
    DYNAMICS_SHARE,
    FEWEST_SAMPLES,
    FORCE_SHARE,
    HIGHEST_CUTOFF,
    LOWEST_SAMPLING_RATIO,
    SIGNAL_BAND,
    SIGNAL_CUTOFF,
)
from modelgen.runtime.filters.power_spectrum import band_limit_hz
from modelgen.runtime.model.model import Model, Sensor
from modelgen.runtime.records.record import Record


@dataclass(frozen=True)
class Band:
    """What one record excites: `force_hz` of the forces, `dynamics_hz` common to its bodies, set by `body`.

    `dynamics_hz` and `body` are None where no sensor moves.
    """

    record: str
    force_hz: float
    dynamics_hz: float | None
    body: str | None


@dataclass(frozen=True)
class FilterChoice:
    """Filter settings of one estimation, and the sentences that explain them.

    `decimation` holds one factor per record; frequencies in Hz. `dynamics_hz` is the highest common dynamics
    of the records, None where nothing moves; `notes` are warnings. `signal_cutoff_hz` is that of the wide
    low-pass in front of rows that are nonlinear in their signals (arms), None for others; `slow_speeds` are
    speeds in SI by their sensor, below which rows of the sensor's body leave samples out.
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


def choose_filter(
    model: Model,
    records: Sequence[Record],
    *,
    cutoff_hz: float | None = None,
    filter_order: int | None = None,
    decimation: int | None = None,
    direction_cutoff_hz: float | None = None,
    signal_cutoff_hz: float | None = None,
    matched: bool = True,
) -> FilterChoice:
    """Choose filter order, cut-offs and decimation; what is given is taken as it is.

    One cut-off serves all records, the highest that any of them asks for: a trapezoid alone excites little.
    `matched` only decides what the sentences say of forces and directions of motion.

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
    _check_options(records, hertz, filter_order, decimation)
    highest = highest_derivatives(model, records)
    bands = tuple(
        record_band(model, record, [one.channel for one in highest if not one.spectra[index].lines])
        for index, record in enumerate(records)
    )
    dynamics = max((band.dynamics_hz for band in bands if band.dynamics_hz is not None), default=None)
    sentences = [_band_sentence(band, "speed" if model.is_arm else "acceleration") for band in bands]
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
        order, cutoff, explained, noted = _order_and_cutoff(
            model, records, bands, highest, dynamics * (ARM_BAND if model.is_arm else 1.0), filter_order
        )
        if model.is_arm:
            sentences.append(_arm_sentence(dynamics))
        sentences += explained
        notes += noted
    for one in highest:
        if one.order and not one.still:
            if one.snr_db(cutoff, order)[0] > 0.0:
                sentences.append(seen_sentence(one, cutoff, order))
            else:
                notes.append(lost_note(one))
    motion = dynamics if dynamics and not model.is_arm else cutoff
    direction = float(direction_cutoff_hz or min(motion, cutoff))
    sentences.append(
        f"Directions of motion are the signs of velocities below {direction:.4g} Hz"
        + (" as given." if direction_cutoff_hz else ".")
        if matched
        else "Sensors are low-passed, forces are not; MATLAB's decimate filters all columns."
    )
    wide, said = _signal_cutoff(model, records, cutoff, dynamics, signal_cutoff_hz)
    sentences += said
    factors = tuple(decimation or decimation_for(record.fs, cutoff) for record in records)
    for record, factor in zip(records, factors, strict=True):
        why = "as given" if decimation else "a new Nyquist frequency of 1/0.8 times the cut-off"
        sentences.append(f"{record.name}: every {ordinal(factor)} sample of {record.fs:.6g} Hz ({why}).")
    ratio, explained, noted = _sampling(records, dynamics)
    sentences += explained
    notes += noted
    return FilterChoice(
        order, cutoff, direction, factors, dynamics, ratio, bands, tuple(sentences), tuple(notes), wide
    )


def _arm_sentence(dynamics_hz: float) -> str:
    return (
        f"Joints move up to {dynamics_hz:.4g} Hz; their torques hold products of motions, and friction: "
        f"what counts is {ARM_BAND:g} times that."
    )


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
    wide = float(given or min(max(SIGNAL_BAND * (dynamics_hz or 0.0), SIGNAL_CUTOFF * cutoff_hz), highest))
    why = "as given" if given else "far beyond the motion, which the rows are nonlinear in"
    return wide, [f"Positions are low-passed at {wide:.4g} Hz before that ({why})."]


def _sampling(
    records: Sequence[Record], dynamics_hz: float | None
) -> tuple[float | None, list[str], list[str]]:
    """Return how many times faster than the dynamics is sampled, the sentence that says so, and warnings."""
    if dynamics_hz is None:
        return None, [], []
    ratio = min(record.fs for record in records) / dynamics_hz
    sentence = (
        f"Sampling is {ratio:.0f} times the dynamics; eq. (9) asks for 100 times the closed loop's bandwidth."
    )
    if ratio >= LOWEST_SAMPLING_RATIO:
        return ratio, [sentence], []
    note = (
        f"sampled only {ratio:.1f} times faster than the dynamics, under "
        f"{LOWEST_SAMPLING_RATIO:.0f}: a delay of a fraction of a sample matters; sample faster"
    )
    return ratio, [sentence], [note]


def least_order(model: Model) -> int:
    """Return the order that makes up for the highest derivative, and leaves two orders of roll-off."""
    return max(row.order for row in model.rows) + 2


def record_band(model: Model, record: Record, noise_only: Collection[str] = ()) -> Band:
    """Return what one record excites: steps 1 and 2 of the rule.

    A body of which nothing but noise is read (`noise_only` names such channels) sets no dynamics, unless
    there is nothing else.
    """
    half = 0.5 * record.fs
    used = [actuator.key for actuator in model.actuators if actuator.key in record.signals]
    limits = [band_limit_hz(*record.facts.power(key), FORCE_SHARE, half) for key in used]
    force_hz = max((limit for limit in limits if limit is not None), default=half)
    best = _best_sensors(model)
    shown = {name: sensor for name, sensor in best.items() if sensor.key not in noise_only}
    found: list[tuple[float, str]] = []
    for name, sensor in (shown or best).items():
        # lines of an encoder are most of an acceleration at high frequencies, but little of a speed
        spectrum = record.facts.power(sensor.key, (1 if model.is_arm else 2) - sensor.order)
        limit = band_limit_hz(*spectrum, DYNAMICS_SHARE, force_hz)
        if limit:
            found.append((limit, name))
    # a chain's bodies move together; each joint of an arm moves by itself
    dynamics_hz, body = (max if model.is_arm else min)(found, default=(None, None))
    return Band(record.name, force_hz, dynamics_hz, body)


def distortion_bound_hz(dynamics_hz: float, order: int) -> float:
    """Return the cut-off at which two passes of a Butterworth take 5 % off the amplitude at `dynamics_hz`.

    Their amplitude is 1 / (1 + (f / cutoff)**(2 order)).
    """
    return float(dynamics_hz * (1.0 / DISTORTION - 1.0) ** (1.0 / (2.0 * order)))


def decimation_for(fs: float, cutoff_hz: float) -> int:
    """Return the decimation whose Nyquist frequency is 1/0.8 times the cut-off, at least 1."""
    return max(1, int(np.floor(DECIMATION_MARGIN * fs / (2.0 * cutoff_hz))))


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
    return order, cutoff, sentences, notes


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


def _best_sensors(model: Model) -> dict[str, Sensor]:
    """Return for every sensed body its sensor of the highest order; deflections only if there is no other."""
    best: dict[str, Sensor] = {}
    used = [sensor for sensor in model.sensors if sensor.key in model.channels]
    for sensor in [sensor for sensor in used if sensor.body is not None] or used:
        name = sensor.body or "-".join(sensor.deflection or ())
        if name not in best or sensor.order > best[name].order:
            best[name] = sensor
    return best


def _check_options(
    records: Sequence[Record],
    hertz: Mapping[str, float | None],
    filter_order: int | None,
    decimation: int | None,
) -> None:
    for record in records:
        if record.n < FEWEST_SAMPLES:
            remedy = f"give a longer record, at least {FEWEST_SAMPLES} samples"
            raise DataError.at(record.name, f"has {record.n} samples: too few to filter", remedy)
    half = 0.5 * min(record.fs for record in records)
    for name, value in hertz.items():
        if value is not None and not 0.0 < value < half:
            remedy = f"give a frequency between 0 and half the sampling frequency, {half:g} Hz"
            raise DataError.at(name, f"is {value!r}", remedy)
    for name, count, most in (("filter_order", filter_order, 20), ("decimation", decimation, None)):
        if count is None:
            continue
        if isinstance(count, bool) or not isinstance(count, Integral) or not 1 <= count <= (most or count):
            remedy = "give an integer from 1 to 20" if most else "give an integer, 1 or more"
            raise DataError.at(name, f"is {count!r}", remedy)


def _band_sentence(band: Band, motion: str) -> str:
    start = f"{band.record}: 99.9 % of the force's power lies below {band.force_hz:.4g} Hz"
    if band.dynamics_hz is None:
        return f"{start}; no body moves."
    return f"{start}, and 99.8 % of {band.body}'s {motion} in it below {band.dynamics_hz:.4g} Hz."
