"""Which column is which channel: a proposal from names and units, for a person to check."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

from modelgen.errors import listed
from modelgen.runtime.files.matrix_columns import column_of_text
from modelgen.runtime.files.source import Source, is_time_name
from modelgen.runtime.files.units import LONGEST_TITLE, Unit, states_no_unit, unit_from_text
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.directions import wanted_directions
from modelgen.runtime.records.mapping_file import Proposed
from modelgen.runtime.records.thresholds import LEAST_SCORE, STILL

# words in the names of columns, in the languages of the instruments seen so far
QUANTITIES = {
    "position": (
        *("pos", "position", "angle", "theta", "phi", "q", "x", "enc", "encoder", "winkel", "lage"),
        *("geber", "drehgeber", "inkrementalgeber", "weg", "codeur", "resolver"),
    ),
    "velocity": (
        *("vel", "velo", "velocity", "speed", "omega", "w", "v", "rpm"),
        *("drehzahl", "geschw", "geschwindigkeit", "winkelgeschwindigkeit"),
    ),
    "acceleration": (
        *("acc", "accel", "acceleration", "a", "beschl", "beschleunigung", "winkelbeschleunigung"),
    ),
    "force": (
        *("torque", "trq", "force", "effort", "gamma", "tau", "f", "i", "iq", "current"),
        *("drehmoment", "moment", "kraft", "strom"),
    ),
}
# words for set points, which are easily mistaken for measured values
SET_POINT_WORDS = (
    *("set", "setpoint", "sp", "cmd", "command", "commanded", "ref", "reference", "target"),
    *("des", "desired", "dmd", "demand", "soll", "sollwert"),
)
# what programs of identification call the channels of a record
INPUT_NAMES, OUTPUT_NAMES = (
    ("u", "input", "inputs", "inputdata"),
    ("y", "yout", "output", "outputs", "outputdata"),
)
# words for the part of a force that the controller adds from the reference alone
FEEDFORWARD_WORDS = ("ff", "feedforward", "forward", "vorsteuerung")
# words for what was measured, where the set point has the same name
MEASURED_WORDS = ("meas", "measured", "mess", "act", "actual", "fbk", "feedback", "ist", "istwert")
BODIES = {
    "m": ("m", "mot", "motor", "drive", "antrieb", "mx"),
    "c": ("c", "load", "last", "charge", "table", "carriage", "abtrieb", "my", "l"),
}
# a force is often logged as the current or voltage that makes it, or in % of a drive's rated force, and
# anything in counts of an encoder or a converter
LOGGED_AS, COUNTS = {"N m": ("A", "V", "1"), "N": ("A", "V", "1")}, "count"
# what drives the loop, which a file need not hold: it serves to simulate the loop
REFERENCES = {"reference": "position", "reference_rate": "velocity"}
FEEDFORWARD = "feedforward"
INPUTS = (*REFERENCES, FEEDFORWARD)
KNOWN_WORDS = {word for words in (*QUANTITIES.values(), *BODIES.values()) for word in words}
KNOWN_WORDS |= {*SET_POINT_WORDS, *MEASURED_WORDS, *FEEDFORWARD_WORDS}
# what a compound may end with, the longest first; shorter words end others by chance: "anlage" is no position
LAST_PARTS = sorted(
    {w for words in (*QUANTITIES.values(), SET_POINT_WORDS, MEASURED_WORDS) for w in words if len(w) > 4},
    key=lambda word: (-len(word), word),
)


@dataclass(frozen=True)
class _Column:
    name: str
    words: list[str]
    unit: Unit | None


@dataclass(frozen=True)
class _Wanted:
    key: str
    unit: str
    measures: str
    body: str


def propose(source: Source, model: Model | None, still: Collection[str] = ()) -> tuple[Proposed, ...]:
    """Return a column for every channel of the model; without a model, a key for every column.

    `still` are columns that never change: of two that suit, the other one is taken.
    """
    clocks = {source.clock, *source.clocks.values()}
    # "T" is a column of times only where there is no other
    columns = [
        name for name in source.names if name not in clocks and (name == "T" or not is_time_name(name))
    ]
    if model is None:
        keys = _keys(columns)
        return tuple(
            Proposed(key, "", column, source.units.get(column), "named after its column")
            for key, column in zip(keys, columns, strict=True)
        )
    wanted = [want for want in _wanted(model) if want.key in model.channels] + _inputs(model)
    named = [
        _Column(column, _words(column), unit_from_text(source.units.get(column, ""))) for column in columns
    ]
    bodies = {want.body for want in wanted}
    scores = {
        (want.key, column.name): _score(want, column, bodies) - STILL * (column.name in still)
        for want in wanted
        for column in named
    }
    chosen: dict[str, str] = {}
    ranked = sorted(scores, key=lambda pair: -scores[pair])
    for key, column in ranked:
        if scores[key, column] >= LEAST_SCORE and key not in chosen and column not in chosen.values():
            chosen[key] = column
    placed = _by_place(model, columns, chosen)
    needed = [want for want in wanted if want.measures not in INPUTS or want.key in chosen]
    return tuple(
        replace(_proposed(want, placed[want.key], source, columns), why="by its place: check the order")
        if want.key in placed
        else _proposed(want, chosen.get(want.key), source, columns)
        for want in needed
    )


def _by_place(model: Model, columns: Sequence[str], chosen: Mapping[str, str]) -> dict[str, str]:
    """Return channels that no name shows: inputs u and outputs y, as many as the model has, in its order."""
    found: dict[str, str] = {}
    actuators, sensors = ([one.key for one in part] for part in (model.actuators, model.sensors))
    for names, keys in ((INPUT_NAMES, actuators), (OUTPUT_NAMES, sensors)):
        own = [(column, column_of_text(column)) for column in columns]
        placed = [column for column, place in own if (place.matrix if place else column).lower() in names]
        if len(placed) == len(keys) and not set(placed) & set(chosen.values()):
            found |= {key: column for key, column in zip(keys, placed, strict=True) if key not in chosen}
    return found


def _proposed(want: _Wanted, column: str | None, source: Source, columns: Sequence[str]) -> Proposed:
    if column is None:
        return Proposed(want.key, want.unit, None, None, f"columns: {listed(columns)}")
    stated = source.unit_of(column, want.key)
    unit = unit_from_text(stated or "")
    agrees = unit is not None and unit.si == want.unit
    why = f"{want.measures} of {want.body}: by its name" + (" and unit" if agrees else "")
    if want.measures == "force" and _is_set_point(_words(column)):
        why += "; it looks like a set point: take the measured one where there is one"
    if inner := _unknown_unit(want, column, stated, columns):
        why += f"; if {inner} is a unit, give {want.unit or 'SI'} per {inner} as its factor"
    if stated and want.unit and not agrees and not states_no_unit(stated):
        why += f"; in {stated}: give {want.unit} per {stated} as its factor"
    return Proposed(want.key, want.unit, column, stated or None, why)


def _unknown_unit(want: _Wanted, column: str, stated: str, columns: Sequence[str]) -> str | None:
    """Return what stands in brackets behind a name and may be a unit: words there may be a joint, too."""
    match = re.fullmatch(r".*\S\s*\(([^()\d:,][^():,]*)\)", column) if len(column) <= LONGEST_TITLE else None
    if stated or match is None or match[1].lower() in {want.body, *KNOWN_WORDS}:
        return None
    # "speed (elbow)" and "torque (elbow)" are of an elbow
    others = sum(name.endswith(f"({match[1]})") for name in columns)
    return match[1] if others == 1 else None


def _wanted(model: Model) -> list[_Wanted]:
    sensors = [
        _Wanted(s.key, s.unit, s.measures, s.body or "-".join(s.deflection or ())) for s in model.sensors
    ]
    forces = [_Wanted(a.key, a.unit, "force", a.body) for a in model.actuators]
    others = [
        _Wanted(s.key, s.unit, "direction", s.key.partition("_")[2])
        for s in model.signals
        if s.key in wanted_directions(model)
    ]
    return [*sensors, *forces, *others]


def _inputs(model: Model) -> list[_Wanted]:
    """Return what drives the loop of the first actuator."""
    found = []
    for a in model.actuators[:1]:
        unit = {"N m": "rad", "N": "m"}.get(a.unit, "")
        found = [
            _Wanted("reference", unit, "reference", a.body),
            _Wanted("reference_rate", f"{unit}/s" if unit else "", "reference_rate", a.body),
            _Wanted(FEEDFORWARD, a.unit, FEEDFORWARD, a.body),
        ]
    return found


def _score(want: _Wanted, column: _Column, bodies: Collection[str]) -> float:
    """Return how well a column fits: its whole name, its words for quantity and body, and its unit.

    `bodies` are those of the model: where it has no load "c", a carriage may be any of them.
    """
    name, key, words, unit = column.name.lower(), want.key.lower(), column.words, column.unit
    if name == key:
        return 20.0
    if _plain(name) == _plain(key):
        return 19.0
    is_set_point = _is_set_point(words)
    adds = any(word in FEEDFORWARD_WORDS or word.startswith("vorsteuer") for word in words)
    if want.measures in INPUTS:
        return 3.0 * (adds if want.measures == FEEDFORWARD else is_set_point) * _suits(want, column)
    # of a force often the set point is logged
    score = -1.0 * is_set_point if want.measures == "force" else -4.0 * is_set_point
    score -= 4.0 * adds
    score += 0.5 * any(word in MEASURED_WORDS for word in words)
    score += 2.0 * any(word in QUANTITIES.get(want.measures, ()) for word in words)
    others = [name for name in QUANTITIES if name != want.measures]
    score -= 1.5 * any(word in QUANTITIES[name] for name in others for word in words if len(word) > 2)
    body_words = BODIES.get(want.body, (want.body.lower(),))
    score += 2.0 * any(word in body_words for word in words)
    score -= 2.0 * any(
        word in BODIES[name] for name in BODIES if name in bodies and name != want.body for word in words
    )
    # a letter or two stand in many names by chance
    score += 2.0 * (key in (name if len(key) > 2 else words))
    if unit is not None:
        if unit.si == want.unit:
            score += 3.0
        else:
            score += 1.0 if unit.si in (*LOGGED_AS.get(want.unit, ()), COUNTS) else -4.0
    return score


def _suits(want: _Wanted, column: _Column) -> bool:
    """Return whether a column's unit is that of an input of the loop, or its words where it has none."""
    if column.unit is not None:
        return column.unit.si == want.unit
    said = {key for key in QUANTITIES if any(word in QUANTITIES[key] for word in column.words)}
    quantity = REFERENCES.get(want.measures, "force")
    return quantity in said or (not said and quantity != "velocity")


