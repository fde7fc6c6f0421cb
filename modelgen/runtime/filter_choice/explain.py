"""What the spectra said to the choice of a filter, in sentences."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

from modelgen.runtime.filter_choice.derivative_noise import HighestDerivative
from modelgen.runtime.filter_choice.thresholds import ARM_BAND, LOWEST_SAMPLING_RATIO
from modelgen.runtime.records.record import Record


def order_sentence(order: int, least: int, loud: HighestDerivative | None, level_db: float) -> str:
    """Say why the filter has its order; `level_db` is that of the tones beyond the cut-off at `least`."""
    if loud is None:
        return (
            f"Order {order}: the highest derivative and 2 more; of tones beyond the cut-off and the force's "
            "band it leaves less than 1 % of a highest derivative."
        )
    return (
        f"Order {order} instead of {least}: of tones in {loud.channel} beyond the cut-off and the force's "
        f"band order {least} would leave {percent(level_db)} of its {derivative(loud)}; 1 % is wanted."
    )


def quiet_sentence(loud: HighestDerivative, cutoff_hz: float, ceiling_hz: float, order: int) -> str:
    """Say why the cut-off is lower than the dynamics alone require."""
    before, after = (percent(-loud.snr_db(hz, order)[0]) for hz in (ceiling_hz, cutoff_hz))
    return (
        f"Cut-off {cutoff_hz:.4g} Hz instead of {ceiling_hz:.4g} Hz (order {order}, forward and backward): "
        f"noise is {after} of the {derivative(loud)} of {loud.channel} instead of {before}; 1 % is wanted "
        "as far as half of the power is kept."
    )


def seen_sentence(one: HighestDerivative, snr_db: float, index: int) -> str:
    """Say up to where a derivative stands out of its noise, and by how much behind the filter.

    `snr_db` is where it does most, in the record of this index.
    """
    level = f"; noise is {percent(-snr_db)} of it in {one.records[index]}" if isfinite(snr_db) else ""
    return (
        f"The {derivative(one)} of {one.channel} stands out of its noise up to "
        f"{one.visible_to_hz() or 0.0:.4g} Hz{level}."
    )


def lost_note(one: HighestDerivative) -> str:
    """Return the warning about a derivative that no record shows."""
    where = "in any record" if len(one.records) > 1 else f"in {one.records[0]}"
    return (
        f"the {derivative(one)} of {one.channel}, which the rows need, does not stand out of its noise "
        f"{where}: excite more, use a better sensor, or a sensor set whose rows need less"
    )


def derivative(one: HighestDerivative) -> str:
    """Return "2nd derivative"."""
    return f"{ordinal(one.order)} derivative"


def direction_sentence(direction_hz: float, given: bool) -> str:
    """Say below which frequency directions of motion are taken from speeds."""
    end = " as given." if given else "."
    return f"Directions of motion are the signs of velocities below {direction_hz:.4g} Hz{end}"


def faster_sentence(channel: str, band_hz: float) -> str:
    """Say up to which frequency in Hz a channel's faster motion counts as well."""
    said = f"Where {channel} moves faster than that, above its noise"
    return f"{said}, its velocity below {band_hz:.4g} Hz counts."


def arm_sentence(dynamics_hz: float) -> str:
    """Say up to which frequency what joints do to their torques counts."""
    return (
        f"Joints move up to {dynamics_hz:.4g} Hz; their torques hold products of motions, and friction: "
        f"what counts is {ARM_BAND:g} times that."
    )


def sampling_said(
    records: Sequence[Record], dynamics_hz: float | None
) -> tuple[float | None, list[str], list[str]]:
    """Return how many times faster than the dynamics is sampled, the sentence that says so, and warnings."""
    if dynamics_hz is None:
        return None, [], []
    ratio = min(record.fs for record in records) / dynamics_hz
    asked = "eq. (9) asks for 100 times the closed loop's bandwidth."
    note = (
        f"sampled only {ratio:.1f} times faster than the dynamics, under "
        f"{LOWEST_SAMPLING_RATIO:.0f}: a delay of a fraction of a sample matters; sample faster"
    )
    notes = [note] if ratio < LOWEST_SAMPLING_RATIO else []
    return ratio, [f"Sampling is {ratio:.0f} times the dynamics; {asked}"], notes


def percent(level_db: float) -> str:
    """Return a level in dB as a ratio of rms, in %."""
    return f"{float(f'{100.0 * 10.0 ** (level_db / 20.0):.2g}'):g} %"


def ordinal(number: int) -> str:
    """Return "1st", "2nd", ..."""
    if 10 <= number % 100 <= 20:
        return f"{number}th"
    return f"{number}{ {1: 'st', 2: 'nd', 3: 'rd'}.get(number % 10, 'th') }"
