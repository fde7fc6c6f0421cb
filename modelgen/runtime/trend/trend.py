"""What has changed over the estimates of one machine: which quantity, since which entry, by how much."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from modelgen.array_types import BoolArray, IntArray
from modelgen.errors import DataError
from modelgen.runtime.numerics.heterogeneity import Heterogeneity, heterogeneity, holm
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.trend.change_point import Difference, largest_difference
from modelgen.runtime.trend.series import Series, all_series
from modelgen.runtime.trend.thresholds import ENTRIES_A_CHANGE, FALSE_ALARMS, MOST_ENTRIES, Z95


@dataclass(frozen=True)
class Change:
    """A change of one quantity.

    Attributes
    ----------
    entry : int
        The first entry at which it shows.
    last : int or None
        The last one; None where it lasts.
    before, after : float
        Weighted means of the other entries and of these, up to the neighbouring changes.
    difference, std : float
        after - before, and its standard deviation.
    p_value : float
        How probable so large a change is by chance, all quantities taken together (Holm).
    """

    entry: int
    last: int | None
    before: float
    after: float
    difference: float
    std: float
    p_value: float

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the difference."""
        return self.difference - Z95 * self.std, self.difference + Z95 * self.std


@dataclass(frozen=True, eq=False)
class QuantityTrend:
    """One quantity over the entries.

    Attributes
    ----------
    series : Series
    changes : tuple of Change
        In the order of the entries; none where chance explains the series.
    p_value : float
        How probable its largest change is by chance, all quantities taken together.
    scatter : Heterogeneity
        What entries scatter about their means, between changes, beyond their standard deviations.
    scatters : bool
        Whether they do; such a scatter is in the standard deviations of the changes.
    levels : array of int, shape (k,)
        A number for every entry, the same for those between the same changes.
    """

    series: Series
    changes: tuple[Change, ...]
    p_value: float
    scatter: Heterogeneity
    scatters: bool
    levels: IntArray


@dataclass(frozen=True, eq=False)
class Trend:
    """What has changed: labels of the entries, quantities in the order of the estimates, notes."""

    labels: tuple[str, ...]
    quantities: tuple[QuantityTrend, ...]
    notes: tuple[str, ...]

    @property
    def changed(self) -> tuple[QuantityTrend, ...]:
        """The quantities that have changed, that of the earliest change first."""
        found = [one for one in self.quantities if one.changes]
        return tuple(sorted(found, key=lambda one: one.changes[0].entry))


def trend(estimates: Sequence[Estimate], labels: Sequence[str]) -> Trend:
    """Test what has changed over estimates of one machine, in their order.

    Of histories without a change, 5 % are said to have one, all quantities taken together (Holm).

    Parameters
    ----------
    estimates : sequence of Estimate
        At least two, of one chain.
    labels : sequence of str
        What each is called: a date, a name.

    Raises
    ------
    DataError
        When there are fewer than two or too many, or they are of different chains.
    """
    _check(estimates)
    series = all_series(estimates)
    tested = [one for one in series if len(one.values) > 1]
    if not tested:
        remedy = "give estimates that share a parameter or mode with a standard deviation"
        raise DataError.at("estimates", "have no quantity in common", remedy)
    judged = [_judged(one, FALSE_ALARMS / len(tested)) for one in tested]
    p_values = holm([one.first.p_value for one in judged])
    quantities = [
        QuantityTrend(one, found.changes(p), p, found.scatter, found.scatters, found.levels(p))
        for one, found, p in zip(tested, judged, p_values, strict=True)
    ]
    return Trend(tuple(labels), tuple(quantities), _notes(estimates, labels, series))


@dataclass(frozen=True, eq=False)
class _Judged:
    """A series by itself: its largest difference, all of them, and the scatter about what is between."""

    series: Series
    first: Difference
    differences: tuple[tuple[IntArray, Difference], ...]
    scatter: Heterogeneity
    scatters: bool

    def changes(self, p_value: float) -> tuple[Change, ...]:
        """Return the differences as changes, none where that of the largest one may be chance."""
        if p_value >= FALSE_ALARMS:
            return ()
        last = self.series.entries[-1]
        found = [
            Change(
                int(entries[0]),
                None if entries[-1] == last else int(entries[-1]),
                one.before,
                one.after,
                one.after - one.before,
                one.std,
                # what follows the largest one passed a limit of its quantity alone
                p_value if one is self.first else one.p_value,
            )
            for entries, one in self.differences
        ]
        return tuple(sorted(found, key=lambda change: change.entry))

    def levels(self, p_value: float) -> IntArray:
        """Return a number for every entry, the same for those between the same changes."""
        return segments(self.series, [one for one, _ in self.differences] if p_value < FALSE_ALARMS else [])


