"""More files as instruments and programs write them: two channels at 10 kHz in each."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from modelgen.errors import DataError
from modelgen.runtime.records.read_record import read

N, FS_HZ = 60, 10_000.0
T = np.arange(N) / FS_HZ
A = np.round(np.sin(np.arange(N) / 5.0), 6)
B = np.round(np.cos(np.arange(N) / 4.0), 6)


def comma(text: str) -> str:
    return text.replace(".", ",")


# what stands above the samples, one sample's line, and the first channel's name and factor to SI
FILES: dict[str, tuple[list[str], Callable[[int], str], str]] = {
    "siglent": (
        [
            "Record Length,Analog:60",
            "Sample Interval,Analog:1.000000E-04",
            "Vertical Units,CH1:V,CH2:V",
            "Vertical Scale,CH1:5.00,CH2:0.50",
            "Horizontal Units,s",
            "Model Number,SDS1104X-E",
            "Software Version,6.1.37R8",
            "Source,CH1,CH2",
            "Second,Volt,Volt",
        ],
        lambda k: f"{T[k]:.8f},{A[k]},{B[k]}",
        "CH1",
    ),
    "rohde & schwarz": (
        ['"in s","C1 in V","C2 in V"'],
        lambda k: f"{T[k]:.6e},{A[k]},{B[k]}",
        "C1",
    ),
    "rigol, increment among the names": (
        ["Time(s),CH1(V),CH2(V),t0 =-6.000000e-03, tInc = 1.000000e-04,"],
        lambda k: f",{A[k]},{B[k]},,",
        "CH1",
    ),
    "yokogawa": (
        [
            '"Header Size",16',
            '"Model Name","DL850E"',
            '"BlockNumber",1',
            '"TraceName","CH1","CH2"',
            '"BlockSize",60,60',
            '"VUnit","V","A"',
            '"SampleRate",1.0e+04,1.0e+04',
            '"HResolution",1.0e-04,1.0e-04',
            '"HUnit","s","s"',
            '"Date","2022/05/02","2022/05/02"',
            '"Time","15:56:24.12345","15:56:24.12345"',
            "",
        ],
        lambda k: f",{A[k]},{B[k]},",
        "CH1",
    ),
    "LabVIEW": (
        [
            "LabVIEW Measurement\t",
            "Separator\tTab",
            "Decimal_Separator\t,",
            "Date\t2022/05/02",
            "Time\t15:56:24,123",
            "***End_of_Header***\t",
            "\t",
            "Channels\t2\t",
            "Samples\t60\t60\t",
            "Y_Unit_Label\tVolts\tVolts\t",
            "X0\t0,0\t0,0\t",
            "Delta_X\t0,0001\t0,0001\t",
            "***End_of_Header***\t\t",
            "X_Value\tCH1\tCH2\tComment",
        ],
        lambda k: comma(f"{T[k]:.6f}\t{A[k]}\t{B[k]}"),
        "CH1",
    ),
    "Siemens data log, day and time apart": (
        ["Record,Date,UTC Time,CH1,Torque [Nm]"],
        lambda k: f"{k + 1},2022/05/02,15:56:{24 + T[k]:09.6f},{A[k]},{B[k]}",
        "CH1",
    ),
    "Siemens trace, everything quoted": (
        ['"Trace_1";"PLC_1";"2022-05-02 15:56:24"', '"Timestamp [ms]";"Axis_1.Position";"Axis_1.Torque"'],
        lambda k: comma(f'"{1e3 * T[k]:.3f}";"{A[k]}";"{B[k]}"'),
        "Axis_1.Position",
    ),
    "pandas with its index": ([",time,q_m,torque"], lambda k: f"{k},{T[k]:.6f},{A[k]},{B[k]}", "q_m"),
    "separated by spaces": (["time  q_m torque"], lambda k: f"{T[k]:10.6f} {A[k]:9.6f} {B[k]:9.6f}", "q_m"),
    "spreadsheet": (
        ["sep=;", "t [ms];q_m;torque"],
        lambda k: comma(f"{1e3 * T[k]:.2f};{A[k]};{B[k]}"),
        "q_m",
    ),
}


@pytest.mark.parametrize("instrument", FILES)
def test_readings_and_rate_come_back(tmp_path: Path, instrument: str) -> None:
    head, line, channel = FILES[instrument]
    path = tmp_path / "log.csv"
    path.write_bytes(("\r\n".join([*head, *map(line, range(N))]) + "\r\n").encode("cp1252"))
    reading = read(path)
    assert reading.record.fs == pytest.approx(FS_HZ, rel=1e-9)
    np.testing.assert_allclose(reading.record.signals[channel], A, atol=1e-12)
    assert reading.record.n == N
    assert reading.findings == ()


def test_what_is_left_out_is_told(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(
        ",time,q_m,spare\n" + "".join(f"{k},{k / 100},{k % 7},\n" for k in range(20)), encoding="utf-8"
    )
    reading = read(path)
    assert list(reading.record.signals) == ["q_m"]
    assert reading.took[-2:] == ("column spare is empty, left out", "the first column has no name, left out")


@pytest.mark.parametrize(
    "lines",
    [
        ["Time(s),CH1(V),t0 = x, tInc = y,", ",1,,", ",2,,"],
        ["X,CH1,Start,Increment,", "Sequence,Volt,0", "0,1,,", "1,2,,"],
        ["X,CH1,Start,Increment,", "Sequence,Volt,0,inf", "0,1,,", "1,2,,"],
        ['"TraceName"', '"HResolution"', ",1,", ",2,"],
        ['"TraceName","CH1"', '"HResolution",0', ",1,", ",2,"],
    ],
)
def test_a_damaged_head_is_explained(tmp_path: Path, lines: list[str]) -> None:
    path = tmp_path / "log.csv"
    path.write_text("\n".join(lines), encoding="utf-8")
    with pytest.raises(DataError):
        read(path)
