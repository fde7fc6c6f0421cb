"""Every numeric option of every command, with numbers that nothing can be calculated with: a message, code 2.

The options are asked of the commands themselves: one that is added later is tried as well.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, get_args, get_type_hints

import numpy as np
import pytest
import typer

from modelgen.cli.main import app
from modelgen.runtime.records.record import Record
from modelgen.runtime.records.write_record import write_record

ROOT = Path(__file__).resolve().parents[2]
MODULE = str(ROOT / "generated" / "emps_rigid_qm.py")
GROUP: Any = typer.main.get_command(app)
COMMANDS: dict[str, Any] = GROUP.commands
RECORD = ["a.csv", "--model", MODULE]
SIMULATE = ["emps_rigid", "--sensors", "qm", "--excitation", "chirp", "-o", "out.csv", "--duration-s", "0.1"]
BASES = {
    "identify": RECORD,
    "validate": [*RECORD, "--estimate", "e.json", "--controller", "loop.toml"],
    "compare": ["emps300"],
    "fleet": [*RECORD, "--cutoff-hz", "20"],
    "simulate": [*SIMULATE],
    "export": ["e.json", "--model", MODULE, "--to", "state-space", "-o", "out.json"],
    "design": ["emps300", "--parameters", "light", "--noise", "q_m=1e-5"],
}
# options whose text holds numbers, and how they are written
TEXTS = {
    "delay": "{}",
    "period_s": "{}",
    "hold_out": "{}",
    "scan_cutoffs": "10,{}",
    "scale": "q_m={}",
    "value": "M={}",
    "noise": "q_m={}",
    "resolution": "q_m={}",
    "bias": "q_m={}",
    "price": "q_m={}",
    "limit": "velocity={}",
}
IMPOSSIBLE = ["nan", "inf", "-inf", "1e999", "1e308", "-1e308", "1e150", "1e-200", "5e-324", "1" + 40 * "0"]
WHOLE = ["2147483648", "-99999999999", "1" + 40 * "0", "1" * 5000]


def numeric(kind: type) -> list[tuple[str, str, str]]:
    """Return (command, option, form) of every option that is a number of the kind, or holds one."""
    found = []
    for entry in app.registered_commands:
        assert entry.callback is not None
        command = entry.name or entry.callback.__name__.rstrip("_")
        hints = get_type_hints(entry.callback)
        for parameter in COMMANDS[command].params:
            hint = hints.get(parameter.name)
            if kind in (hint, *get_args(hint)):
                found.append((command, parameter.opts[0], "{}"))
            elif kind is float and parameter.name in TEXTS:
                found.append((command, parameter.opts[0], TEXTS[parameter.name]))
    return found


@pytest.fixture
def here(trap: Path) -> Path:
    """A folder with a record, an estimate and a loop."""
    t = np.arange(2000) / 1000.0
    q = 0.05 * np.sin(9.0 * t) + 0.01 * np.sin(44.0 * t)
    v, a = np.gradient(q, t), np.gradient(np.gradient(q, t), t)
    force = 95.0 * a + 200.0 * v + 20.0 * np.sign(v)
    write_record(trap / "a.csv", Record({"q_m": q, "F": force, "reference": q}, 1000.0))
    (trap / "e.json").write_text(
        '{"format": "modelgen estimate", "chain": "emps_rigid", "records": [], "physical": {"M": 95.0}}'
    )
    (trap / "loop.toml").write_text("[controller]\nkp = 1e4\nkv = 1e3\n")
    return trap


def said(capsys: pytest.CaptureFixture[str], command: str, *options: str) -> tuple[int, list[str]]:
    """Run a command whose warnings are errors; return its exit code and what it said on stderr."""
    with pytest.raises(SystemExit) as ended:
        GROUP.main([command, *BASES[command], *options], prog_name="modelgen")
    return int(str(ended.value.code)), capsys.readouterr().err.splitlines()


def refused(code: int, lines: list[str]) -> None:
    assert code == 2
    assert lines
    assert all(line.startswith("error: ") and len(line) < 2000 for line in lines)


def test_every_numeric_option_is_tried() -> None:
    found = {command for command, _, _ in numeric(float) + numeric(int)}
    assert found == set(BASES)


@pytest.mark.parametrize(("command", "option", "form"), numeric(float))
def test_a_number_that_nothing_can_be_calculated_with(
    here: Path, capsys: pytest.CaptureFixture[str], command: str, option: str, form: str
) -> None:
    for text in IMPOSSIBLE:
        refused(*said(capsys, command, option, form.format(text)))


@pytest.mark.parametrize(("command", "option", "form"), numeric(int))
def test_a_count_beyond_all_counts(
    here: Path, capsys: pytest.CaptureFixture[str], command: str, option: str, form: str
) -> None:
    for text in WHOLE:
        refused(*said(capsys, command, option, form.format(text)))
