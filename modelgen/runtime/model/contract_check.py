"""What a generated module must offer: every public name, its shape, and that the names refer to each other.

`module_problems` collects one problem per violation, so that a broken module is reported whole.
"""

from __future__ import annotations

from collections import Counter
from pathlib import PurePath
from typing import Any

from modelgen.errors import Problem
from modelgen.runtime.model.arm_contract import arm_problems
from modelgen.runtime.model.column_check import column_problems, is_terms
from modelgen.runtime.model.contract_kinds import (
    COMMON,
    COUNT,
    LEVER,
    ORDER,
    PAIR_OR_NONE,
    TEXT,
    TEXT_OR_NONE,
    TEXTS,
    TEXTS_BY_NAME,
    Kind,
    is_combination,
    is_text,
    one_of,
    shape_problems,
)

VERSION = 1
# Modules of arms keep a contract of their own.
ARM_VERSION = 2
REMEDY = "generate the module again with this version of modelgen"
MEASURES = ("position", "velocity", "acceleration")
FUNCTIONS = ("sign", "forward", "backward", "cube")
ROLE_NAMES = ("inertia", "viscous", "coulomb", "offset", "stiffness", "damping", "stiffness3", "bending")


VALUES: dict[str, Kind] = {"CHAIN": TEXT, "SENSOR_SET": TEXT, "COMPOSITES": TEXTS_BY_NAME, **COMMON}
ENTRIES: dict[str, dict[str, Kind]] = {
    "SENSORS": {
        "key": TEXT,
        "body": TEXT_OR_NONE,
        "deflection": PAIR_OR_NONE,
        "measures": one_of(MEASURES),
        "unit": TEXT,
    },
    "ACTUATORS": {"key": TEXT, "body": TEXT, "unit": TEXT, "lever": LEVER},
    "SIGNALS": {
        "key": TEXT,
        "sensor": TEXT_OR_NONE,
        "actuator": TEXT_OR_NONE,
        "derivative": ORDER,
        "unit": TEXT,
    },
    "FEATURES": {
        "key": TEXT,
        "function": one_of(FUNCTIONS),
        "of": Kind(
            "a signal's key or (coefficient, key) pairs", lambda value: is_text(value) or is_terms(value)
        ),
        "times": TEXT_OR_NONE,
    },
    "ROWS": {
        "name": TEXT,
        "origin": TEXT,
        "bodies": TEXTS,
        "differentiated": ORDER,
        "order": ORDER,
        "reversals": TEXTS,
        "unit": TEXT,
        "lever": LEVER,
    },
    "FRICTION": {
        "body": TEXT,
        "state": COUNT,
        "coulomb_plus": TEXT_OR_NONE,
        "coulomb_minus": TEXT_OR_NONE,
        "offset": TEXT_OR_NONE,
        "asymmetric": Kind("True or False", lambda value: isinstance(value, bool)),
    },
    "CUBIC_SPRINGS": {
        "parameter": TEXT,
        "deflection": Kind("(coordinate, coefficient) pairs", is_combination),
    },
}
# Only chains with such springs have it.
OPTIONAL = ("CUBIC_SPRINGS",)
ROLE = {"role": one_of(ROLE_NAMES), "bodies": TEXTS}
FUNCTION_NAMES = (
    "features",
    "measurement",
    "regressor",
    "columns",
    "base_from_physical",
    "base_jacobian",
    "physical_from_base",
    "state_space",
    "identify",
)


def is_arm(module: Any) -> bool:
    """Return whether a module keeps the contract of arms."""
    return getattr(module, "CONTRACT_VERSION", None) == ARM_VERSION and hasattr(module, "ARM")


def module_problems(module: Any) -> tuple[Problem, ...]:
    """Return one problem per violation of the contract; none for a module the runtime can use."""
    if isinstance(module, str | PurePath):
        what = f"is the text {str(module)!r}, not a generated module"
        return (Problem("model", what, "load it first: modelgen.load_model(path)"),)
    where = getattr(module, "__file__", None) or getattr(module, "__name__", None) or "model"
    version = getattr(module, "CONTRACT_VERSION", None)
    if is_arm(module):
        return tuple(Problem(f"{where}: {place}", what, REMEDY) for place, what in arm_problems(module))
    if version != VERSION:
        what = "is absent" if version is None else f"is {version!r}, this modelgen reads {VERSION}"
        return (Problem(f"{where}: CONTRACT_VERSION", what, REMEDY),)
    entries = {
        name: kinds for name, kinds in ENTRIES.items() if name not in OPTIONAL or hasattr(module, name)
    }
    found = shape_problems(module, VALUES, entries, ROLE, FUNCTION_NAMES)
    # references and columns can only be followed once every entry has its shape
    found = found or _reference_problems(module)
    found = found or column_problems(module)
    return tuple(Problem(f"{where}: {place}", what, REMEDY) for place, what in found)


