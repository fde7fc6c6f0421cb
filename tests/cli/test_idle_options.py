"""Options that contradict each other or would do nothing, and places that cannot be written: told first."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from modelgen.cli.main import app

ROOT = Path(__file__).resolve().parents[2]
QC = str(ROOT / "generated" / "emps300_qm_qc.py")


def said(*arguments: str | Path) -> list[str]:
    """Return the mistakes of a call that is wrong; its records do not exist, so nothing was read."""
    done = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert done.exit_code == 2, done.output
    return [line for line in done.output.splitlines() if line.startswith("error:")]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--set", "K=1", "--set", "K=2"), "--set K=2: gives K a second time; give every key once"),
        (
            ("--sensors", "qm_ac"),
            "--sensors qm_ac: is of no module; choose from the sensor sets of --model: qm_qc",
        ),
        (("--controller", "nope.toml"), "--report: is missing: without it --controller would do nothing"),
        (("--spec", "nope.toml"), "--report: is missing: without it --spec would do nothing"),
        (
            ("-o", "absent/estimate.json"),
            "absent/estimate.json: has no folder absent; create the folder first",
        ),
        (("--report", "absent/page.html"), "absent/page.html: has no folder absent; create the folder first"),
    ],
)
def test_identify_refuses_before_it_reads(options: tuple[str, ...], words: str) -> None:
    (line,) = said("identify", "absent.csv", "--model", QC, *options)
    assert words in line


@pytest.mark.parametrize("command", ["fleet", "compare", "design", "simulate"])
def test_every_command_looks_for_the_folder_of_its_answer_first(command: str) -> None:
    given = {
        "fleet": ("absent.csv", "--model", QC),
        "compare": (QC,),
        "design": ("emps300",),
        "simulate": ("emps300", "--sensors", "qm_qc", "--excitation", "chirp", "--parameters", "light"),
    }[command]
    (line,) = said(command, *given, "-o", "absent/answer.csv")
    assert "absent/answer.csv: has no folder absent; create the folder first" in line


def test_an_option_that_is_wrong_for_every_file_is_told_once(tmp_path: Path) -> None:
    files = [tmp_path / f"{name}.csv" for name in ("a", "b", "c")]
    for file in files:
        file.write_text("t,q_m,q_c,Gamma_m\n" + "".join(f"{k / 100},{k},{k},{k}\n" for k in range(9)))
    (line,) = said("identify", *files, "--model", QC, "--time-unit", "fortnight")
    assert line.startswith("error: --time-unit: 'fortnight' is no unit of time")
