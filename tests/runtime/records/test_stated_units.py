"""What a file says of its units goes with the record: no door takes amperes for N m, or degrees for rad."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import modelgen
from generated import emps_rigid_qm as module
from modelgen.errors import DataError
from modelgen.runtime.prediction.compare import compare
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.closed_loop import PositionVelocityController
from modelgen.runtime.simulation.validate import validate

MODEL = modelgen.load_model(module.__file__)
SENSOR, FORCE = MODEL.channels
WANTED = MODEL.channel_units[FORCE]
GUESS = dict.fromkeys(MODEL.parameters, 1.0)
T = np.arange(400) / 1000.0


def written(path: Path, unit: str, title: str = FORCE) -> Path:
    table = np.column_stack([T, np.sin(9.0 * T), np.cos(9.0 * T), np.sin(9.0 * T)])
    header = f"t,{SENSOR},{title} [{unit}],reference"
    np.savetxt(path, table, delimiter=",", header=header, comments="")
    return path


def from_file(path: Path, scales: dict[str, float] | None = None) -> Record:
    return modelgen.read_record(path, scales=scales)


def from_frame(path: Path, scales: dict[str, float] | None = None) -> Record:
    pandas = pytest.importorskip("pandas")
    return modelgen.record_from_frame(pandas.read_csv(path), scales=scales)


def loop(record: Record) -> Any:
    return validate(MODEL, GUESS, [record], PositionVelocityController(1.0, 1.0))


DOORS: dict[str, Callable[[Record], Any]] = {
    "identify": lambda record: modelgen.identify(MODEL, [record]),
    "identify a part": lambda record: modelgen.identify(MODEL, record.part(0, 300, "part")),
    "identify some": lambda record: modelgen.identify(MODEL, record.select(MODEL.channels)),
    "identify a copy": lambda record: modelgen.identify(MODEL, pickle.loads(pickle.dumps(record))),
    "identify changed": lambda record: modelgen.identify(MODEL, record.edited({"more": T})),
    "validate": loop,
    "compare": lambda record: compare(MODEL, GUESS, [record]),
}


@pytest.mark.parametrize("door", DOORS)
@pytest.mark.parametrize("unit", ["A", "furlong", "%"])
def test_another_unit_is_refused(tmp_path: Path, unit: str, door: str) -> None:
    record = from_file(written(tmp_path / "run.csv", unit))
    unknown = ", a unit that is not known" if unit == "furlong" else ""
    words = f"channel {FORCE}: is in {unit}{unknown}, and {WANTED} is needed; give its factor"
    with pytest.raises(DataError, match=words):
        DOORS[door](record)


@pytest.mark.parametrize("read", [from_file, from_frame])
def test_a_factor_ends_it_and_a_known_unit_is_converted(tmp_path: Path, read: Callable[..., Record]) -> None:
    current = written(tmp_path / "current.csv", "A")
    assert read(current).units == {FORCE: "A"}
    assert dict(read(current, {FORCE: 0.043}).units) == {}
    milli = read(written(tmp_path / "milli.csv", f"m{WANTED.replace(' ', '')}"))
    assert milli.units == {FORCE: WANTED}
    assert milli.signals[FORCE][0] == pytest.approx(1e-3)
    assert read(written(tmp_path / "none.csv", "-")).units == {FORCE: "-"}  # which says nothing
    assert copy.deepcopy(milli).units == milli.units


def test_units_are_texts_of_channels() -> None:
    for units in (["rad"], {"q": 1}, {"other": "rad"}, {"q": "\x1b[2J"}):
        with pytest.raises(DataError, match="record: unit"):
            Record({"q": T}, 1000.0, units=units)  # type: ignore[arg-type]
