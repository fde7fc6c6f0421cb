"""Units as instruments write them -> SI: what a channel's numbers are multiplied by.

Angles count as rad, revolutions as 2 pi rad. A unit that is not listed is left alone, and said to be unknown.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import lru_cache

STANDARD_GRAVITY = 9.80665  # m/s^2
LONGEST_UNIT = 80  # characters; a longer text is none


@dataclass(frozen=True)
class Unit:
    """A unit that is known: its name in SI, and the factor to it."""

    text: str
    si: str
    factor: float


_PREFIXES = {"": 1.0, "k": 1e3, "M": 1e6, "d": 1e-1, "c": 1e-2, "m": 1e-3, "u": 1e-6, "n": 1e-9}
_ANGLES = {
    "rad": 1.0,
    "deg": math.pi / 180.0,
    "degree": math.pi / 180.0,
    "degrees": math.pi / 180.0,
    "°": math.pi / 180.0,
    "grad": math.pi / 200.0,
    "gon": math.pi / 200.0,
    "arcsec": math.pi / 648000.0,
    "arcmin": math.pi / 10800.0,
    "rev": 2.0 * math.pi,
    "turn": 2.0 * math.pi,
    "r": 2.0 * math.pi,
    "U": 2.0 * math.pi,
    "umdr": 2.0 * math.pi,
}
_TIMES = {
    "s": 1.0,
    "sec": 1.0,
    "second": 1.0,
    "seconds": 1.0,
    "sekunden": 1.0,
    "msec": 1e-3,
    "millisecond": 1e-3,
    "milliseconds": 1e-3,
    "usec": 1e-6,
    "microseconds": 1e-6,
    "min": 60.0,
    "minutes": 60.0,
    "h": 3600.0,
    "100ns": 1e-7,
}
_SPECIAL = {
    "rpm": ("rad/s", 2.0 * math.pi / 60.0),
    "1/min": ("rad/s", 2.0 * math.pi / 60.0),
    "min^-1": ("rad/s", 2.0 * math.pi / 60.0),
    "dps": ("rad/s", math.pi / 180.0),
    "g": ("m/s^2", STANDARD_GRAVITY),
    "g0": ("m/s^2", STANDARD_GRAVITY),
    "gn": ("m/s^2", STANDARD_GRAVITY),
    "inch": ("m", 0.0254),
    "in": ("m", 0.0254),
    "volt": ("V", 1.0),
    "volts": ("V", 1.0),
    "ampere": ("A", 1.0),
    "amps": ("A", 1.0),
    "amp": ("A", 1.0),
    # what one is worth only the encoder, or the converter, knows
    **dict.fromkeys(("count", "counts", "cts", "inc", "incs", "inkr", "inkremente"), ("count", 1.0)),
    **dict.fromkeys(("increment", "increments", "ticks", "pulses", "lsb"), ("count", 1.0)),
    "%": ("1", 1e-2),
    "1": ("1", 1.0),
    "-": ("1", 1.0),
}
# what stands where an instrument has no unit to state
_NONE = ("", "none", "(none)", "unknown", "n/a", "unbekannt", "double", "float", "single", "real", "lreal")


def _table() -> dict[str, tuple[str, float]]:
    table = {name: ("s", factor) for name, factor in _TIMES.items()}
    lengths = {}
    for prefix, size in _PREFIXES.items():
        lengths[f"{prefix}m"] = size
        for name, si in (("N m", "N m"), ("Nm", "N m"), ("N", "N"), ("A", "A"), ("V", "V"), ("s", "s")):
            table[f"{prefix}{name}"] = (si, size)
        for name in ("Hz",):
            table[f"{prefix}{name}"] = ("Hz", size)
    angles = {**_ANGLES, "mrad": 1e-3, "urad": 1e-6, "mdeg": 1e-3 * math.pi / 180.0}
    for si, units in (("m", lengths), ("rad", angles)):
        for name, factor in units.items():
            table[name] = (si, factor)
            for text, seconds in (("s", 1.0), ("sec", 1.0), ("min", 60.0), ("ms", 1e-3)):
                table[f"{name}/{text}"] = (f"{si}/s", factor / seconds)
            for text in ("s^2", "s2", "s/s"):
                table[f"{name}/{text}"] = (f"{si}/s^2", factor)
    table.update(_SPECIAL)
    return table


_KNOWN = _table()
_LOWER = {name.lower(): value for name, value in reversed(_KNOWN.items())}
_REPLACED = {"µ": "u", "μ": "u", "²": "^2", "⁻¹": "^-1", "**": "^", "·": " ", "*": " ", "º": "°"}
_REPLACED |= {"[": "", "]": ""}


def unit_from_text(text: str) -> Unit | None:
    """Return the unit that "Nm", "[deg/s]", "dV (Voltage)" or "µs" names; None for any other text."""
    return _unit(text) if len(text) <= LONGEST_UNIT else None


@lru_cache(maxsize=4096)  # a file of thousands of columns has few units
def _unit(text: str) -> Unit | None:
    cleaned = _cleaned(text)
    found = _KNOWN.get(cleaned) or _KNOWN.get(cleaned.replace(" ", ""))
    # "NM" and "DEG" are written by instruments, but Mm and mm are not the same
    if found is None and len(cleaned) > 2:
        found = _LOWER.get(cleaned.lower())
    return None if found is None else Unit(text.strip(), *found)


def states_no_unit(text: str) -> bool:
    """Return whether a cell states that there is no unit."""
    return _cleaned(text).lower() in _NONE or text.strip().lower() in _NONE


def split_name(text: str) -> tuple[str, str | None]:
    """Split "theta [rad]", "torque (Nm)", "t in ms", "pos / mm" or "speed_rpm" into a name and a unit's text.

    What stands at the end counts as a unit only where it is one; a single letter must stand in brackets.
    """
    match = re.fullmatch(r"(.*?)\s*(?:\[([^\]]*)\]|\(([^)]*)\))\s*", text)
    if match and match.group(1):
        inner = match.group(2) if match.group(2) is not None else match.group(3)
        if match.group(2) is not None or unit_from_text(inner) or states_no_unit(inner):
            return match.group(1).strip(), inner.strip() or None
    match = re.fullmatch(r"(.*\S)\s*(?:\bin\b| / )\s*(\S+)", text)
    if match and unit_from_text(match.group(2)):
        return match.group(1).strip(), match.group(2)
    # Rohde & Schwarz: the column of times has no other name
    match = re.fullmatch(r"in (\S+)", text.strip())
    unit = unit_from_text(match.group(1)) if match else None
    if match and unit and unit.si == "s":
        return "time", match.group(1)
    match = re.fullmatch(r"(.+)_(ms|us|ns|sec|deg|rad|rpm|Nm|mm|um)", text)
    if match:
        return text, match.group(2)
    return text.strip(), None


def _cleaned(text: str) -> str:
    result = text.strip()
    for old, new in _REPLACED.items():
        result = result.replace(old, new)
    # "V (Voltage)": the unit, then what it measures
    result = re.sub(r"(?<=\S)\s*\([A-Za-z ]+\)\s*$", "", result)
    return re.sub(r"^\((.*)\)$", r"\1", result).strip()
