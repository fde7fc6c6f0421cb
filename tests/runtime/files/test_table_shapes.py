"""Tables on their side and lists of readings are refused with what to do; what resembles them is read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from modelgen.errors import DataError
from modelgen.runtime.records.read_record import read_record

TIMES = [0.001 * k for k in range(60)]


@pytest.mark.parametrize("width", [40, 20_000])
@pytest.mark.parametrize("unit", ["", ";rad"])
def test_a_table_on_its_side(tmp_path: Path, width: int, unit: str) -> None:
    numbers = ";".join(f"{0.5 * k:g}".replace(".", ",") for k in range(width))
    path = tmp_path / "side.csv"
    path.write_text("\n".join(f"{name}{unit};{numbers}" for name in ("t", "q_m", "tau")))
    with pytest.raises(DataError, match=r"has one line a channel.*transpose it"):
        read_record(path)


def test_a_list_of_readings(tmp_path: Path) -> None:
    path = tmp_path / "long.csv"
    lines = [f"{t},{name},{t + k}" for t in TIMES for k, name in enumerate(("q_m", "tau"))]
    path.write_text("\n".join(["time,signal,value", *lines]))
    with pytest.raises(DataError, match=r"column signal: q_m, tau\); write one column a channel"):
        read_record(path)


def test_states_in_a_column_are_no_channels(tmp_path: Path) -> None:
    path = tmp_path / "states.csv"
    lines = [f"{t},{'RUN' if k % 2 else 'IDLE'},{k // 20}" for k, t in enumerate(TIMES)]
    path.write_text("\n".join(["time,state,q_m", *lines]))
    samples = read_record(path, {"q_m": "q_m"}).signals["q_m"]
    np.testing.assert_array_equal(samples, [k // 20 for k in range(60)])


def test_channels_called_1_2_3_and_lines_of_metadata_are_no_samples(tmp_path: Path) -> None:
    path = tmp_path / "numbered.csv"
    heads = ["Bench;3", "Rate;1000", "t;1;2;3;4;5;6;7;8;9;10"]
    lines = [";".join([f"{t:g}", *(str(k) for k in range(10))]) for t in TIMES]
    path.write_text("\n".join([*heads, *lines]))
    assert read_record(path, {"q_m": "9"}).signals["q_m"][0] == 8.0
