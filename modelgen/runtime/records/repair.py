"""Repair of a record, only as far as its owner asks for it; every change is reported with its size.

- duplicates: drop samples whose time stamp is no number, or does not come after the one before;
- gaps: keep the longest stretch without a gap, and in which no channel misses a reading;
- fill: interpolate linearly across gaps, and where a channel misses a reading (cubic where it has one in
  several samples only);
- uneven: interpolate (cubic) onto equal steps, or take samples as even where only their stamps scatter;
- clocks: interpolate (cubic) channels with times of their own onto those of the fastest;
- unwrap=KEY: add the turns after which a position's reading begins again;
- repeats=KEY: interpolate (cubic) between new readings of a channel that repeats each for some samples;
- offset=KEY: subtract a position's first reading, or any other channel's mean.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from modelgen.array_types import BoolArray, FloatArray
from modelgen.errors import DataError, Problem, listed
from modelgen.runtime.filters.readings import between_readings, modulus, repeats, turns, unwrapped
from modelgen.runtime.records.faults import POSITIONS, even_times, gaps_of, in_order
from modelgen.runtime.records.thresholds import UNIFORM

MENDS = ("duplicates", "gaps", "fill", "uneven", "clocks")
UNWRAP, REPEATS, OFFSET = "unwrap=", "repeats=", "offset="
OF_CHANNELS = (UNWRAP, REPEATS, OFFSET)
OF_READINGS = ("gaps", "fill")  # of times that are missing, too, where there are any


@dataclass(frozen=True, eq=False)
class Track:
    """Channels with common times in s, shape (n,) each; `said` lists the changes."""

    times: FloatArray
    signals: Mapping[str, FloatArray]
    said: tuple[str, ...] = ()


def check_mends(mends: Iterable[str], keys: Iterable[str], timed: bool = True) -> None:
    """Raise one DataError for everything that is no mend, names no channel, or needs times and has none."""
    known = list(keys)
    problems = []
    for mend in mends:
        if mend.startswith(OF_CHANNELS):
            if mend.partition("=")[2] not in known:
                remedy = f"name a channel: {listed(known)}"
                problems.append(Problem(f"--mend {mend}", "names no channel of the record", remedy))
        elif mend in MENDS and mend not in OF_READINGS and not timed:
            problems.append(Problem(f"--mend {mend}", "mends times, and the record has none", "leave it out"))
        elif mend not in MENDS:
            remedy = f"choose from {', '.join((*MENDS, *(f'{one}KEY' for one in OF_CHANNELS)))}"
            problems.append(Problem(f"--mend {mend}", "is no mend", remedy))
    DataError.raise_any(problems)


def mend_times(track: Track, mends: Iterable[str], where: str = "times") -> Track:
    """Return the track with its times mended, in the order: duplicates, gaps or fill, uneven.

    Times that nothing mends (some are no numbers, most do not increase) are returned as they are. Readings
    that are missing are mended where gaps are. `where` names the times in messages.
    """
    wanted = tuple(mends)
    if "duplicates" in wanted:
        track = _without_duplicates(track)
    if not _increase(track.times):
        return track
    track = _mend_missing(track, wanted)
    if "gaps" in wanted and track.times.size > 1:
        track = _longest_stretch(track)
    if track.times.size < 2:
        return track
    if "fill" in wanted and not _is_even(track.times):
        track = _evenly(where, track, cubic=False, why="gaps filled")
    if "uneven" in wanted:
        track = _evenly(where, _as_read(track), cubic=True, why="uneven steps made even")
    return track


def mend_readings(signals: Mapping[str, FloatArray], mends: Iterable[str]) -> Track:
    """Return channels without times, (n,) samples each, with readings that are missing mended as asked."""
    return _mend_missing(Track(np.empty(0), signals), tuple(mends))


def mend_turns(signals: Mapping[str, FloatArray], mends: Iterable[str]) -> Track:
    """Return the channels, shape (n,) each, SI, with the turns asked for added; no times are returned."""
    mended, said = dict(signals), []
    for key in _channels(mends, UNWRAP):
        there = _finite(mended[key])
        size = modulus(mended[key][there])
        if size is not None:
            known = mended[key][there]
            mended[key] = mended[key].astype(float)  # a copy
            mended[key][there] = unwrapped(known, size)
            count = np.count_nonzero(turns(known, size))
            said.append(f"{key} begins again after {size:.6g}: turns added at {count} samples")
    return Track(np.empty(0), mended, tuple(said))


def mend_repeats(track: Track, mends: Iterable[str]) -> Track:
    """Return the track with channels interpolated that repeat their readings, as far as asked for."""
    mended, said = dict(track.signals), list(track.said)
    for key in _channels(mends, REPEATS):
        found = repeats(mended[key])
        if found is not None:
            mended[key] = between_readings(mended[key], *found)
            said.append(f"{key} interpolated between its readings, which came every {found[0]:.5g} samples")
    return Track(track.times, mended, tuple(said))


def _channels(mends: Iterable[str], kind: str) -> list[str]:
    return [mend.removeprefix(kind) for mend in mends if mend.startswith(kind)]


def mend_offsets(track: Track, units: Mapping[str, str], mends: Iterable[str]) -> Track:
    """Return the track, in SI, without the offsets asked for."""
    mended, said = dict(track.signals), list(track.said)
    for key in _channels(mends, OFFSET):
        position = units.get(key) in POSITIONS
        offset = float(mended[key][0] if position else np.mean(mended[key]))
        mended[key] = mended[key] - offset
        said.append(f"{'first reading' if position else 'mean'} {offset:.6g} taken off {key}")
    return Track(track.times, mended, tuple(said))


def join_clocks(tracks: Mapping[str, tuple[FloatArray, FloatArray]]) -> Track:
    """Return channels with times of their own on the times of the fastest, where all of them overlap.

    `tracks` holds the times in s and the samples of each channel, shape (n,) each.
    """
    steps = {key: float(np.median(np.diff(times))) for key, (times, _) in tracks.items()}
    fastest = min(steps, key=lambda key: steps[key])
    start = max(float(times[0]) for times, _ in tracks.values())
    stop = min(float(times[-1]) for times, _ in tracks.values())
    grid = tracks[fastest][0]
    grid = grid[(grid >= start - 1e-9 * steps[fastest]) & (grid <= stop + 1e-9 * steps[fastest])]
    if grid.size < 2:
        what, remedy = "the channels' times do not overlap", "check their columns of times"
        raise DataError.at("--mend clocks", what, remedy)
    signals, said = {}, []
    for key, (times, values) in tracks.items():
        on_grid = times.size >= grid.size and bool(np.isin(grid, times).all())
        signals[key] = values[np.searchsorted(times, grid)] if on_grid else _cubic(times, values, grid)
        if not on_grid:
            shift = 1e3 * float(times[0] - tracks[fastest][0][0])
            said.append(f"{key} interpolated to the times of {fastest} (it started {shift:.6g} ms later)")
    return Track(grid, signals, tuple(said))


def _without_duplicates(track: Track) -> Track:
    keep = in_order(track.times)
    dropped = int(np.sum(~keep))
    if keep.size - dropped < 2:  # these are no times
        return track
    said = (f"{dropped} samples with a repeated, backward or missing time stamp dropped",) if dropped else ()
    return _part(track, keep, said)


def _increase(times: FloatArray) -> bool:
    """Return whether times, shape (n,), in s, are numbers most of which come after the one before."""
    return times.size > 1 and bool(np.isfinite(times).all()) and float(np.median(np.diff(times))) > 0.0


def _is_even(times: FloatArray) -> bool:
    """Return whether the steps of times, shape (n,), in s, are those of one sampling frequency."""
    steps = np.diff(times)
    step = float(np.median(steps))
    return bool(np.max(np.abs(steps - step)) <= UNIFORM * step)


def _mend_missing(track: Track, wanted: tuple[str, ...]) -> Track:
    """Return the track with readings that are missing cut out or interpolated, as far as asked for."""
    lengths = {values.size for values in track.signals.values()}
    there = {key: _finite(values) for key, values in track.signals.items()}
    all_there = np.all(list(there.values()), axis=0) if len(lengths) == 1 else np.ones(0, dtype=bool)
    if all_there.all() or not all(found.any() for found in there.values()):
        return track  # also channels of no number at all, and of several lengths: the record refuses them
    if "gaps" in wanted:
        edges = np.flatnonzero(np.diff(np.r_[False, all_there, False].astype(int)))
        if not edges.size:
            return track
        starts, stops = edges[::2], edges[1::2]
        longest = int(np.argmax(stops - starts))
        start, stop = int(starts[longest]), int(stops[longest])
        said = f"cut where readings are missing: samples {start} to {stop - 1} kept"
        return _part(track, _range(all_there.size, start, stop), (said,))
    if "fill" not in wanted:
        return track
    start = max(int(np.argmax(found)) for found in there.values())
    stop = min(found.size - int(np.argmax(found[::-1])) for found in there.values())
    at = track.times if track.times.size else np.arange(all_there.size)
    signals, said_of = dict(track.signals), []
    for key, found in there.items():
        count = int(np.count_nonzero(~found[start:stop]))
        steps = np.diff(np.flatnonzero(found))
        step = int(np.median(steps)) if count and steps.size else 1
        # a slower channel in a table of fast ones: lines between its readings would bend it
        if step > 1 and np.all(np.diff(at[found]) > 0.0):
            signals[key] = _cubic(at[found], signals[key][found], at)
            said_of.append(f"{key} interpolated between its readings, one in {step} samples")
        elif count:
            signals[key] = np.interp(at, at[found], signals[key][found])
            said_of.append(f"{count} missing readings of {key} interpolated")
    if stop - start < all_there.size:
        said_of.append(f"cut to the samples {start} to {stop - 1}, between which all channels are read")
    filled = replace(track, signals=signals)
    return _part(filled, _range(all_there.size, start, stop), tuple(said_of))


def _finite(values: npt.NDArray[Any]) -> BoolArray:
    """Return where a channel has a number, shape (n,); what is not of numbers is left to the record."""
    return np.isfinite(values) if values.dtype.kind in "iuf" else np.ones(values.shape, dtype=bool)


def _range(size: int, start: int, stop: int) -> BoolArray:
    return (np.arange(size) >= start) & (np.arange(size) < stop)


def _longest_stretch(track: Track) -> Track:
    cuts = gaps_of(track.times) + 1
    if not cuts.size:
        return track
    edges = np.r_[0, cuts, track.times.size]
    longest = int(np.argmax(np.diff(edges)))
    start, stop = int(edges[longest]), int(edges[longest + 1])
    said = f"cut at {cuts.size} gap(s): samples {start} to {stop - 1} kept"
    return _part(track, _range(track.times.size, start, stop), (said,))


def _part(track: Track, keep: BoolArray, said: tuple[str, ...]) -> Track:
    signals = {key: values[keep] for key, values in track.signals.items()}
    return Track(track.times[keep] if track.times.size else track.times, signals, track.said + said)


def _as_read(track: Track) -> Track:
    """Return the track with even times where only the stamps scatter, and not the samples."""
    even = even_times(track.times, track.signals) if np.all(np.diff(track.times) > 0.0) else None
    if even is None:
        return track
    scatter = f"{1e3 * float(np.std(track.times - even)):.3g} ms"
    said = f"stamps scatter by {scatter} (rms), which no channel shows: samples taken as read at even times"
    return Track(even, track.signals, (*track.said, said))


def _evenly(where: str, track: Track, cubic: bool, why: str) -> Track:
    times = track.times
    if np.any(np.diff(times) <= 0.0):
        remedy = "mend that first: --mend duplicates"
        raise DataError.at(where, "repeat or run backward and cannot be interpolated", remedy)
    # the mean step where no sample is missing: of a clock that scatters, or is read out in coarse digits, the
    # median is known less well
    steps, gaps = np.diff(times), gaps_of(times)
    step = float(np.mean(np.delete(steps, gaps)))
    count = round(float(times[-1] - times[0]) / step)
    grid = times[0] + (times[-1] - times[0]) / count * np.arange(count + 1)
    signals = {
        key: _cubic(times, values, grid) if cubic else np.interp(grid, times, values)
        for key, values in track.signals.items()
    }
    added = grid.size - times.size
    said = f"{why}: {times.size} samples became {grid.size}" + (f", {added} interpolated" if added else "")
    return Track(grid, signals, (*track.said, said))


def _cubic(times: FloatArray, values: FloatArray, grid: FloatArray) -> FloatArray:
    from scipy.interpolate import CubicSpline

    return np.asarray(CubicSpline(times, values)(grid), dtype=float)
