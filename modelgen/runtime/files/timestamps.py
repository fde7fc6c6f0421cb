"""Times as text (ISO 8601, with a day first and dots, as in German, or with slashes) -> whole nanoseconds.

"2022-05-02T15:56:24.0005", "2022-05-02 15:56:24,0005+02:00", "02.05.2022 15:56:24.0005", "15:56:24.0005",
"05/02/2022 03:56:24.0005 PM", "56:24.0005". Of two numbers between slashes the first is the month beside
AM or PM, else the day. A clock that states no day goes on after midnight, one that states no hour after the
hour.
Counts that are too long for a double, "132959733843760000", are counted from the first as well.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from modelgen.array_types import FloatArray

_DATE = (
    r"(?:(?P<year>\d{4})[-/](?P<month>\d\d?)[-/](?P<day>\d\d?)|(?P<D>\d\d?)\.(?P<M>\d\d?)\.(?P<Y>\d{4})"
    r"|(?P<one>\d\d?)/(?P<other>\d\d?)/(?P<Y4>\d{4}))"
)
_CLOCK = r"(?P<hour>\d\d?):(?P<minute>\d\d)"
_TO_THE_MINUTE = re.compile(rf"(?:{_DATE}[T ]\s*)?{_CLOCK}")
_STAMP = re.compile(
    r"([\d.T/ -]{0,12}\d\d?:\d\d):(\d\d)(?:[.,](\d{1,12}))?\s*([APap][Mm])?\s*(Z|[+-]\d\d(?::?\d\d)?)?"
)
_MINUTES = re.compile(r"(\d{1,3}):([0-5]\d)[.,](\d{1,12})")  # without a fraction it may be hours
_DAY_ALONE = re.compile(_DATE)
_CLOCK_ALONE = re.compile(_CLOCK + ":")
_DAY_NS, _HOUR_NS = 86_400 * 10**9, 3600 * 10**9
MOST_DIGITS = 15  # which a double holds
COUNTER_BITS = (16, 24, 31, 32)  # which the counters of controllers have
NEAR_STEPS = 3.0  # across a counter's end: what falls by another amount is no counter that is full
LONGEST_COUNT = 30  # digits; what is longer counts no time
_FIRST_DAY = datetime(1970, 1, 1, tzinfo=UTC)


def nanoseconds(cell: str) -> int | None:
    """Return the time a cell holds, since 1970 or since midnight; None for any other text."""
    match = _STAMP.fullmatch(cell)
    if match is None:
        return _since_the_hour(cell)
    to_the_minute, seconds, fraction, half, offset = match.groups()
    minute = _minute(to_the_minute, half and half.upper())  # remembered: there are few
    if minute is None:
        return None
    return (minute + int(seconds) - _offset_s(offset or "Z")) * 10**9 + int(
        (fraction or "").ljust(9, "0")[:9]
    )


def _since_the_hour(cell: str) -> int | None:
    """Return the ns of "07:12.350", minutes and seconds with a fraction, as spreadsheets show them."""
    match = _MINUTES.fullmatch(cell)
    if match is None:
        return None
    return (60 * int(match[1]) + int(match[2])) * 10**9 + int(match[3].ljust(9, "0")[:9])


def is_date(cell: str) -> bool:
    """Return whether a cell holds a day without a time."""
    return _DAY_ALONE.fullmatch(cell) is not None


def is_long_count(cell: str) -> bool:
    """Return whether a cell holds a whole number of more digits than a double can hold."""
    return MOST_DIGITS < len(cell) <= LONGEST_COUNT and cell.isdecimal()


def time_since(first: str) -> Callable[[str], float]:
    """Return what turns a cell into s (of a long count: counts) since `first`; it raises ValueError."""
    start = int(first) if is_long_count(first) else nanoseconds(first)
    per_unit = 1.0 if is_long_count(first) else 1e9
    turn = _HOUR_NS if _MINUTES.fullmatch(first) else _DAY_NS if _CLOCK_ALONE.match(first) else None

    def time(cell: str) -> float:
        text = cell.strip().strip('"')
        found = int(text) if is_long_count(text) else nanoseconds(text)
        if found is None or start is None:
            raise ValueError(cell)
        if turn is not None and found < start - turn // 2:
            found += turn
        return (found - start) / per_unit

    return time


def gone_on(counts: FloatArray) -> FloatArray:
    """Return counts of a clock, shape (n,), any unit, that go on where its counter began again.

    A counter of 16, 24, 31 or 32 bits falls by all that it holds, but for a step. Other times are returned as
    they are.
    """
    if not np.isfinite(counts).all():
        return counts
    steps = np.diff(counts)
    begun = steps < 0.0
    if not begun.any() or not np.any(steps > 0.0) or np.any(counts != np.floor(counts)):
        return counts
    step = float(np.median(steps[steps > 0.0]))
    for size in (2.0**bits for bits in COUNTER_BITS):
        across = steps[begun] + size
        within = counts.min() >= 0.0 and counts.max() < size
        if within and across.min() > 0.0 and across.max() < NEAR_STEPS * step < size / NEAR_STEPS:
            return counts + size * np.concatenate(([0.0], np.cumsum(begun)))
    return counts


def counter_said(clock: str, counts: npt.NDArray[Any], on: FloatArray) -> tuple[str, ...]:
    """Return that counts of a clock, shape (n,), any unit, began again and go `on`, if they did."""
    if on.size == 0 or on[-1] == counts[-1]:
        return ()
    return (f"{clock} begins again, as a counter does that is full: it goes on",)


def elapsed_s(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return NumPy's times (since the first) or time differences in s, of the same shape; other values as
    they are.
    """
    if values.dtype.kind == "M":
        values = values - values[:1]
    if values.dtype.kind != "m":
        return values
    missing = np.isnat(values)
    seconds = values.astype("timedelta64[ns]").astype(np.int64) / 1e9
    return np.where(missing, np.nan, seconds)


@lru_cache(maxsize=1024)
def _minute(text: str, half: str | None) -> int | None:
    """Return s since 1970, or since midnight where no date stands before the time; `half` is AM or PM."""
    match = _TO_THE_MINUTE.fullmatch(text)
    if match is None:
        return None
    part = match.groupdict()
    slashed = ("one", "other") if half else ("other", "one")
    year, month, day = (
        int(next((part[name] for name in names if part[name]), default))
        for *names, default in (
            ("year", "Y", "Y4", 1970),
            ("month", "M", slashed[0], 1),
            ("day", "D", slashed[1], 1),
        )
    )
    hour = int(part["hour"])
    if half:
        if not 1 <= hour <= 12:
            return None
        hour = hour % 12 + (12 if half == "PM" else 0)
    if month > 12 and part["Y4"]:
        month, day = day, month
    try:
        when = datetime(year, month, day, hour, int(part["minute"]), tzinfo=UTC)
    except ValueError:
        return None
    return (when - _FIRST_DAY) // timedelta(seconds=1)


@lru_cache(maxsize=16)
def _offset_s(text: str) -> int:
    if text == "Z":
        return 0
    digits = text[1:].replace(":", "").ljust(4, "0")
    size = 3600 * int(digits[:2]) + 60 * int(digits[2:])
    return -size if text[0] == "-" else size
