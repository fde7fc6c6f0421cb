"""Samples as they are given -> checked arrays, or what is wrong with them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from modelgen.array_types import FloatArray
from modelgen.errors import Problem, listed
from modelgen.magnitudes import FAINTEST, LARGEST
from modelgen.runtime.records.faults import restarts

MISSING_REMEDY = "cut the record there, or interpolate the missing samples"


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