def _reference_problems(module: Any) -> list[tuple[str, str]]:
    """Return (place, what is wrong) for keys that are used twice or name nothing."""
    found = _repeated("SENSORS and ACTUATORS", [entry["key"] for entry in module.SENSORS + module.ACTUATORS])
    found += _repeated(
        "SIGNALS and FEATURES", [entry["key"] for entry in module.SIGNALS + module.FEATURES] + ["1"]
    )
    found += _repeated("ROWS", [row["name"] for row in module.ROWS])
    found += _repeated("PARAMETERS and KNOWN", [*module.PARAMETERS, *module.KNOWN])
    if not module.ROWS:
        found.append(("ROWS", "is empty"))
    if not module.SIGNALS:
        found.append(("SIGNALS", "is empty"))
    for index, sensor in enumerate(module.SENSORS):
        if (sensor["body"] is None) == (sensor["deflection"] is None):
            found.append((f"SENSORS[{index}]", "needs either a body or a deflection"))
    found += _coordinate_problems(module)
    for place, name, allowed, kind in _references(module):
        if name not in allowed:
            found.append((place, f"names {name!r}, which is no {kind}"))
    return found


def _coordinate_problems(module: Any) -> list[tuple[str, str]]:
    """Return what is wrong with cubic springs, one for each such parameter, and friction: the bodies."""
    springs = getattr(module, "CUBIC_SPRINGS", ())
    cubic = [name for name, entry in module.ROLES.items() if entry["role"] == "stiffness3"]
    named = [entry["parameter"] for entry in springs]
    found = [("CUBIC_SPRINGS", f"lacks {name!r}") for name in cubic if name not in named]
    found += [("CUBIC_SPRINGS", f"names {n!r}, which is no cubic stiffness") for n in named if n not in cubic]
    bodies = sum(len(entry["bodies"]) for entry in module.ROLES.values() if entry["role"] == "inertia")
    for index, entry in enumerate(springs):
        if any(place >= bodies for place, _ in entry["deflection"]):
            found.append((f"CUBIC_SPRINGS[{index}]", f"has a coordinate beyond the {bodies} bodies"))
    for index, entry in enumerate(module.FRICTION):
        if not bodies <= entry["state"] < 2 * bodies:
            found.append((f"FRICTION[{index}]['state']", f"is no velocity of the {bodies} bodies"))
    return found


def _repeated(place: str, keys: list[str]) -> list[tuple[str, str]]:
    twice = [key for key, times in Counter(keys).items() if times > 1]
    return [(place, f"use {key!r} twice") for key in twice]


def _references(module: Any) -> list[tuple[str, str, frozenset[str], str]]:
    """Return (place, name, allowed names, kind of thing) for every name that must point somewhere."""
    sensors = frozenset(entry["key"] for entry in module.SENSORS)
    actuators = frozenset(entry["key"] for entry in module.ACTUATORS)
    signals = frozenset(entry["key"] for entry in module.SIGNALS)
    parameters, physical = frozenset(module.PARAMETERS), frozenset((*module.PARAMETERS, *module.KNOWN))
    refs: list[tuple[str, str | None, frozenset[str], str]] = []
    for i, entry in enumerate(module.SIGNALS):
        refs.append((f"SIGNALS[{i}]['sensor']", entry["sensor"], sensors, "sensor"))
        refs.append((f"SIGNALS[{i}]['actuator']", entry["actuator"], actuators, "actuator"))
    for i, entry in enumerate(module.FEATURES):
        keys = (entry["of"],) if isinstance(entry["of"], str) else tuple(key for _, key in entry["of"])
        refs += [(f"FEATURES[{i}]['of']", key, signals, "signal") for key in keys]
        refs.append((f"FEATURES[{i}]['times']", entry["times"], signals, "signal"))
    for i, entry in enumerate(module.ROWS):
        refs += [(f"ROWS[{i}]['reversals']", key, signals, "signal") for key in entry["reversals"]]
    for i, entry in enumerate(module.FRICTION):
        names = (entry["coulomb_plus"], entry["coulomb_minus"], entry["offset"])
        refs += [(f"FRICTION[{i}]", name, physical, "parameter") for name in names]
    refs += [("IDENTIFIABLE", name, parameters, "parameter") for name in module.IDENTIFIABLE]
    refs += [("ABSENT", name, parameters, "parameter") for name in module.ABSENT]
    refs += [("ROLES", name, physical, "parameter") for name in module.ROLES]
    roles, units = frozenset(module.ROLES), frozenset(module.UNITS)
    refs += [("PARAMETERS", name, roles, "key of ROLES") for name in module.PARAMETERS]
    for name in dict.fromkeys((*module.PARAMETERS, *module.BASE_PARAMETERS)):
        refs.append(("UNITS", name, units, "key of UNITS"))
    for title, values in module.PARAMETER_SETS.items():
        refs += [(f"PARAMETER_SETS[{title!r}]", name, physical, "parameter") for name in values]
    return [(place, name, allowed, kind) for place, name, allowed, kind in refs if name is not None]
