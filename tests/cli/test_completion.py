"""The shell's completion knows commands, options and the values of options."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest


@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        ("modelgen ide", ["identify"]),
        ("modelgen identify --rep", ["--report"]),
        ("modelgen generate --target ", ["numpy", "matlab", "c"]),
    ],
)
def test_bash_is_offered(typed: str, offered: list[str]) -> None:
    words = {"COMP_WORDS": typed, "COMP_CWORD": str(typed.count(" ")), "_MODELGEN_COMPLETE": "complete_bash"}
    command = [sys.executable, "-c", "from modelgen.cli.main import main; main()"]
    done = subprocess.run(command, env={**os.environ, **words}, capture_output=True, text=True, check=False)
    assert done.stdout.split() == offered, done.stderr