def _words(name: str) -> list[str]:
    """Split "fActPosMotor" into act, pos, motor, "q_j2" into q, j, j2, "iref" into i, ref, "qm" into q, m.

    T is a torque, t is not.
    """
    spaced = re.sub(r"([a-z0-9])([A-Z])", r"\1 \2", name)
    spaced = re.sub(r"\bT(?=\b|[a-z]\b|[0-9_])", "torque ", spaced)
    words = [part for word in re.split(r"[^A-Za-z]+", spaced) if word for part in _parts(word.lower())]
    numbered = [word.lower() for word in re.split(r"[^A-Za-z0-9]+", spaced) if re.search(r"[0-9]", word)]
    return [*words, *numbered]


def _parts(word: str) -> list[str]:
    """Take words apart that people write as one: a letter or two in front of "ref", a quantity and a body."""
    if word in KNOWN_WORDS:
        return [word]
    if word.startswith("soll") and word.removeprefix("soll") in KNOWN_WORDS:
        return ["soll", word.removeprefix("soll")]
    for end in (*SET_POINT_WORDS, *MEASURED_WORDS):
        if len(end) > 2 and word.endswith(end) and len(word) - len(end) <= 2:
            return [word.removesuffix(end), end]
    # "motorlage", "loadpos"
    for k in range(3, len(word) - 2):
        if word[:k] in KNOWN_WORDS and word[k:] in KNOWN_WORDS:
            return [word[:k], word[k:]]
    # "istdrehmoment", "antriebsmoment", "motorlageistwert"
    last = next((part for part in LAST_PARTS if word.endswith(part)), None)
    if last is not None:
        rest = word.removesuffix(last)
        return [*_parts(rest if rest in KNOWN_WORDS else rest.removesuffix("s")), last]
    return list(word) if len(word) == 2 else [word]


def _is_set_point(words: Sequence[str]) -> bool:
    return any(word in SET_POINT_WORDS or word.startswith(("soll", "setpoint")) for word in words)


def _plain(name: str) -> str:
    """Return a name without what people vary: "q_m", "qM" and "Q.m" are the same."""
    return re.sub(r"[\W_]+", "", name).lower()


def _keys(columns: Sequence[str]) -> list[str]:
    """Return one channel key a column: letters, digits and _, each of its own."""
    keys: dict[str, None] = {}
    next_count: dict[str, int] = {}
    for column in columns:
        text = re.sub(r"\W+", "_", column.rpartition(".")[2], flags=re.ASCII).strip("_") or "channel"
        text = text if text[0].isalpha() else f"channel_{text}"
        key, stem = text[:60], text[:57]
        while key in keys:
            next_count[stem] = next_count.get(stem, 1) + 1
            key = f"{stem}_{next_count[stem]}"
        keys[key] = None
    return list(keys)
