"""Files laid out as instruments write them give what was logged, and say what was taken for what."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from modelgen.errors import DataError
from modelgen.runtime.files.formats import open_source
from modelgen.runtime.records.read_record import read, read_record

N = 40
FS_HZ = 2000.0
THETA = np.round(np.cumsum(np.sin(np.arange(N) / 5.0)), 6)  # deg
ACC = np.round(np.cos(np.arange(N) / 3.0), 6)
TORQUE = np.round(np.sin(np.arange(N) / 4.0), 6)
TIMES_MS = np.arange(N) / 2.0


def comma(value: float) -> str:
    return f"{value:.9g}".replace(".", ",")


def point(value: float) -> str:
    return f"{value:.9g}"


def save(folder: Path, name: str, lines: Sequence[str], encoding: str = "utf-8") -> Path:
    path = folder / name
    path.write_text("\r\n".join(lines) + "\r\n", encoding=encoding, newline="")
    return path


def twincat(folder: Path, shift_ms: float = 0.0, slow: int = 1) -> Path:
    """Two groups of channels, each with a column of times; the second may be shifted and slower."""
    lines = [
        "Name\tYT Scope Project",
        "File\tC:\\TwinCAT\\run.csv",
        "Starttime of export\t132959733843760000\tMontag, 2. Mai 2022\t15:56:24.376",
        "Endtime of export\t132959733853750000\tMontag, 2. Mai 2022\t15:56:25.375",
        "",
        "",
        "Name\tfPosMotor\tfTorque\tName\tfAccLoad",
        "SymbolComment\t\t\tSymbolComment\t",
        "Data-Type\tREAL64\tREAL64\tData-Type\tREAL64",
        f"SampleTime[ms]\t0,5\t0,5\tSampleTime[ms]\t{comma(0.5 * slow)}",
        "SymbolName\tMAIN.fPosMotor\tMAIN.fTorque\tSymbolName\tMAIN.fAccLoad",
        "Port\t851\t851\tPort\t851",
        "Unit\tdeg (Angle)\t(None)\tUnit\t(None)",
        "Unit ScaleFactor\t1\t1\tUnit ScaleFactor\t1",
        "",
    ]
    for k in range(N):
        cells = [comma(TIMES_MS[k]), comma(THETA[k]), comma(TORQUE[k])]
        if k * slow < N:
            cells += [comma(TIMES_MS[k] * slow + shift_ms), comma(ACC[k * slow])]
        lines.append("\t".join(cells))
    return save(folder, "scope.csv", [*lines, "EOF"])


def siemens(folder: Path) -> Path:
    lines = [
        "Trace_1;;;",
        'Gerät;"CU320-2 PN";;',
        "Datum;02.05.2022 15:56:24;;",
        "",
        "Zeit;Lageistwert;Drehmoment;Beschleunigung",
        "ms;°;Nm;rad/s²",
        *(";".join(map(comma, row)) for row in zip(TIMES_MS, THETA, TORQUE, ACC, strict=True)),
    ]
    return save(folder, "trace.csv", lines, "latin-1")


def dspace(folder: Path) -> Path:
    lines = [
        "created by,dSPACE ControlDesk,7.4",
        "",
        "trace_names,,theta,torque,acc",
        'path,,"Model Root/Encoder","Model Root/Drive","Model Root/Acc"',
        "unit,s,deg,N*m,rad/s^2",
        f"trace_values,{point(0.0)},{point(THETA[0])},{point(TORQUE[0])},{point(ACC[0])}",
    ]
    for k in range(1, N):
        lines.append(f",{point(TIMES_MS[k] / 1e3)},{point(THETA[k])},{point(TORQUE[k])},{point(ACC[k])}")
    return save(folder, "rec1.csv", lines)


def dspace_mat(folder: Path) -> Path:
    from scipy.io import savemat

    X = np.zeros((1,), dtype=[("Name", "O"), ("Data", "O")])
    X[0] = ("", TIMES_MS / 1e3)
    Y = np.zeros((3,), dtype=[("Name", "O"), ("Unit", "O"), ("Data", "O")])
    Y[0] = ('Model Root/Encoder/"theta"', "deg", THETA)
    Y[1] = ('Model Root/Drive/"torque"', "N*m", TORQUE)
    Y[2] = ('Model Root/Acc/"acc"', "rad/s^2", ACC)
    path = folder / "rec1.mat"
    savemat(path, {"rec1_001": {"X": X, "Y": Y, "Description": "run"}})
    return path


def keysight(folder: Path) -> Path:
    rows = zip(TIMES_MS / 1e3, THETA, TORQUE, ACC, strict=True)
    lines = ["x-axis,1,2,3", "second,deg,Volt,Volt", *(",".join(f"{v:+.8E}" for v in row) for row in rows)]
    return save(folder, "scope_0.csv", lines)


def pico(folder: Path) -> Path:
    rows = zip(TIMES_MS, THETA, TORQUE, ACC, strict=True)
    head = ["Time,Channel A,Channel B,Channel C", "(ms),(deg),(V),(V)", ""]
    return save(folder, "pico.csv", [*head, *(",".join(map(point, row)) for row in rows)])


def tektronix(folder: Path) -> Path:
    lines = [
        "Model,MSO54",
        "Firmware Version,1.24.8",
        "",
        "Waveform Type,ANALOG",
        "Point Format,Y",
        "Horizontal Units,s",
        "Sample Interval,5.0E-4",
        f"Record Length,{N}",
        "Vertical Units,V,V,V",
        "Label,,,",
        "TIME,CH1,CH2,CH3",
        *(",".join(map(point, row)) for row in zip(TIMES_MS / 1e3, THETA, TORQUE, ACC, strict=True)),
    ]
    return save(folder, "tek.csv", lines)


def lecroy(folder: Path) -> Path:
    lines = [
        "LECROYWS452,12345,Waveform",
        f"Segments,1,SegmentSize,{N}",
        "Segment,TrigTime,TimeSinceSegment1",
        "#1,02-May-2022 15:56:24,0",
        "Time,Ampl",
        *(",".join(map(point, row)) for row in zip(TIMES_MS / 1e3, THETA, strict=True)),
    ]
    return save(folder, "lecroy.csv", lines)


COLUMNS = {
    "twincat": (twincat, {"q": "fPosMotor", "F": "fTorque"}),
    "siemens": (siemens, {"q": "Lageistwert", "F": "Drehmoment", "a": "Beschleunigung"}),
    "dspace": (dspace, {"q": "theta", "F": "torque", "a": "acc"}),
    "dspace mat": (dspace_mat, {"q": "theta", "F": "torque", "a": "acc"}),
    "keysight": (keysight, {"q": "1", "F": "2", "a": "3"}),
    "pico": (pico, {"q": "Channel A", "F": "Channel B", "a": "Channel C"}),
}


@pytest.mark.parametrize("instrument", COLUMNS)
def test_units_and_times_are_converted_and_told(tmp_path: Path, instrument: str) -> None:
    write, mapping = COLUMNS[instrument]
    reading = read(write(tmp_path), mapping)
    record = reading.record
    assert record.fs == FS_HZ
    np.testing.assert_allclose(record.signals["q"], THETA * math.pi / 180.0, rtol=1e-8)
    np.testing.assert_allclose(record.signals["F"], TORQUE, rtol=1e-8)
    if "a" in mapping:
        np.testing.assert_allclose(record.signals["a"], ACC, rtol=1e-8)
    assert any("converted from" in text and text.endswith("to rad") for text in reading.took)
    assert reading.mended == ()


@pytest.mark.parametrize("write", [tektronix, lecroy])
def test_scopes_without_a_line_of_units(tmp_path: Path, write: Any) -> None:
    source = open_source(write(tmp_path))
    record = read_record(source.path, {"q": source.names[1]})
    assert record.fs == FS_HZ
    np.testing.assert_allclose(record.signals["q"], THETA)


def test_old_tektronix_has_its_samples_beside_the_metadata(tmp_path: Path) -> None:
    head = [
        f"Record Length,{N}",
        "Sample Interval,5.0E-4",
        "Trigger Point,0",
        "Vertical Units,V",
        "Source,CH2",
    ]
    lines = []
    for k in range(N):
        left = head[k] if k < len(head) else ","
        lines.append(f"{left},,{point(TIMES_MS[k] / 1e3)},{point(TORQUE[k])},")
    record = read_record(save(tmp_path, "F0000CH2.CSV", lines), {"F": "CH2"})
    assert (record.fs, record.n) == (FS_HZ, N)
    np.testing.assert_allclose(record.signals["F"], TORQUE)


def test_rigol_states_start_and_increment(tmp_path: Path) -> None:
    lines = ["X,CH1,CH2,Start,Increment,", "Sequence,Volt,Volt,-3.0e-2,5.0e-4,"]
    lines += [f"{k},{point(THETA[k])},{point(TORQUE[k])},," for k in range(N)]
    record = read_record(save(tmp_path, "NewFile1.csv", lines), {"q": "CH1", "F": "CH2"})
    assert (record.fs, record.n) == (FS_HZ, N)
    np.testing.assert_allclose(record.signals["F"], TORQUE)


def test_channels_with_times_of_their_own_are_joined_only_on_request(tmp_path: Path) -> None:
    path = twincat(tmp_path, shift_ms=0.25)
    mapping = {"q": "fPosMotor", "a": "fAccLoad"}
    with pytest.raises(DataError, match=r"a starts 0.00025 s after q.*--mend clocks"):
        read_record(path, mapping)
    reading = read(path, mapping, mend=("clocks",))
    assert reading.record.n == N - 1
    np.testing.assert_allclose(reading.record.signals["q"], THETA[1:] * math.pi / 180.0)
    expected = np.cos((np.arange(1, N) - 0.5) / 3.0)
    np.testing.assert_allclose(reading.record.signals["a"], expected, atol=2e-3)
    assert "a interpolated to the times of q (it started 0.25 ms later)" in reading.mended


def test_a_slower_group_ends_earlier(tmp_path: Path) -> None:
    path = twincat(tmp_path, slow=2)
    assert read_record(path, {"a": "fAccLoad"}).fs == FS_HZ / 2
    joined = read_record(path, {"q": "fPosMotor", "a": "fAccLoad"}, mend=("clocks",))
    assert joined.fs == FS_HZ
    np.testing.assert_allclose(joined.signals["a"][::2], ACC[: joined.n : 2])


def test_a_scale_of_ones_own_goes_before_the_stated_unit(tmp_path: Path) -> None:
    reading = read(siemens(tmp_path), {"q": "Lageistwert"}, {"q": 2.0})
    np.testing.assert_allclose(reading.record.signals["q"], 2.0 * THETA)
    assert not any("converted" in text for text in reading.took)


def test_a_title_may_be_given_with_its_unit(tmp_path: Path) -> None:
    path = save(tmp_path, "a.csv", ["t [ms],theta [deg]", "0,0", "1,180", "2,360"])
    for column in ("theta", "theta [deg]"):
        record = read_record(path, {"q": column})
        np.testing.assert_allclose(record.signals["q"], [0.0, math.pi, 2.0 * math.pi])
        assert record.fs == 1000.0


def test_an_unknown_unit_is_told_and_left(tmp_path: Path) -> None:
    path = save(tmp_path, "a.csv", ["t,theta [furlong]", "0,0", "1e-3,180", "2e-3,360"])
    reading = read(path, {"q": "theta"})
    assert "q: column theta is in 'furlong', an unknown unit; not converted" in reading.took
    np.testing.assert_array_equal(reading.record.signals["q"], [0.0, 180.0, 360.0])


def test_a_mistake_below_a_line_of_units_is_located(tmp_path: Path) -> None:
    lines = ["t;theta", "ms;deg", "0;0", "1;2", "2;3;4"]
    with pytest.raises(DataError, match="line 5: has 3 cells, the header has 2"):
        read_record(save(tmp_path, "a.csv", lines))
    with pytest.raises(DataError, match="line 5, column theta: is 'x', no number"):
        read_record(save(tmp_path, "a.csv", [*lines[:-1], "2;x"]))


def test_the_unit_of_times_may_be_given(tmp_path: Path) -> None:
    path = save(tmp_path, "a.csv", ["t,q", "0,0", "500,1", "1000,2"])
    assert read_record(path, time_unit="us").fs == FS_HZ
    with pytest.raises(DataError, match="'kg' is no unit of time; give s, ms, us, ns or days"):
        read_record(path, time_unit="kg")
