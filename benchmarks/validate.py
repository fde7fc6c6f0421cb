"""Closed-loop validation on the EMPS bench, compared with the published errors.

    python benchmarks/validate.py FOLDER

FOLDER holds DATA_EMPS.mat (Janot, Gautier, Brunot 2019). Prints norm(measured - simulated) over
norm(measured) in % for both friction models: identified and validated on the whole record, and identified on
its first half and validated on the second.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from generated import emps_rigid_asymmetric_qm, emps_rigid_qm
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.records.read_record import read_record
from modelgen.runtime.simulation.closed_loop import PositionVelocityController
from modelgen.runtime.simulation.drive import Drive
from modelgen.runtime.simulation.validate import split, validate

PUBLISHED = {"position": 0.01375, "velocity": 0.229, "acceleration": 8.60, "force": 5.85}
COLUMNS = {"q_m": "qm", "F": "vir", "reference": "qg"}
POSITION_GAIN, VELOCITY_GAIN, FORCE_GAIN = 160.18, 243.45, 35.15065188


def main() -> None:
    """Print the table."""
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=raw)
    parser.add_argument("folder", type=Path)
    path = parser.parse_args().folder / "DATA_EMPS.mat"
    record = read_record(path, COLUMNS, {"F": "gtau"}, fs=1000.0, needed=tuple(COLUMNS))
    kv = VELOCITY_GAIN * FORCE_GAIN
    loop = PositionVelocityController(POSITION_GAIN * kv, kv, rate_gain=0.0)
    drive = Drive(rate_hz=1000.0, velocity="central")
    first, rest = split(record, 0.5)
    for module in (emps_rigid_qm, emps_rigid_asymmetric_qm):
        model = model_from_module(module)
        for used, checked in ((record, record), (first, rest)):
            parameters = identify(model, [used]).physical
            (found,) = validate(model, parameters, [checked], loop, drive=drive, cutoff_hz=100.0)
            errors = ", ".join(
                f"{kind} {found.check(channel, kind).relative_error:.4g} (published {limit})"
                for kind, limit in PUBLISHED.items()
                for channel in ("F" if kind == "force" else "q_m",)
            )
            print(f"{model.chain}, from {used.name} on {checked.name}: {errors}")


if __name__ == "__main__":
    main()
