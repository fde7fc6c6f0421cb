"""Repair of a record, only as far as its owner asks for it; every change is reported with its size.

- duplicates: drop samples whose time stamp does not come after the one before;
- gaps: keep the longest stretch without a gap;
- fill: interpolate linearly across gaps;
- uneven: interpolate (cubic) onto equal steps;
- clocks: interpolate (cubic) channels with times of their own onto those of the fastest;
- unwrap=KEY: add the turns after which a position's reading begins again;
- repeats=KEY: interpolate (cubic) between new readings of a channel that repeats each for some samples;
- offset=KEY: subtract a position's first reading, or any other channel's mean.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from modelgen.array_types import BoolArray, FloatArray
from modelgen.errors import DataError, Problem, listed
from modelgen.runtime.filters.readings import between_readings, modulus, repeats, turns, unwrapped
from modelgen.runtime.records.faults import POSITIONS
from modelgen.runtime.records.thresholds import GAP

MENDS = ("duplicates", "gaps", "fill", "uneven", "clocks")
UNWRAP, REPEATS, OFFSET = "unwrap=", "repeats=", "offset="
OF_CHANNELS = (UNWRAP, REPEATS, OFFSET)


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
        elif mend in MENDS and not timed:
            problems.append(Problem(f"--mend {mend}", "mends times, and the record has none", "leave it out"))
        elif mend not in MENDS:
            remedy = f"choose from {', '.join((*MENDS, *(f'{one}KEY' for one in OF_CHANNELS)))}"
            problems.append(Problem(f"--mend {mend}", "is no mend", remedy))
    DataError.raise_any(problems)


def mend_times(track: Track, mends: Iterable[str]) -> Track:
    """Return the track with its times mended, in the order: duplicates, gaps or fill, uneven."""
    wanted = tuple(mends)
    if "duplicates" in wanted:
        track = _without_duplicates(track)
    if "gaps" in wanted:
        track = _longest_stretch(track)
    if "fill" in wanted:
        track = _evenly(track, cubic=False, why="gaps filled")
    if "uneven" in wanted:
        track = _evenly(track, cubic=True, why="uneven steps made even")
    return track


def mend_turns(signals: Mapping[str, FloatArray], mends: Iterable[str]) -> Track:
    """Return the channels, shape (n,) each, SI, with the turns asked for added; no times are returned."""
    mended, said = dict(signals), []
    for key in _channels(mends, UNWRAP):
        size = modulus(mended[key])
        if size is not None:
            mended[key] = unwrapped(mended[key], size)
            count = np.count_nonzero(turns(signals[key], size))
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
    latest = np.maximum.accumulate(track.times)
    keep = np.r_[True, track.times[1:] > latest[:-1]]
    dropped = int(np.sum(~keep))
    said = (f"{dropped} samples with a repeated or backward time stamp dropped",) if dropped else ()
    return _part(track, keep, said)


def _longest_stretch(track: Track) -> Track:
    steps = np.diff(track.times)
    cuts = np.flatnonzero(steps > GAP * np.median(steps)) + 1
    if not cuts.size:
        return track
    edges = np.r_[0, cuts, track.times.size]
    longest = int(np.argmax(np.diff(edges)))
    keep = np.zeros(track.times.size, dtype=bool)
    keep[edges[longest] : edges[longest + 1]] = True
    said = f"cut at {cuts.size} gap(s): samples {edges[longest]} to {edges[longest + 1] - 1} kept"
    return _part(track, keep, (said,))


def _part(track: Track, keep: BoolArray, said: tuple[str, ...]) -> Track:
    signals = {key: values[keep] for key, values in track.signals.items()}
    return Track(track.times[keep], signals, track.said + said)


def _evenly(track: Track, cubic: bool, why: str) -> Track:
    times = track.times
    if np.any(np.diff(times) <= 0.0):
        remedy = "mend that first: --mend duplicates"
        raise DataError.at("times", "repeat or run backward and cannot be interpolated", remedy)
    step = float(np.median(np.diff(times)))
    # the mean step where no sample is missing: a clock that is read out in coarse digits drifts otherwise
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
