"""`modelgen generate` of arms: one module, checked like those of chains."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from modelgen.cli.main import app
from modelgen.generated_module.module_check import module_problems

RUNNER = CliRunner()


def refused(arguments: list[str], message: str) -> None:
    result = RUNNER.invoke(app, arguments)
    assert result.exit_code == 2
    assert message in " ".join(result.output.split())


def test_an_arm_has_one_module_that_can_be_checked(tmp_path: Path) -> None:
    folder = ["-o", str(tmp_path)]
    result = RUNNER.invoke(app, ["generate", "scara", *folder])
    assert result.exit_code == 0, result.output
    path = tmp_path / "scara.py"
    text = path.read_text()
    assert module_problems(text) == [] and "\nCONTRACT_VERSION = 2\n" in text
    assert RUNNER.invoke(app, ["generate", "scara", "--check", *folder]).exit_code == 0
    path.write_text(text.replace("BLOCK = 4096", "BLOCK = 4097"))
    result = RUNNER.invoke(app, ["generate", "scara", "--check", *folder])
    assert result.exit_code == 1 and "different" in result.output
    path.write_text("mine")
    refused(["generate", "scara", *folder], "not written by modelgen")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--templates", "."], "chains only"),
        (["--sensors", "all"], "without sensor sets"),
        (["--check", "--templates", "."], "chains only"),
    ],
)
def test_what_arms_do_not_have_is_refused(tmp_path: Path, options: list[str], message: str) -> None:
    refused(["generate", "scara", "-o", str(tmp_path), *options], message)
    assert not list(tmp_path.iterdir())
