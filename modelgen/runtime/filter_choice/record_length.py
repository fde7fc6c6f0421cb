"""How many samples a filter takes at the ends of a record, and the cut-off at which enough are left."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from modelgen.runtime.filter_choice.thresholds import (
    CUTOFFS_TRIED,
    DECIMATION_MARGIN,
    ENDS_SHARE,
    HIGHEST_CUTOFF,
    LOWEST_CUTOFF,
    SUPPORT_TOLERANCE,
)
from modelgen.runtime.filters.zero_phase import support_samples
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.channels import Channels
from modelgen.runtime.records.record import Record


@lru_cache(maxsize=8)
def deepest_derivative(model: Model) -> int:
    """Return how often the signal that is differentiated most is."""
    return max(signal.derivative for signal in model.signals)


def end_samples(model: Model, order: int, cutoff_hz: float, fs: float) -> int:
    """Return how many samples at either end of a record feel that end, behind the filter of the rows."""
    deepest = deepest_derivative(model)
    return max(support_samples(order, cutoff_hz, fs, k, SUPPORT_TOLERANCE) for k in range(deepest + 1))


def samples_needed(model: Model, order: int, cutoff_hz: float, fs: float, factor: int) -> int:
    """Return how many samples a record needs so that its ends leave one more a row than it has columns."""
    return 2 * end_samples(model, order, cutoff_hz, fs) + factor * (len(model.base_parameters) + 1)


def fewest_samples(model: Model, order: int, fs: float) -> int:
    """Return how many samples a record needs behind the filter that takes the fewest."""
    cutoffs = np.geomspace(LOWEST_CUTOFF, HIGHEST_CUTOFF, CUTOFFS_TRIED) * fs
    return min(samples_needed(model, order, hertz, fs, decimation_for(fs, hertz)) for hertz in cutoffs)


def shorter_ways(model: Model, source: Channels, order: int, cutoff_hz: float, factor: int, drop: int) -> str:
    """Return what makes a record that is too short long enough for its rows: only what does."""
    ways = ["give a longer record"]
    columns, edge = len(model.base_parameters) + 1, end_samples(model, order, cutoff_hz, source.fs)
    if drop > edge and source.n >= 2 * edge + factor * columns:
        ways.append("drop fewer of its samples")
    left = source.n - max(edge, drop) - edge
    if factor > 1 and left >= columns:
        ways.append(f"a decimation of {left // columns} at most")
    given = factor if factor != decimation_for(source.fs, cutoff_hz) else None
    others = [
        hertz
        for hertz in np.geomspace(LOWEST_CUTOFF, HIGHEST_CUTOFF, CUTOFFS_TRIED) * source.fs
        if source.n
        >= max(0, drop - end_samples(model, order, hertz, source.fs))
        + samples_needed(model, order, hertz, source.fs, given or decimation_for(source.fs, hertz))
    ]
    if others:
        ways.append(f"a cut-off of {min(others, key=lambda hertz: abs(np.log(hertz / cutoff_hz))):.4g} Hz")
    return " or ".join(ways)


def decimation_for(fs: float, cutoff_hz: float) -> int:
    """Return the decimation whose Nyquist frequency is 1/0.8 times the cut-off, at least 1."""
    return max(1, int(np.floor(DECIMATION_MARGIN * fs / (2.0 * cutoff_hz))))


def fitting_cutoff(
    model: Model, records: Sequence[Record], cutoff_hz: float, order: int
) -> tuple[float, list[str]]:
    """Return the cut-off in Hz, higher where its ends would be felt nearly everywhere, and what says so.

    Slow motion asks for a low cut-off, whose filter reaches farther than a short record: one that leaves half
    of the record knows more than none.
    """
    found, said = cutoff_hz, []
    for record in records:
        factor = decimation_for(record.fs, cutoff_hz)
        needed = samples_needed(model, order, cutoff_hz, record.fs, factor)
        wanted = min(cutoff_hz * needed / (ENDS_SHARE * record.n), HIGHEST_CUTOFF * record.fs)
        if needed > record.n and wanted > found:
            found = wanted
            said = [
                f"Cut-off {found:.4g} Hz in place of {cutoff_hz:.4g} Hz, whose filter feels the ends "
                f"of {record.name} in nearly all of its {record.n} samples: half of them are left."
            ]
    return found, said