def _judged(series: Series, level: float) -> _Judged:
    """Judge a series; what scatters within the sides of a change would have made it, and widens it."""
    variances = series.noise**2 + series.drift**2
    first = largest_difference(series)
    found = _differences(series, first, level)
    scatter = heterogeneity(series.values, variances, segments(series, [one for one, _ in found]))
    if len(found) <= max(1, len(series.values) // ENTRIES_A_CHANGE) and scatter.p_value >= level:
        return _Judged(series, first, found, scatter, False)
    scatter = heterogeneity(series.values, variances, segments(series, [found[0][0]]))
    wide = replace(series, noise=np.hypot(series.noise, scatter.between_std))
    first = largest_difference(wide)
    return _Judged(series, first, _differences(wide, first, level), scatter, True)


def _differences(series: Series, first: Difference, level: float) -> tuple[tuple[IntArray, Difference], ...]:
    """Return the largest difference with its entries, then those on both of its sides, each below `level`."""
    found: list[tuple[IntArray, Difference]] = []
    pending = [(series, first)]
    while pending:
        part, one = pending.pop(0)
        place = np.arange(len(part.values))
        inside = (place >= one.place) & (place < one.end)
        found.append((part.entries[inside], one))
        if one.p_value >= FALSE_ALARMS:
            break  # the largest one is chance, and so are all
        for side in (~inside, inside):
            rest = _part(part, side)
            if len(rest.values) > 1:
                inner = largest_difference(rest)
                if inner.p_value < level:
                    pending.append((rest, inner))
    return tuple(found)


def segments(series: Series, found: Sequence[IntArray]) -> IntArray:
    """Return a number for every entry, the same for those that are in the same of the sets of entries.

    Each of the sets has shape (k,), the result (entries,).
    """
    number = np.zeros(len(series.entries), dtype=np.int64)
    for entries in found:
        _, number = np.unique(2 * number + np.isin(series.entries, entries), return_inverse=True)
    return number


def _check(estimates: Sequence[Estimate]) -> None:
    if not 2 <= len(estimates) <= MOST_ENTRIES:
        remedy = f"give 2 to {MOST_ENTRIES} estimates of one machine"
        raise DataError.at("estimates", f"are {len(estimates)}", remedy)
    chains = list(dict.fromkeys(one.model.chain for one in estimates))
    if len(chains) > 1:
        what = f"are of different chains: {', '.join(chains[:3])}"
        raise DataError.at("estimates", what, "give those of one chain")


def _part(series: Series, kept: BoolArray) -> Series:
    return Series(
        series.name,
        series.unit,
        series.entries[kept],
        series.values[kept],
        series.noise[kept],
        series.drift[kept],
    )


def _notes(estimates: Sequence[Estimate], labels: Sequence[str], series: Sequence[Series]) -> tuple[str, ...]:
    """Return what makes entries hard to compare: other methods, sensors, and quantities that come and go."""
    notes = []
    for what, kinds in (
        ("method", [one.fit.method for one in estimates]),
        ("sensor set", [one.model.sensor_set for one in estimates]),
    ):
        for k in range(1, len(kinds)):
            if kinds[k] != kinds[k - 1]:
                said = f"the {what} is {kinds[k]}, before {kinds[k - 1]}, which may be a change by itself"
                notes.append(f"{labels[k]}: {said}")
    for one in series:
        present = set(one.entries.tolist())
        lacking = [labels[k] for k in range(len(estimates)) if k not in present]
        if lacking:
            shown = ", ".join(lacking[:3]) + (f" and {len(lacking) - 3} more" if len(lacking) > 3 else "")
            notes.append(f"{one.name} is not known at {shown}")
    return tuple(notes)
