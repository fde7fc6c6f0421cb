"""What is written for others (spreadsheets, terminals, browsers) holds texts, not commands."""

from __future__ import annotations

import csv
import os
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from modelgen.cli.main import app
from modelgen.errors import DataError, RenderError
from modelgen.render.target import user_files
from modelgen.render.target_writer import write_target
from modelgen.runtime.records.read_record import read_record
from modelgen.runtime.records.record import Record
from modelgen.runtime.records.write_record import write_record
from modelgen.spec.load import catalog_path, load_spec

SIGNAL = {"q_m": np.sin(np.arange(20.0))}
FORMULAS = {
    "sum": "=1+1",
    "command": "=cmd|' C calc'!A0",
    "plus": "+1+1",
    "minus": "-1+1",
    "at": "@SUM(A1)",
    "tab": "\t=1+1",
    "carriage return": "\r=1+1",
    "new line": "\n=1+1",
    "behind a comma": "a,=1+1",
    "behind a semicolon": "a;=1+1",
    "behind a quote": 'a","=1+1',
    "link": '=HYPERLINK("http://x","y")',
    "exchange": "=DDE('cmd';'x')",
}


@pytest.mark.parametrize("name", FORMULAS)
def test_a_formula_names_no_column(trap: Path, name: str) -> None:
    record = Record({FORMULAS[name]: SIGNAL["q_m"]}, fs=100.0)
    with pytest.raises(DataError, match="cannot name a column of this file; rename the channel"):
        write_record(trap / "a.csv", record)
    assert list(trap.iterdir()) == []


@pytest.mark.parametrize("name", [name for name, text in FORMULAS.items() if not text.isprintable()])
def test_a_record_refuses_a_formula_behind_a_control_character(name: str) -> None:
    with pytest.raises(DataError, match="give a string of visible characters"):
        Record(SIGNAL, fs=100.0, name=FORMULAS[name])


@pytest.mark.parametrize("name", [name for name, text in FORMULAS.items() if text.isprintable()])
@pytest.mark.parametrize("separator", [",", ";"])
def test_a_record_named_by_a_formula_starts_no_cell_with_it(trap: Path, name: str, separator: str) -> None:
    record = Record(SIGNAL, fs=100.0, name=FORMULAS[name], tag=FORMULAS[name])
    write_record(trap / "a.csv", record)
    with (trap / "a.csv").open(newline="") as file:
        cells = next(csv.reader(file, delimiter=separator))
    assert not any(cell.strip(" \"'").startswith(("=", "+", "-", "@")) for cell in cells)
    assert read_record(trap / "a.csv") == record


TERMINAL = {
    "clear the screen": "a\x1b[2J.csv",
    "title": "a\x1b]0;owned\x07.csv",
    "new line": "a\nerror: b.csv",
    "carriage return": "a\rdone.csv",
    "backspace": "a\x08b.csv",
    "right to left": "a\u202evsc.b",
    "not UTF-8": "a\udcff.csv",
}


@pytest.mark.parametrize("name", TERMINAL)
@pytest.mark.parametrize("command", ["import", "show", "identify"])
def test_the_name_of_a_file_does_not_steer_the_terminal(name: str, command: str) -> None:
    arguments = [command, TERMINAL[name]] + (["--model", "absent.py"] if command == "identify" else [])
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 2
    assert all(
        line.isprintable() and line.startswith("error: ") for line in result.stderr.split("\n") if line
    )


TEMPLATES = {  # a user's template: the sandbox refuses each of them
    "class": "{{ ''.__class__ }}",
    "subclasses": "{{ ''.__class__.__mro__[1].__subclasses__() }}",
    "globals": "{{ cycler.__init__.__globals__.os.system('touch pwned') }}",
    "model's class": "{{ model.__class__.__init__.__globals__ }}",
    "model's dictionary": "{{ model.__dict__.clear() }}",
    "format": "{{ '{0.__class__}'.format(1) }}",
    "undefined": "{{ secret }}",
    "import": "{% import 'os' as os %}",
    "include outside": "{% include '../secret.txt' %}",
    "include absolute": "{% include '/etc/passwd' %}",
    "syntax": "{% for %}",
    "division by zero": "{{ 1 / 0 }}",
    "wrong type": "{{ 1 + 'a' }}",
    "no such filter": "{{ 1 | shell }}",
    "endless range": "{% for i in range(10**12) %}x{% endfor %}",
}


@pytest.mark.parametrize("name", TEMPLATES)
def test_a_template_of_the_user_stays_in_its_sandbox(trap: Path, name: str) -> None:
    (trap / "secret.txt").write_text("secret")
    folder = trap / "templates"
    folder.mkdir()
    (folder / "model.txt.j2").write_text(TEMPLATES[name])
    with pytest.raises(RenderError, match=r"model\.txt\.j2.*fails \(.*\); correct the template"):
        user_files(load_spec(catalog_path("emps_rigid")), "qm", folder)


STARTERS = {
    "TOML": 'x"\n[chain]\nname = "y',
    "template": "{{ 7 * 7 }}",
    "path": "../x",
    "absolute": "/x",
    "keyword": "import",
    "dunder": "__init__",
    "empty": "",
    "null byte": "a\x00",
    "hidden": ".x",
    "look-alike": "\u0430xis",
}


@pytest.mark.parametrize("name", STARTERS)
def test_new_refuses_what_is_no_name(trap: Path, name: str) -> None:
    result = CliRunner().invoke(app, ["new", "--", STARTERS[name]])
    assert result.exit_code == 2
    assert result.stderr.startswith("error: ")
    assert "Traceback" not in result.output
    assert list(trap.iterdir()) == []


def test_a_folder_whose_name_is_no_text(trap: Path) -> None:
    """Old disks name folders in Latin-1: what is written says where files are, and is text all the same."""
    folder = trap / os.fsdecode(b"Pr\xfcfung")
    folder.mkdir()
    t = np.arange(2000) / 1000.0
    q, speed, change = np.sin(8.0 * t), 8.0 * np.cos(8.0 * t), -64.0 * np.sin(8.0 * t)
    table = np.column_stack([t, q, 90.0 * change + 200.0 * speed + 20.0 * np.sign(speed)])
    np.savetxt(folder / "run.csv", table, delimiter=",", header="t,q_m,F", comments="")
    module = write_target(load_spec(catalog_path("emps_rigid")), ["qm"], folder)[0]
    told = [str(folder / "run.csv"), "--model", str(module)]
    for command in (
        ["import", *told],
        ["identify", *told, "--method", "wls", "--report", str(folder / "r.html")],
        ["identify", *told, "--method", "wls", "--save-project", str(folder / "p.project.toml")],
        ["run", str(folder / "p.project.toml")],
    ):
        done = CliRunner().invoke(app, command)
        assert done.exit_code == 0, (done.output, done.exception)
    assert "Pr\\udcfcfung" in (folder / "r.html").read_text(encoding="utf-8")
    elsewhere = ["identify", *told, "--method", "wls", "--save-project", str(trap / "p.project.toml")]
    done = CliRunner().invoke(app, elsewhere)
    assert done.exit_code == 2
    assert "has a name that a project file cannot hold" in done.output
