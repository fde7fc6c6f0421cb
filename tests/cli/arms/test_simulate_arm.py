"""`modelgen simulate` of arms: a record that identify reads, references from files, and every mistake."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from modelgen.cli.main import app
from modelgen.runtime.records.read_record import read_record
from modelgen.spec.load import catalog_path

RUN = CliRunner()


def simulate(*arguments: str | Path) -> tuple[int, str]:
    result = RUN.invoke(app, ["simulate", *map(str, arguments)])
    return result.exit_code, " ".join(result.output.split())


def test_a_record_is_written_and_its_reference_is_followed_again(tmp_path: Path) -> None:
    first, second = tmp_path / "first.csv", tmp_path / "second.csv"
    loop = tmp_path / "loop.toml"
    loop.write_text('[controller]\nlaw = "computed_torque"\nbandwidth_hz = 4\n')
    common = ("--controller", loop, "--with-reference")
    code, output = simulate(
        "two_link", "--excitation", "fourier", "--duration-s", 1, "--fs", 500, "-o", first, *common
    )
    assert code == 0 and "501 samples at 500 Hz" in output, output
    read = read_record(first)
    assert {"q_1", "q_2", "tau_1", "tau_2", "reference_1", "reference_rate_2"} <= set(read.signals)
    assert np.abs(read.signals["reference_1"] - read.signals["q_1"]).max() < 0.05
    code, output = simulate("two_link", "--excitation", first, "-o", second)
    assert code == 0, output
    apart = read_record(second).signals["q_2"] - read.signals["q_2"]
    assert 0.0 < np.abs(apart).max() < 0.1


def test_an_elastic_arm_is_read_by_its_sensor_set(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    options = ("--excitation", "fourier", "--duration-s", 1, "--noise", "g_2_z=1e-3", "-o", path)
    code, output = simulate("elastic_two_link", "--sensors", "rates", *options)
    assert code == 0, output
    read = read_record(path).signals
    assert list(read) == ["qm_1", "qm_2", *(f"g_{n}_{x}" for n in "12" for x in "xyz"), "tau_1", "tau_2"]
    assert not read["g_1_x"].any()  # the arm moves in a plane
    noise = np.diff(read["g_2_z"], 4) / 70**0.5
    assert np.std(noise) == pytest.approx(1e-3, rel=0.2)


@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        (("two_link", "--excitation", "chirp"), "fourier"),
        (("two_link", "--excitation", "fourier", "--sensors", "s"), "leave it out"),
        (("two_link", "--excitation", "fourier", "--noise", "q_7=1"), "q_7"),
        (("elastic_two_link", "--excitation", "fourier"), "encoders, rates, torques"),
        (("elastic_two_link", "--excitation", "fourier", "--sensors", "s"), "no sensor set"),
        (("two_link", "--excitation", "fourier", "--duration-s", "0"), "samples"),
        (("emps300", "--excitation", "chirp"), "--sensors"),
    ],
)
def test_mistakes_are_told(tmp_path: Path, arguments: tuple[str, ...], what: str) -> None:
    code, output = simulate(*arguments, "-o", tmp_path / "run.csv")
    assert code == 2 and what in output, output
    assert not list(tmp_path.iterdir())


def test_an_arm_without_values_is_told_to_have_some(tmp_path: Path) -> None:
    text = catalog_path("puma560").read_text(encoding="utf-8").partition("[parameters.")[0]
    (tmp_path / "arm.toml").write_text(text)
    code, output = simulate(tmp_path / "arm.toml", "--excitation", "fourier", "-o", tmp_path / "run.csv")
    assert code == 2 and "--parameters" in output and not (tmp_path / "run.csv").exists(), output


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ('[controller]\nlaw = "pid"\n', "pd"),
        ("[controller]\nkp = [1, 2, 3]\n", "3 numbers for 2 joints"),
        ("[controller]\nkp = [1, true]\n", "kp"),
        ("[controller]\nbandwidth_hz = -1\n", "positive"),
        ("[controler]\nkp = 1\n", "controller"),
        ("[controller]\nkq = 1\n", "kp"),
        ("controller = 1\n", "no table"),
        ("[controller]\nkp = 1e300\n", "1e+300"),
    ],
)
def test_mistakes_of_a_controller_are_told(tmp_path: Path, text: str, what: str) -> None:
    loop = tmp_path / "loop.toml"
    loop.write_text(text)
    code, output = simulate(
        "two_link", "--excitation", "fourier", "--controller", loop, "-o", tmp_path / "run.csv"
    )
    assert code == 2 and what in output, output


def test_what_a_symmetric_link_has_not_and_what_nothing_shows_is_zero(tmp_path: Path) -> None:
    text = catalog_path("elastic_two_link").read_text(encoding="utf-8")
    options = (
        "--sensors",
        "encoders",
        "--excitation",
        "fourier",
        "--duration-s",
        1,
        "-o",
        tmp_path / "run.npz",
    )
    few = [line for line in text.splitlines() if not line.startswith(("Ixy_", "my_", "mz_", "Ixx_1 "))]
    (tmp_path / "arm.toml").write_text("\n".join(few))
    code, output = simulate(tmp_path / "arm.toml", *options)
    assert code == 0 and "taken as zero" in output and "my_2" in output, output
    (tmp_path / "arm.toml").write_text("\n".join(line for line in few if not line.startswith("Izz_2 ")))
    code, output = simulate(tmp_path / "arm.toml", *options, "--overwrite")
    assert code == 2 and "Izz_2: is missing" in output, output
