"""What is wrong with the times, readings and zeros of channels, each with its size; changes nothing."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from modelgen.array_types import BoolArray, FloatArray, IntArray
from modelgen.errors import Problem
from modelgen.runtime.filters.readings import modulus, repeats, turns
from modelgen.runtime.records.thresholds import (
    CERTAIN_SCATTER,
    FEW_STEPS,
    GAP,
    LEAST_STAMPS,
    NEAR_GAP,
    RESTART,
    ROUGH_ORDER,
    SCATTERED,
    SLOPE_SAMPLES,
    UNIFORM,
    WANDERS,
)

POSITIONS = ("rad", "m")
FORCES = ("N m", "N")


@dataclass(frozen=True)
class Finding:
    """A fault of a record: `kind` is its name for --mend, `what` states where and how much."""

    kind: str
    what: str

    def __str__(self) -> str:
        return f"{self.kind}: {self.what}"


def restarts(times: FloatArray) -> IntArray:
    """Return the samples at which times, shape (n,), in s, begin again where they first began, and go on."""
    steps = np.diff(times) if np.all(np.isfinite(times)) else np.empty(0)
    if not np.any(steps > 0.0):
        return np.empty(0, dtype=int)
    step = float(np.median(steps[steps > 0.0]))
    again: IntArray = np.flatnonzero((steps[:-1] < 0.0) & (np.abs(steps[1:] - step) < step)) + 1
    near: BoolArray = np.abs(times[again] - times[0]) < RESTART * step
    return np.asarray(again[near])


def time_faults(clock: str, times: FloatArray) -> tuple[Finding, ...]:
    """Return duplicate and backward time stamps, gaps, and uneven steps of a column of times.

    `times` has shape (n,), in s. Times that do not increase at all are no times, and nothing mends them.
    """
    bad = np.flatnonzero(~np.isfinite(times))
    if bad.size:
        what = f"{clock} is {times[bad[0]]} at {bad.size} of {times.size} samples, first at sample {bad[0]}"
        return (Finding("duplicates", what),) if times.size - bad.size > 1 else ()
    steps = np.diff(times)
    if times.size < 3 or not np.any(steps > 0.0):
        return ()
    step = float(np.median(steps[steps > 0.0]))
    findings = []
    repeated = np.flatnonzero(steps == 0.0)
    if repeated.size:
        what = f"{clock} repeats {repeated.size} time stamp(s), first at sample {repeated[0] + 1}"
        findings.append(Finding("duplicates", what))
    backward = np.setdiff1d(np.flatnonzero(steps < 0.0), restarts(times) - 1)
    if backward.size:
        what = f"{clock} runs backward at {backward.size} sample(s), by up to {-steps[backward].min():.6g} s"
        findings.append(Finding("duplicates", f"{what}, first at sample {backward[0] + 1}"))
    kept = np.flatnonzero(in_order(times))
    forward, gaps = np.diff(times[kept]), gaps_of(times[kept])
    if gaps.size:
        missing = int(np.sum(np.round(forward[gaps] / step) - 1))
        what = f"{clock} has {gaps.size} gap(s), {missing} samples missing"
        longest = f"longest {forward[gaps].max():.6g} s"
        findings.append(Finding("gaps", f"{what}, {longest}, first at sample {kept[gaps[0] + 1]}"))
    uneven = float(np.max(np.abs(np.delete(forward, gaps) - step), initial=0.0))
    if uneven > UNIFORM * step:
        share = 100.0 * uneven / step
        findings.append(Finding("uneven", f"{clock} steps by {step:.6g} s, uneven by up to {share:.3g} %"))
    return tuple(findings)


def in_order(times: FloatArray) -> BoolArray:
    """Return which times, in s, shape (n,), are numbers and come after all before them."""
    latest = np.fmax.accumulate(np.where(np.isfinite(times), times, -np.inf))
    found: BoolArray = np.isfinite(times) & np.r_[True, times[1:] > latest[:-1]]
    return found


def gaps_of(times: FloatArray) -> IntArray:
    """Return the samples behind which some are missing, of times in s, shape (n,), that increase.

    There a step is longer than what stamps scatter by, and all that follow stay late: a stamp that alone is
    late is followed by a short step.
    """
    steps = np.diff(times)
    if not steps.size:
        return np.empty(0, dtype=int)
    step = float(np.median(steps))
    # a normal deviate exceeds 0.6745 of its standard deviation in half of all cases
    scatter = float(np.median(np.abs(steps - step))) / 0.6745
    long = np.flatnonzero(steps > max(GAP * step, step + SCATTERED * scatter))
    behind = np.arange(1, NEAR_GAP + 1)
    kept = []
    for start in range(0, long.size, FEW_STEPS):
        at = long[start : start + FEW_STEPS, None]
        late = [np.median(times[n] - step * n, axis=1) for n in _around(at, behind, times.size)]
        kept.append(at[late[1] - late[0] > (GAP - 1.0) * step, 0])
    return np.concatenate(kept) if kept else long


def _around(at: IntArray, behind: IntArray, n: int) -> tuple[IntArray, IntArray]:
    """Return the samples, shape (k, m), up to each of `at`, shape (k, 1), and behind it, of n samples."""
    return np.maximum(at + 1 - behind, 0), np.minimum(at + behind, n - 1)


def clock_faults(times: Mapping[str, FloatArray]) -> tuple[Finding, ...]:
    """Return how the times of channels, shape (n,) each, in s, differ from the first: start, step, length."""
    findings = []
    keys = list(times)
    first = times[keys[0]]
    for key in keys[1:]:
        other = times[key]
        if same_clock(first, other):
            continue
        if min(first.size, other.size) < 2:
            findings.append(Finding("clocks", f"{key} has {other.size} samples, {keys[0]} has {first.size}"))
            continue
        shift = float(other[0] - first[0])
        steps = [float(np.median(np.diff(t))) for t in (first, other)]
        lengths = f"{other.size} samples against {first.size}"
        what = f"{key} starts {shift:.6g} s after {keys[0]}, steps by {steps[1]:.6g} s against {steps[0]:.6g}"
        findings.append(Finding("clocks", f"{what}, {lengths}"))
    return tuple(findings)


def reading_faults(signals: Mapping[str, FloatArray], units: Mapping[str, str]) -> tuple[Finding, ...]:
    """Return positions whose reading begins again after a turn, and channels that repeat their readings.

    Channels have shape (n,), in SI; those without a unit are not judged.
    """
    findings = []
    for key, samples in signals.items():
        if key not in units or samples.dtype.kind not in "iuf" or not np.isfinite(samples).all():
            continue
        numbers = samples.astype(float)
        size = modulus(numbers) if units[key] in POSITIONS else None
        if size is not None:
            count = np.count_nonzero(turns(numbers, size))
            what = f"{key} jumps {count} time(s) by {size:.6g} {units[key]} across its range: its reading"
            findings.append(Finding(f"unwrap={key}", f"{what} begins again after every turn"))
        found = repeats(numbers)
        if found is not None:
            what = f"{key} has a new reading only every {found[0]:.5g} samples, and repeats it meanwhile"
            findings.append(Finding(f"repeats={key}", what))
    return tuple(findings)


def reading_problems(
    where: str,
    signals: Mapping[str, FloatArray],
    units: Mapping[str, str],
    held: Collection[str] | None = None,
) -> list[Problem]:
    """Return the `reading_faults` that no estimate stands, with what to do.

    Signals have shape (n,), in the `units` given by channel.
    A force that repeats may be a command that is held so long; it is judged where `held` says which are.
    """
    problems = []
    for finding in reading_faults(signals, units):
        key = finding.kind.partition("=")[2]
        force = units[key] in FORCES
        if force and (held is None or key in held):
            continue
        remedy = f"mend it (--mend {finding.kind})"
        if force:
            remedy += f" if the recorder or its bus repeats it; name it if it is a command (--held {key})"
        problems.append(Problem(where, finding.what, remedy))
    return problems


def common_samples(times: Mapping[str, FloatArray]) -> dict[str, slice] | None:
    """Return of every channel the samples at the times that all have, or None where no times are the same.

    `times` holds the times in s of each channel, shape (n,) each; those that all have agree within a
    thousandth of a step.
    """
    if any(t.size < 2 or not np.isfinite(t).all() or (np.diff(t) <= 0.0).any() for t in times.values()):
        return None
    margin = 0.5 * min(float(np.median(np.diff(t))) for t in times.values())
    start = max(float(t[0]) for t in times.values()) - margin
    stop = min(float(t[-1]) for t in times.values()) + margin
    found = {key: slice(*np.searchsorted(t, (start, stop)).tolist()) for key, t in times.items()}
    kept = [times[key][part] for key, part in found.items()]
    return found if kept[0].size > 1 and all(same_clock(kept[0], other) for other in kept[1:]) else None


def same_clock(first: FloatArray, other: FloatArray) -> bool:
    """Return whether two columns of times, shape (n,) each, in s, agree within a thousandth of a step."""
    if first.size != other.size or first.size < 2 or not np.all(np.isfinite(first)):
        return np.array_equal(first, other, equal_nan=True)
    step = abs(float(np.median(np.diff(first)))) or 1.0
    return bool(np.max(np.abs(first - other)) <= UNIFORM * step)


def even_times(times: FloatArray, signals: Mapping[str, FloatArray]) -> FloatArray | None:
    """Return even times in place of stamps whose scatter the channels do not show; None where they may.

    Parameters
    ----------
    times : array, shape (n,)
        In s, increasing; samples may be missing.
    signals : mapping of str to array, shape (n,)
        Channels in any unit.

    Returns
    -------
    array, shape (n,), or None
        In s. None, too, where the stamps wander slowly: no channel shows whether a clock does.
    """
    # a sample that is read e s late lies v e beside the motion, v its slope
    n = times.size
    if n < LEAST_STAMPS:
        return None
    steps, gaps = np.diff(times), gaps_of(times)
    count = np.ones(n - 1)
    count[gaps] = np.maximum(np.round(steps[gaps] / np.mean(np.delete(steps, gaps))), 1.0)
    place = np.r_[0.0, np.cumsum(count)]
    step, start = np.polyfit(place - np.mean(place), times, 1)
    even = start + step * (place - np.mean(place))
    late = times - even
    if np.max(np.abs(late)) <= UNIFORM * step or _wanders(late):
        return None
    near = np.convolve(count, np.ones(ROUGH_ORDER), "valid") == ROUGH_ORDER
    along = power = 0.0
    for samples in signals.values():
        if samples.dtype.kind not in "iuf" or not np.isfinite(samples).all():
            continue
        slope = np.convolve(np.gradient(samples.astype(float), even), _mean(SLOPE_SAMPLES), "same")
        rough, moved = (np.diff(one, ROUGH_ORDER)[near] for one in (samples.astype(float), slope * late))
        if not moved.any():
            continue
        share = float(moved @ rough) / float(moved @ moved)
        left = float(np.mean((rough - share * moved) ** 2))
        left = max(left, np.finfo(float).eps * float(np.mean(rough**2)), np.finfo(float).tiny)
        along, power = along + float(moved @ rough) / left, power + float(moved @ moved) / left
    # the share of the scatter that the channels show is 1 where the stamps are true, else 0
    if not power or along / power + CERTAIN_SCATTER / np.sqrt(power) > 0.5:
        return None
    return np.asarray(even)


def _mean(samples: int) -> FloatArray:
    return np.ones(samples) / samples


def _wanders(late: FloatArray) -> bool:
    """Tell whether stamps, late by so many s, shape (n,), are so for long rather than each by itself."""
    slow = np.convolve(late, _mean(LEAST_STAMPS), "valid")
    return bool(np.std(slow) > WANDERS * np.std(late) / np.sqrt(LEAST_STAMPS))
