"""Units as instruments write them -> SI: what a channel's numbers are multiplied by.

Angles count as rad, revolutions as 2 pi rad. A unit that is not listed is left alone, and said to be unknown.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

from modelgen.magnitudes import is_usable

STANDARD_GRAVITY = 9.80665  # m/s^2
LONGEST_UNIT = 80  # characters; a longer text is none
LONGEST_TITLE = (
    200  # characters; nobody writes a unit behind a longer one, and looking for it takes their square
)
LONGEST_INITIAL = 2  # characters of a joint's name that may be a unit, too: m, in, but not deg
# Words that are units wherever a name has them, apart from the rest or behind small letters as in posDeg.
# Letters and short words may be bodies or attributes (m, in, min): they count in brackets only.
_ANY_CASE = "m?rad|deg|degs|degrees?|rev|revs|turns|arcsec|arcmin|k?rpm|dps|rps|[mu]?sec|mils?|inch|mm"
_ANY_CASE += "|counts?|cts|ticks?|incs?|lsb"
_AS_WRITTEN = "°|ms|[uµ]s|ns|[uµ]m|cm|[mk]?N·?m|N·?[mc]m|kN|mN|mA|mV"
NAMED_UNIT = re.compile(
    r"(?:(?<=[^\W_])[\W_]+|(?<=[a-z])(?=[A-Z])|^(?=[\[({<]))[\[({<]?"
    rf"(?P<word>(?i:{_ANY_CASE})|{_AS_WRITTEN})"
    r"(?i:(?:_per_| per |[_/])(?P<below>s2|s\^2|s²|s|sec|min))?(?:$|[\])}>,])",
)
PLACE = re.compile(r"\s*(.*\S)\[([^\[\]]+)\]\s*")  # next to the name: "position[elbow]", and "theta[rad]"


@dataclass(frozen=True)
class Unit:
    """A unit that is known: its name in SI, and the factor to it."""

    text: str
    si: str
    factor: float


_PREFIXES = {"": 1.0, "k": 1e3, "d": 1e-1, "c": 1e-2, "m": 1e-3, "u": 1e-6, "n": 1e-9}
_DEGREE, _REVOLUTION = math.pi / 180.0, 2.0 * math.pi
_POUND, _OUNCE = 4.4482216152605, 0.27801385095378125  # as forces, in N
# Quantities as exponents of angle, length, force, time, and what else there is to measure.
_Quantity = tuple[int, int, int, int, str]
_ANGLE, _LENGTH, _FORCE, _TIME = (1, 0, 0, 0, ""), (0, 1, 0, 0, ""), (0, 0, 1, 0, ""), (0, 0, 0, 1, "")
_SPEED, _ACCELERATION = (1, 0, 0, -1, ""), (0, 1, 0, -2, "")
_SI: dict[_Quantity, str] = {
    **{_ANGLE: "rad", _SPEED: "rad/s", (1, 0, 0, -2, ""): "rad/s^2"},
    **{_LENGTH: "m", (0, 1, 0, -1, ""): "m/s", _ACCELERATION: "m/s^2"},
    **{_FORCE: "N", (0, 1, 1, 0, ""): "N m", _TIME: "s"},
    **{(0, 0, 0, 0, name): name for name in ("A", "V", "Hz", "count", "1")},
}
# "grad" is none: a hundredth of a right angle in English, a degree in German
_PREFIXED: dict[str, tuple[_Quantity, float]] = {
    **{"m": (_LENGTH, 1.0), "N": (_FORCE, 1.0), "s": (_TIME, 1.0), "rad": (_ANGLE, 1.0)},
    **{"deg": (_ANGLE, _DEGREE), "g": (_ACCELERATION, STANDARD_GRAVITY), "rpm": (_SPEED, _REVOLUTION / 60.0)},
    **{"G": (_ACCELERATION, STANDARD_GRAVITY), "sec": (_TIME, 1.0)},
    **{name: ((0, 0, 0, 0, name), 1.0) for name in ("A", "V", "Hz")},
}
_NAMES: dict[_Quantity, dict[str, float]] = {
    _ANGLE: {
        **dict.fromkeys(("radian", "radians"), 1.0),
        **dict.fromkeys(("degree", "degrees", "°", "Grad"), _DEGREE),
        **{"gon": math.pi / 200.0, "arcsec": math.pi / 648000.0, "arcmin": math.pi / 10800.0},
        **dict.fromkeys(("rev", "revs", "turn", "turns", "r", "U", "umdr", "Umdrehungen"), _REVOLUTION),
    },
    _LENGTH: {
        **dict.fromkeys(("meter", "meters", "metre", "metres"), 1.0),
        **dict.fromkeys(("in", "inch", "inches"), 0.0254),
        **{"ft": 0.3048, "mil": 2.54e-5, "mils": 2.54e-5},
    },
    _FORCE: {
        **dict.fromkeys(("newton", "newtons"), 1.0),
        **{"daN": 10.0, "MN": 1e6},
        **dict.fromkeys(("kp", "kgf"), STANDARD_GRAVITY),
        **dict.fromkeys(("lb", "lbs", "lbf"), _POUND),
        **dict.fromkeys(("oz", "ozf"), _OUNCE),
    },
    (0, 1, 1, 0, ""): {"Newtonmeter": 1.0},
    _TIME: {
        **dict.fromkeys(("second", "seconds", "sekunden", "sek"), 1.0),
        **dict.fromkeys(("millisecond", "milliseconds"), 1e-3),
        **{"microseconds": 1e-6, "min": 60.0, "minutes": 60.0, "h": 3600.0},
        **dict.fromkeys(("day", "days", "Tag", "Tage"), 86_400.0),
    },
    _SPEED: {
        **dict.fromkeys(("1/min", "min^-1", "min-1", "upm", "Umin", "u/min"), _REVOLUTION / 60.0),
        **{"dps": _DEGREE, "rps": _REVOLUTION},
    },
    (0, 1, 0, -1, ""): {"ms^-1": 1.0, "ms-1": 1.0},
    _ACCELERATION: {**dict.fromkeys(("g0", "gn"), STANDARD_GRAVITY), "ms^-2": 1.0, "ms-2": 1.0},
    (0, 0, 0, 0, "V"): {"volt": 1.0, "volts": 1.0},
    (0, 0, 0, 0, "Hz"): {"MHz": 1e6},
    (0, 0, 0, 0, "A"): {"ampere": 1.0, "amps": 1.0, "amp": 1.0},
    # what one is worth only the encoder, or the converter, knows
    (0, 0, 0, 0, "count"): {
        **dict.fromkeys(("count", "counts", "cts", "inc", "incs", "ink", "inkr", "inkremente"), 1.0),
        **dict.fromkeys(("increment", "increments", "tick", "ticks", "pulse", "pulses", "lsb"), 1.0),
        **dict.fromkeys(("bit", "bits", "digit", "digits"), 1.0),
    },
    (0, 0, 0, 0, "1"): {"%": 1e-2, "1": 1.0, "-": 1.0},
}
# what stands where an instrument has no unit to state
_NONE = ("", "none", "(none)", "unknown", "n/a", "unbekannt", "double", "float", "single", "real", "lreal")


def _table() -> dict[str, tuple[_Quantity, float]]:
    """Return what words are: units with their prefixes, and a force beside a length as in Nmm, lbin, ftlb."""
    table = {
        prefix + name: (quantity, size * factor)
        for name, (quantity, factor) in _PREFIXED.items()
        for prefix, size in _PREFIXES.items()
    }
    for quantity, units in _NAMES.items():
        table |= {name: (quantity, factor) for name, factor in units.items()}
    forces = [(name, factor) for name, (quantity, factor) in table.items() if quantity == _FORCE]
    for force, newtons in forces:
        for length in ("m", "cm", "mm", "in", "ft"):
            moment = ((0, 1, 1, 0, ""), newtons * table[length][1])
            table[force + length] = moment
            if length in ("in", "ft"):
                table[length + force] = moment
    return table


def _lower(table: dict[str, tuple[_Quantity, float]]) -> dict[str, tuple[_Quantity, float]]:
    """Return the table in small letters, without what these do not distinguish."""
    found: dict[str, set[tuple[_Quantity, float]]] = {}
    for name, meaning in table.items():
        found.setdefault(name.lower(), set()).add(meaning)
    return {name: meanings.pop() for name, meanings in found.items() if len(meanings) == 1 and name != "grad"}


_KNOWN = _table()
_LOWER = _lower(_KNOWN)
_REPLACED = {"µ": "u", "μ": "u", "⁻¹": "^-1", "⁻²": "^-2", "²": "^2", "**": "^", "º": "°"}
_REPLACED |= {"·": " ", "⋅": " ", "*": " ", "[": "", "]": ""}


def unit_from_text(text: str) -> Unit | None:
    """Return the unit that "Nm", "[deg/s]", "dV (Voltage)" or "µs" names; None for any other text."""
    return _unit(text) if len(text) <= LONGEST_UNIT else None


@lru_cache(maxsize=4096)  # a file of thousands of columns has few units
def _unit(text: str) -> Unit | None:
    cleaned = _cleaned(text)
    found = _meaning(cleaned)
    return None if found is None else Unit(text.strip(), *found)


def _meaning(text: str) -> tuple[str, float] | None:
    """Return the SI unit of a product of powers and its factor: "0.1 deg/s", "N mm", "m s^-2", "lbf-in"."""
    scale = re.match(r"([0-9]+(?:[.,][0-9]+)?(?:[eE][+-]?[0-9]+)?) ?(?=[^\W\d]|°|%)", text)
    steps, text = (scale.group(1), text[scale.end() :]) if scale else ("1", text)
    exponents, others, factor = [0, 0, 0, 0], "", float(steps.replace(",", "."))
    capitals = len(text) > 2 and text.isupper()
    for place, part in enumerate([text] if _word(text, capitals) else text.split("/")):
        for word in [part] if _word(part, capitals) else re.split(r" |\.|-(?=[^\W\d])", part.strip()):
            match = re.fullmatch(r"([^\d^-]+)(?:\^?(-?[1-3]))?", word)
            whole = _word(word, capitals)
            found = whole or (_word(match[1], capitals) if match else None)
            power = 1 if whole or not match else int(match[2] or 1)
            power = -power if place else power
            if found is None or (found[0][4] and (power != 1 or others)):
                return None
            quantity, size = found
            exponents = [sum_ + power * one for sum_, one in zip(exponents, quantity[:4], strict=True)]
            others, factor = others + quantity[4], factor * size**power
    si = _SI.get((exponents[0], exponents[1], exponents[2], exponents[3], others))
    return None if si is None or not is_usable(factor) or factor == 0.0 else (si, factor)


def _word(word: str, capitals: bool) -> tuple[_Quantity, float] | None:
    """Return what a word is: instruments write "NMM" and "Newton", too, but Mm and mm are not the same."""
    found = _KNOWN.get(word)
    if found is None and (capitals or (len(word) > 2 and word.istitle())):
        found = _LOWER.get(word.lower())
    return found


def states_no_unit(text: str) -> bool:
    """Return whether a cell states that there is no unit."""
    return _cleaned(text).lower() in _NONE or text.strip().lower() in _NONE


def split_name(text: str) -> tuple[str, str | None]:
    """Split "theta [rad]", "torque (Nm)", "t in ms", "pos / mm" or "t, s" into a name and a unit.

    What stands at the end counts as a unit only where it is one, or in square brackets apart from the name; a
    single letter must stand in brackets. A name with a unit as a word stays whole: "v_rpm", "q/deg".
    """
    if len(text) > LONGEST_TITLE:
        return text.strip(), None
    match = re.fullmatch(r"(.*?)\s*(?:\[([^\]]*)\]|\(([^)]*)\))\s*", text)
    if match and match.group(1):
        inner = match.group(2) if match.group(2) is not None else match.group(3)
        # "position[elbow]" and "position[2]" are names; "torque [furlong]" states a unit, if an unknown one
        apart = match.group(2) is not None and text[match.end(1)].isspace() and not inner.strip().isdecimal()
        if apart or (unit_from_text(inner) and not inner.isdecimal()) or states_no_unit(inner):
            return match.group(1).strip(), inner.strip() or None
    match = re.fullmatch(r"(.*\S)\s*(?:\bin\b| / |, )\s*(\S+)", text)
    if match and unit_from_text(match.group(2)):
        return match.group(1).strip(), match.group(2)
    # Rohde & Schwarz: the column of times has no other name
    match = re.fullmatch(r"in (\S+)", text.strip())
    unit = unit_from_text(match.group(1)) if match else None
    if match and unit and unit.si == "s":
        return "time", match.group(1)
    match = NAMED_UNIT.search(text)
    return text.strip(), None if match is None else _written(match)


def _written(match: re.Match[str]) -> str | None:
    """Return the unit of words in a name as it is written alone: deg_s and DEG per S are deg/s."""
    below = f"/{match['below'].lower()}" if match["below"] else ""
    forms = (match["word"] + below, match["word"].lower() + below)
    return next((form for form in forms if unit_from_text(form)), None)


def split_titles(titles: Sequence[str]) -> list[tuple[str, str | None]]:
    """Split the titles of a table as `split_name` does, but for places that look like a unit.

    "position[m]" beside "position[elbow]" is that of a joint called m, and then so is "effort[m]".
    """
    parts = [PLACE.fullmatch(title) if len(title) <= LONGEST_TITLE else None for title in titles]
    of_places = {part[1] for part in parts if part and unit_from_text(part[2]) is None}
    places = {part[2] for part in parts if part and part[1] in of_places and len(part[2]) <= LONGEST_INITIAL}
    return [
        (title, None) if part and part[2] in places else split_name(title)
        for title, part in zip((title.strip() for title in titles), parts, strict=True)
    ]


def _cleaned(text: str) -> str:
    result = text.strip()
    for old, new in _REPLACED.items():
        result = result.replace(old, new)
    # "V (Voltage)": the unit, then what it measures
    result = re.sub(r"(?<=\S)\s*\([A-Za-z ]+\)\s*$", "", result)
    return re.sub(r"^\((.*)\)$", r"\1", result).strip().removesuffix(".")
