"""What a record is made of -> checked arrays, or what is wrong with samples, labels and units."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from modelgen.array_types import FloatArray
from modelgen.errors import Problem, listed
from modelgen.magnitudes import FAINTEST, FREQUENCY_REMEDY, LARGEST, is_frequency, shown_number
from modelgen.runtime.files.units import states_no_unit, unit_from_text
from modelgen.runtime.records.faults import POSITIONS, Finding, restarts
from modelgen.runtime.records.thresholds import LEFT_BY_A_CUT, NOTED_OFFSET, ONE_MOTION

ACCELERATIONS = ("rad/s^2", "m/s^2")
MISSING_REMEDY = "cut the record there, or interpolate the missing samples"
FILL = "interpolate the missing samples (--mend fill)"
CUT_OR_FILL = f"cut the record there (--mend gaps), or {FILL}"


def checked_channel(where: str, key: Any, values: Any) -> tuple[FloatArray | None, list[Problem]]:
    """Return a read-only float64 copy of one channel, in its unit, shape (n,), or what is wrong with it."""
    if not isinstance(key, str) or not key:
        return None, [Problem(where, f"key is {key!r}", "name the channel with a non-empty string")]
    try:
        given = np.asanyarray(values)
    except ValueError:
        return None, [Problem(where, "is no rectangular array", "give one number per sample")]
    if given.dtype.kind not in "iuf":
        remedy = "give real numbers (integers or floats)"
        return None, [Problem(where, f"has data type {given.dtype}", remedy)]
    if given.ndim != 1:
        remedy = "give one dimension; a single row or column can be flattened with numpy.ravel"
        return None, [Problem(where, f"has shape {given.shape}", remedy)]
    with np.errstate(over="ignore"):  # a long double beyond a double becomes infinite, which is refused
        array = np.array(given, dtype=np.float64, order="C", copy=True, subok=False)
    if not isinstance(given, np.ma.MaskedArray) and _is_usual(array):
        array.flags.writeable = False
        return array, []
    # the mask of a masked array is lost in the copy: a masked sample is a missing one
    problem = missing_problem(where, given, MISSING_REMEDY) or magnitude_problem(where, array)
    if problem is not None:
        return array, [problem]
    array.flags.writeable = False
    return array, []


def missing_problem(where: str, samples: npt.NDArray[Any], remedy: str) -> Problem | None:
    """Return what is wrong where numbers, shape (n,), any unit, are masked or not finite.

    `remedy` is told where these are some of them.
    """
    missing = np.ma.getmaskarray(samples)
    with np.errstate(over="ignore"):
        numbers = np.asarray(samples, dtype=float)
    bad = np.flatnonzero(missing | ~np.isfinite(numbers))
    if not bad.size:
        return None
    if bad.size == numbers.size:
        away = "give it another column (--map), or take a sensor set without it (--sensors)"
        return Problem(where, "holds no number", away)
    first = int(bad[0])
    value = "masked" if missing[first] else numbers[first]
    what = f"is {value} ({bad.size} of {numbers.size} samples are not finite)"
    return Problem(f"{where}, sample {first}", what, remedy)


def mending_remedy(samples: npt.NDArray[Any]) -> str:
    """Return what mends numbers, shape (n,), any unit, some missing: cutting only where much is left."""
    ends = np.flatnonzero(~np.isfinite(np.ma.filled(samples.astype(float), np.nan)))
    longest = np.max(np.diff(np.r_[-1, ends, samples.size])) - 1
    return CUT_OR_FILL if longest > LEFT_BY_A_CUT * samples.size else FILL


def _is_usual(samples: FloatArray) -> bool:
    """Return, by the fastest test, whether samples of shape (n,) are finite and within the limits."""
    if not samples.size:
        return False
    peak = max(float(samples.max()), -float(samples.min()))  # NaN where one of them is
    return peak == 0.0 or FAINTEST <= peak <= LARGEST


def magnitude_problem(where: str, samples: npt.NDArray[Any]) -> Problem | None:
    """Return what is wrong where finite samples, shape (n,), are beyond the limits, or all too small."""
    size = np.abs(samples, dtype=np.longdouble if samples.dtype.itemsize > 8 else np.float64)
    peak = float(np.fmax.reduce(size, initial=0.0))
    if peak == 0.0 or FAINTEST <= peak <= LARGEST:
        return None
    beyond = (size > LARGEST) & np.isfinite(size)
    remedy = "check the file, the unit and the factor"
    if beyond.any():
        first = int(np.argmax(beyond))
        what = f"is {samples[first]:g} ({np.count_nonzero(beyond)} samples are beyond {LARGEST:g})"
        return Problem(f"{where}, sample {first}", what, remedy)
    if peak >= FAINTEST:
        return None
    first = int(np.argmax(size == peak))
    what = f"is {samples[first]:g}, the largest of all: none reaches {FAINTEST:g}"
    return Problem(f"{where}, sample {first}", what, remedy)


def length_problems(where: str, channels: Mapping[str, FloatArray]) -> list[Problem]:
    """Return what is wrong with lengths of channels, (n,) samples each: they differ, or are too short."""
    lengths = {key: array.size for key, array in channels.items()}
    if not lengths:
        return []
    if len(dict.fromkeys(lengths.values())) > 1:
        found = listed(f"{key} {length}" for key, length in lengths.items())
        return [Problem(where, f"channels differ in length: {found}", "cut all channels to the same samples")]
    shortest = min(lengths.values())
    if shortest < 2:
        return [Problem(where, f"has {shortest} sample(s)", "give at least two samples")]
    return []


def restart_problems(path: str, clocks: Mapping[str, FloatArray]) -> list[Problem]:
    """Return one problem per column of times (n,), in s, in which several records follow one another."""
    problems = []
    for name, times in clocks.items():
        if (again := restarts(times)).size:
            what = f"begins again: {again.size + 1} records follow one another"
            remedy = "cut the file there, and give every record as a file of its own"
            problems.append(Problem(f"{path}: column {name}, sample {again[0]}", what, remedy))
    return problems


def label_problems(name: Any, tag: Any) -> list[Problem]:
    """Return what is wrong with the name and the tag of a record."""
    problems = []
    # control characters would steer the terminal that an estimate is printed on
    if not isinstance(name, str) or not name or not name.isprintable():
        remedy = "give a string of visible characters (rename the file, if it is a file's name)"
        problems.append(Problem("record", f"name is {name!r}", remedy))
    if tag is not None and not (isinstance(tag, str) and tag.isprintable()):
        problems.append(Problem("record", f"tag is {tag!r}", "give a string of visible characters, or None"))
    return problems


def frequency_problems(where: str, fs: Any) -> list[Problem]:
    """Return what is wrong with a sampling frequency in Hz."""
    if is_frequency(fs):
        return []
    return [Problem(f"{where}: fs", f"is {shown_number(fs)}", FREQUENCY_REMEDY)]


def unit_text_problems(where: str, units: Any, channels: Mapping[str, FloatArray]) -> list[Problem]:
    """Return what is wrong with the units of channels, shape (n,) each in that unit: texts by channel."""
    if not isinstance(units, Mapping):
        return [Problem(f"{where}: units", f"is {type(units).__name__}", "give a mapping of channel to unit")]
    problems = []
    for key, unit in units.items():
        if key not in channels:
            problems.append(Problem(f"{where}: unit of {key!r}", "is that of no channel", "leave it out"))
        if not isinstance(unit, str) or not unit.isprintable():
            problems.append(Problem(f"{where}: unit of {key!r}", f"is {unit!r}", "give visible characters"))
    return problems


def other_units(where: str, units: Mapping[str, str], wanted: Mapping[str, str]) -> list[Problem]:
    """Return one problem per channel that is stated to be in another unit than wanted (SI).

    A torque logged as a current needs its torque constant: without it every number would be in a wrong unit.
    """
    found = []
    for key, stated in units.items():
        asked, unit = wanted.get(key), unit_from_text(stated)
        if (
            asked is None
            or states_no_unit(stated)
            or (unit and unit.factor == 1.0 and unit.si in (asked, "1"))
        ):
            continue
        unknown = "" if unit else ", a unit that is not known"
        remedy = f'give its factor, {asked} per {stated}: scales={{"{key}": FACTOR}} where it is read'
        what = f"is in {stated}{unknown}, and {asked} is needed"
        found.append(Problem(f"{where}: channel {key}", what, remedy))
    return found


def zero_faults(signals: Mapping[str, FloatArray], units: Mapping[str, str]) -> tuple[Finding, ...]:
    """Return accelerations with a mean, and positions whose zeros differ; channels have shape (n,), in SI.

    The mean of an acceleration is zero where a motion starts and ends at rest. Channels that miss a reading,
    or never change, are not judged.
    """
    findings = []
    for key, samples in signals.items():
        if units.get(key) not in ACCELERATIONS or not np.isfinite(samples).all() or np.ptp(samples) == 0.0:
            continue
        rms, mean = float(np.std(samples)), float(np.mean(samples))
        if abs(mean) > NOTED_OFFSET * rms > 0.0:
            what = f"{key} has a mean of {mean:.4g} {units[key]}, {100.0 * abs(mean) / rms:.3g} % of its rms"
            findings.append(Finding(f"offset={key}", what))
    positions = {unit: [key for key in signals if units.get(key) == unit] for unit in POSITIONS}
    for unit, keys in positions.items():
        before = len(findings)
        for key in keys[1:]:
            pair = (signals[keys[0]], signals[key])
            if not all(np.isfinite(samples).all() for samples in pair):
                continue
            apart, spread = float(pair[1][0] - pair[0][0]), float(np.ptp(pair[0]))
            if abs(apart) > NOTED_OFFSET * spread > 0.0:
                what = f"{key} starts {apart:.4g} {unit} from {keys[0]}, which moves over {spread:.4g} {unit}"
                findings.append(Finding(f"offset={key}", what))
        if len(findings) > before:
            findings += _not_at_zero(keys[0], signals[keys[0]], unit, "and others")
    if all(positions.values()):
        findings += _zeros_apart(positions["rad"][0], positions["m"][0], signals)
    return tuple(findings)


def _not_at_zero(key: str, samples: FloatArray, unit: str, others: str) -> Iterator[Finding]:
    """Yield that a position, (n,) in `unit`, starts away from zero, where those compared with it are mended.

    What is mended begins at zero, and what it was compared with has to do so, too.
    """
    if abs(float(samples[0])) > NOTED_OFFSET * float(np.ptp(samples)):
        what = f"{key} starts at {samples[0]:.4g} {unit}, {others} elsewhere"
        yield Finding(f"offset={key}", what)


def _zeros_apart(angle: str, place: str, signals: Mapping[str, FloatArray]) -> Iterator[Finding]:
    """Yield how far the zeros of an angle (rad) and of a place (m) that move as one, (n,), are apart."""
    turned, moved = signals[angle], signals[place]
    if not (np.isfinite(turned).all() and np.isfinite(moved).all()) or not (np.ptp(turned) and np.ptp(moved)):
        return
    about = turned - np.mean(turned), moved - np.mean(moved)
    powers = [float(one @ one) for one in about]
    along = float(about[0] @ about[1])
    if along**2 < ONE_MOTION * powers[0] * powers[1]:
        return
    apart, spread = float(turned[0] - moved[0] * powers[0] / along), float(np.ptp(turned))
    if abs(apart) > NOTED_OFFSET * spread:
        what = f"{angle} starts {apart:.4g} rad from where {place} starts, and moves over {spread:.4g} rad"
        yield Finding(f"offset={angle}", what)
        yield from _not_at_zero(place, moved, "m", angle)
