"""What the generated module of an arm must offer (contract 2): names, shapes, what refers to what."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from modelgen.runtime.model.arm_channels import moving_joints
from modelgen.runtime.model.column_check import PROBED, SAMPLES, is_number
from modelgen.runtime.model.contract_kinds import (
    COMMON,
    FILLED_NAMES,
    TEXT,
    TEXT_OR_NONE,
    TEXTS,
    Kind,
    is_text,
    is_texts,
    maps_texts,
    one_of,
    shape_problems,
)

SIGNAL = re.compile(r"(?:(?:q|d1_q|d2_q)_(?P<joint>.+)|tau_(?P<force>.+)|base_[fn][xyz]|load_.+)\Z")
# Where sensors are said, the channel of each may be differentiated, and forces with the rows.
ORDERED = re.compile(r"(?:d[1-3]_)?(?P<channel>.+)\Z")
KINDS = ("revolute", "prismatic", "fixed")
SIDES = ("motor", "link", "deflection", "between")
MEASURES = ("position", "velocity", "acceleration", "torque", "gyro", "accelerometer")


def _is_matrix(value: Any) -> bool:
    return isinstance(value, tuple) and all(
        isinstance(row, tuple) and len(row) == len(value) and all(map(is_number, row)) for row in value
    )


def _is_numbers(value: Any, rows: int, columns: int) -> bool:
    return (
        isinstance(value, tuple)
        and len(value) == rows
        and all(isinstance(row, tuple) and len(row) == columns and all(map(is_number, row)) for row in value)
    )


def _is_speed(value: Any) -> bool:
    return (
        isinstance(value, tuple)
        and value != ()
        and all(
            isinstance(term, tuple)
            and len(term) == 3
            and is_number(term[0])
            and is_text(term[1])
            and type(term[2]) is int
            and term[2] in (0, 1)
            for term in value
        )
    )


def _is_places(value: Any) -> bool:
    return isinstance(value, tuple) and all(
        isinstance(pair, tuple) and len(pair) == 2 and all(type(n) is int and n >= 0 for n in pair)
        for pair in value
    )


VALUES: dict[str, Kind] = {
    "ARM": TEXT,
    "TRANSMISSION": Kind("a square matrix of numbers", _is_matrix),
    "SIGNALS": FILLED_NAMES,
    "ROW_KIND": one_of(("joint", "motor")),
    "ROWS": FILLED_NAMES,
    "ENTRIES": Kind("a tuple of pairs of row and column", _is_places),
    **COMMON,
}
TABLES = {"JOINTS": {"name": TEXT, "kind": one_of(KINDS), "parent": TEXT_OR_NONE}}
ROLE = {"role": TEXT, "bodies": TEXTS}
#: Of a module whose sensors are said: it has all of them, or none.
OF_SENSORS: dict[str, Kind] = {
    "SENSOR_SET": TEXT,
    "DIFFERENTIATED": Kind(
        "a tuple of 0 and 1",
        lambda v: isinstance(v, tuple) and all(type(n) is int and n in (0, 1) for n in v),
    ),
    "REVERSALS": Kind("a tuple of tuples of names", lambda v: isinstance(v, tuple) and all(map(is_texts, v))),
    "SPEEDS": Kind("a mapping of names to sums of channels", maps_texts(_is_speed)),
}
SENSORS = {
    "key": TEXT,
    "joint": TEXT,
    "side": one_of(SIDES),
    "measures": one_of(MEASURES),
    "channels": Kind("a non-empty tuple of strings", lambda value: is_texts(value) and value != ()),
}
#: Of some modules whose sensors are said.
GIVEN_SOMETIMES: dict[str, Kind] = {
    "ESTIMATED": Kind("a mapping of channels to rows", maps_texts(is_text)),
    "PLACEMENTS": Kind(
        "a tuple of frames of three rows of four numbers",
        lambda v: isinstance(v, tuple) and all(_is_numbers(frame, 3, 4) for frame in v),
    ),
    "GRAVITY": Kind("three numbers", lambda v: _is_numbers((v,), 1, 3)),
}
FUNCTION_NAMES = ("entries", "measurement", "regressor", "base_from_physical")


def arm_problems(module: Any) -> list[tuple[str, str]]:
    """Return (place, what is wrong) for every violation of the contract."""
    sensed = any(hasattr(module, name) for name in (*OF_SENSORS, "SENSORS"))
    values = {**VALUES, **(OF_SENSORS if sensed else {})}
    values |= {name: kind for name, kind in GIVEN_SOMETIMES.items() if sensed and hasattr(module, name)}
    tables = {**TABLES, **({"SENSORS": SENSORS} if sensed else {})}
    found = shape_problems(module, values, tables, ROLE, FUNCTION_NAMES)
    found = found or _references(module)
    if found:
        return found
    with np.errstate(all="ignore"):  # an overflow counts as a difference
        return _functions(module)


def _references(module: Any) -> list[tuple[str, str]]:
    """Return what names or places that do not exist."""
    if not module.JOINTS:
        return [("JOINTS", "is empty")]
    moving = moving_joints(module)
    names = frozenset((*module.PARAMETERS, *module.KNOWN))
    found = []
    if len(module.TRANSMISSION) != len(moving):
        found.append(("TRANSMISSION", f"is not of the {len(moving)} joints that move"))
    if hasattr(module, "PLACEMENTS") and len(module.PLACEMENTS) != len(module.JOINTS):
        found.append(("PLACEMENTS", f"are not of the {len(module.JOINTS)} joints"))
    found += _sensor_references(module, moving) if hasattr(module, "SENSORS") else _signals(module, moving)
    found += [
        ("ENTRIES", f"hold {pair!r}, which is no row and column")
        for pair in module.ENTRIES
        if pair[0] >= len(module.ROWS) or pair[1] >= len(module.BASE_PARAMETERS)
    ]
    for place in ("UNITS", "ROLES"):
        missing = sorted(names - frozenset(getattr(module, place)))
        found += [(place, f"lacks {name!r}") for name in missing]
    leading = [name.partition(" ")[0] for name in module.BASE_PARAMETERS]
    found += [("BASE_PARAMETERS", f"begin with {n!r}, no parameter") for n in leading if n not in names]
    alone = frozenset(module.BASE_PARAMETERS)
    found += [
        ("IDENTIFIABLE", f"hold {n!r}, no base parameter") for n in module.IDENTIFIABLE if n not in alone
    ]
    return found


def _signals(module: Any, moving: Sequence[str]) -> list[tuple[str, str]]:
    """Return which signals are of no joint."""
    found = []
    for key in module.SIGNALS:
        match = SIGNAL.match(key)
        joint = match and (match["joint"] or match["force"])
        if match is None or (joint and joint not in moving):
            found.append(("SIGNALS", f"hold {key!r}, which is of no joint"))
    return found


def _sensor_references(module: Any, moving: Sequence[str]) -> list[tuple[str, str]]:
    """Return what is of no sensor or joint, in a module whose sensors are said."""
    joints = [joint["name"] for joint in module.JOINTS]
    found = [
        ("SENSORS", f"hold {sensor['key']!r}, which is of no joint")
        for sensor in module.SENSORS
        if sensor["joint"] not in joints
    ]
    channels = [channel for sensor in module.SENSORS for channel in sensor["channels"]]
    forces = [f"tau_{name}" for name in moving]
    for key in module.SIGNALS:
        match = ORDERED.match(key)
        channel = match["channel"] if match else key
        if channel not in (*channels, *forces) and not SIGNAL.match(channel):
            found.append(("SIGNALS", f"hold {key!r}, which is of no sensor"))
    found += [
        ("SPEEDS", f"hold {channel!r}, which is no channel")
        for terms in module.SPEEDS.values()
        for _, channel, _ in terms
        if channel not in channels
    ]
    for channel, row in getattr(module, "ESTIMATED", {}).items():
        if channel not in channels or row not in module.ROWS:
            found.append(("ESTIMATED", f"holds {channel!r} from {row!r}, no channel or no row"))
    for name in ("DIFFERENTIATED", "REVERSALS"):
        if len(getattr(module, name)) != len(module.ROWS):
            found.append((name, "is not of the rows"))
    strange = {name for row in module.REVERSALS for name in row if name not in module.SPEEDS}
    found += [("REVERSALS", f"hold {name!r}, which is no speed") for name in sorted(strange)]
    return found


def _functions(module: Any) -> list[tuple[str, str]]:
    """Return what is wrong with the shapes that the functions return, and where two of them disagree."""
    rows, width = len(module.ROWS), len(module.BASE_PARAMETERS)
    rng = np.random.default_rng(0)
    signals = {key: rng.uniform(-1.0, 1.0, SAMPLES) for key in module.SIGNALS}
    try:
        entries, measured = module.entries(signals), module.measurement(signals)
        dense = module.regressor(signals)
        base = module.base_from_physical(dict.fromkeys(module.PARAMETERS, 1.0))
    except Exception as error:  # a broken module can raise any exception
        return [("functions", f"raise {type(error).__name__} ({error}) at {PROBED}")]
    shapes = {
        "entries()": (entries, (len(module.ENTRIES), SAMPLES)),
        "measurement()": (measured, (SAMPLES, rows)),
        "regressor()": (dense, (SAMPLES, rows, width)),
        "base_from_physical()": (base, (width,)),
    }
    found = [
        (place, f"does not return float64 of shape {shape}, for {SAMPLES} samples")
        for place, (value, shape) in shapes.items()
        if not (isinstance(value, np.ndarray) and value.dtype == np.float64 and value.shape == shape)
    ]
    if found:
        return found
    expected = np.zeros_like(dense)
    for (row, column), line in zip(module.ENTRIES, entries, strict=True):
        expected[:, row, column] = line
    return [] if np.array_equal(dense, expected) else [("regressor()", f"differs from entries() at {PROBED}")]
