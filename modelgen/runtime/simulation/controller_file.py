"""A controller in TOML -> its law and its drive; every mistake of the file reported at once.

[controller]                 # either in SI ...
kp = 0.3                     # N m/rad or N/m
kv = 2e-3                    # N m s/rad or N s/m
rate_gain = 1.0              # share of the reference's rate that is fed forward

[controller]                 # ... or a cascade, as drives state it
position_gain = 160.18       # 1/s
velocity_gain = 243.45       # command per rad/s or m/s
force_gain = 35.15           # N m or N per unit of the command

[drive]                      # optional, see modelgen.runtime.simulation.drive.Drive
rate_hz = 1000.0
velocity = "central"
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from math import inf
from pathlib import Path
from typing import Any

from modelgen.documents import toml_document
from modelgen.errors import DataError, Problem
from modelgen.magnitudes import REMEDY, is_usable
from modelgen.read_file import CONTROLLER, read_text
from modelgen.runtime.records.record import missing_name
from modelgen.runtime.simulation.closed_loop import PositionVelocityController
from modelgen.runtime.simulation.drive import Drive

IN_SI = ("kp", "kv", "rate_gain")
CASCADE = ("position_gain", "velocity_gain", "force_gain")
DRIVE = tuple(field.name for field in fields(Drive))


def load_controller(path: Path) -> tuple[PositionVelocityController, Drive]:
    """Read a controller's file.

    Raises
    ------
    DataError
        When the file cannot be read as TOML, or a table or key is wrong or missing.
    """
    where = str(path)
    given = toml_document(read_text(path, CONTROLLER), where, ("controller", "drive"))
    problems = [missing_name(where, "table", key, ("controller", "drive")) for key in given if key not in
                ("controller", "drive")]  # fmt: skip
    law, drive = given.get("controller", {}), given.get("drive", {})
    for name, table in (("controller", law), ("drive", drive)):
        if not isinstance(table, dict):
            raise DataError.at(f"{where}: {name}", "is no table", f"write [{name}] and its keys below it")
    known = CASCADE if any(key in law for key in CASCADE) else IN_SI
    problems += _key_problems(f"{where}: controller", law, known, known[:2] if known is IN_SI else known)
    problems += _key_problems(f"{where}: drive", drive, DRIVE, ())
    DataError.raise_any(problems)
    return _controller(law), Drive(**drive)


def _key_problems(
    where: str, table: Mapping[str, Any], known: tuple[str, ...], needed: tuple[str, ...]
) -> list[Problem]:
    problems = [missing_name(where, "key", key, known) for key in table if key not in known]
    problems += [
        Problem(f"{where}.{key}", "is missing", f"give {', '.join(needed)}")
        for key in needed
        if key not in table
    ]
    for key, value in table.items():
        number = isinstance(value, (int, float)) and not isinstance(value, bool)
        if key in known and not (isinstance(value, str) if key == "velocity" else number):
            kind = "a text" if key == "velocity" else "a number"
            problems.append(Problem(f"{where}.{key}", f"is {value!r}", f"give {kind}"))
        elif key in known and number and value != inf and not is_usable(value):
            problems.append(Problem(f"{where}.{key}", f"is {value!r}", REMEDY))
    return problems


def _controller(law: Mapping[str, Any]) -> PositionVelocityController:
    if "position_gain" not in law:
        return PositionVelocityController(**{key: float(value) for key, value in law.items()})
    kv = float(law["velocity_gain"] * law["force_gain"])
    return PositionVelocityController(float(law["position_gain"]) * kv, kv, rate_gain=0.0)
