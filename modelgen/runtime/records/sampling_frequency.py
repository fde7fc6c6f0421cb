"""The sampling frequency of a record: from what is stated, from a column of times, or from both."""

from __future__ import annotations

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.magnitudes import FREQUENCY_REMEDY, is_frequency, shown_number
from modelgen.runtime.files.units import Unit, unit_from_text
from modelgen.runtime.records.faults import time_faults
from modelgen.runtime.records.thresholds import (
    AGREEMENT,
    LONGEST_STEP,
    SHORT_OF_A_DAY,
    SPREADSHEET_DAYS,
    UNIFORM,
    UNLIKELY_STEP,
)

# What sets each kind of fault of the times right, in the order in which it is done.
MENDS = {"duplicates": "duplicates", "gaps": "gaps (or fill)", "uneven": "uneven"}
UNITS = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}  # of times: how many are a second
PER_SECOND = {**UNITS, "days": 1.0 / 86_400.0}


def likely_unit(step: float, first: float = 0.0) -> str:
    """Return the coarsest unit in which a step of times, in that unit, is one between samples of a motion.

    Times that begin at `first`, in their unit, as the dates of spreadsheets do, are days.
    """
    if SPREADSHEET_DAYS[0] < first < SPREADSHEET_DAYS[1] and 0.0 < step < SHORT_OF_A_DAY:
        return "days"
    return next((name for name, count in UNITS.items() if 0.0 < step / count < LONGEST_STEP), "s")


def unit_of_times(given: str | None, stated: str) -> Unit | None:
    """Return the unit of times that is given, else the one that a file states; None where it is none of time.

    Raises
    ------
    DataError
        When what is given is no unit of time.
    """
    unit = unit_from_text(given or stated)
    if unit is not None and unit.si == "s":
        return unit
    if given:
        raise DataError.at("--time-unit", f"{given!r} is no unit of time", "give s, ms, us, ns or days")
    return None


def slow_times(label: str | None, rate_hz: float) -> tuple[str, ...]:
    """Return what is said of a column of times without a unit that steps farther than motion is sampled."""
    if rate_hz * LONGEST_STEP >= 1.0:
        return ()
    return (f"times: column {label} states no unit; taken for s, {rate_hz:.6g} Hz",)


def sampling_frequency(
    where: str, stated: float | None, times: FloatArray | None, in_seconds: bool = True
) -> float:
    """Return the sampling frequency in Hz.

    Parameters
    ----------
    where : str
        Names the file and its time column in messages.
    stated : float, optional
        Frequency in Hz that the user or the file states. The times then only confirm it: they may be in s,
        ms, us or ns and be rounded (by less than half a step), but no sample may be missing.
    times : array, shape (n,), optional
        Sampling times. Without a stated frequency they must be in s, and every step equal to within 1e-3.
    in_seconds : bool
        Whether that is known; where it is not, steps that are long for a motion are taken for another unit.

    Raises
    ------
    DataError
        When neither is given, the times are not uniform or seem to be in another unit, or the two disagree by
        more than 0.1 %.
    """
    if stated is not None and not is_frequency(stated):
        raise DataError.at(where, f"sampling frequency is {shown_number(stated)} Hz", FREQUENCY_REMEDY)
    if times is None:
        if stated is None:
            remedy = "give fs in Hz, or the name of a column of times in seconds"
            raise DataError.at(where, "has no sampling frequency", remedy)
        return stated
    _check_uniform(where, times, rounded=stated is not None)
    measured = (times.size - 1) / float(times[-1] - times[0])
    if stated is None:
        if measured <= 1.0 or not is_frequency(measured):
            what = f"steps by {1.0 / measured:.6g}, in seconds a sampling frequency of {measured:.6g} Hz"
            remedy = "give fs in Hz if the times are not in seconds, or their unit (--time-unit "
            raise DataError.at(where, what, f"{remedy}{likely_unit(1.0 / measured)})")
        unit = likely_unit(1.0 / measured, float(times[0]))
        if not in_seconds and (measured * UNLIKELY_STEP < 1.0 or unit == "days"):
            what = f"states no unit, and steps by {1.0 / measured:.6g}, as times in {unit} do"
            raise DataError.at(
                where, what, f"give their unit (--time-unit {unit}, or s if they are in seconds)"
            )
        # a clock carries no more digits; records of one bench then share one frequency
        return float(f"{measured:.9g}")
    if all(abs(measured * unit / stated - 1.0) > AGREEMENT for unit in UNITS.values()):
        what = f"says {measured:.6g} Hz, but {stated:.6g} Hz is stated"
        raise DataError.at(where, what, "correct fs, or name the right column of times")
    return stated


def _check_uniform(where: str, times: FloatArray, rounded: bool) -> None:
    if times.size < 2:
        raise DataError.at(where, f"has {times.size} sample(s)", "give at least two samples")
    bad = np.flatnonzero(~np.isfinite(times))
    if bad.size:
        remedy = "correct the time, or drop the sample (--mend duplicates and --mend gaps (or fill))"
        if bad.size > times.size - 2:
            remedy = "name the right column of times"
        raise DataError.at(f"{where}, sample {bad[0]}", f"is {times[bad[0]]}", remedy)
    steps = np.diff(times)
    step = float(np.median(steps))
    if step <= 0.0:
        raise DataError.at(
            where, f"does not increase (median step {step:.6g})", "name the right column of times"
        )
    bad = np.flatnonzero(np.abs(steps - step) > (0.5 if rounded else UNIFORM) * step)
    if bad.size:
        first = int(bad[0])
        what = f"jumps by {steps[first]:.6g} where the step is {step:.6g} ({bad.size} such steps)"
        found = {finding.kind for finding in time_faults(where, times)} - ({"uneven"} if rounded else set())
        mends = " and ".join(f"--mend {way}" for kind, way in MENDS.items() if kind in found)
        remedy = f"resample, or cut the record there ({mends})" + (
            "" if rounded else "; give fs too if the times are only rounded"
        )
        raise DataError.at(f"{where}, sample {first + 1}", what, remedy)
