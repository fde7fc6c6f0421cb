"""Names from files and specs never steer the terminal that they are printed on, nor break a line."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from modelgen.cli.main import app
from modelgen.cli.output import explain, note, print_json, report
from modelgen.errors import DataError, Problem
from modelgen.runtime.records.read_record import read_record
from modelgen.runtime.records.record import Record

STEERING = {
    "escape sequence": "a\x1b[2J",
    "bell": "a\x07",
    "carriage return": "ok\rerror",
    "line end": "a\nerror: all is well",
    "title of the window": "\x1b]0;pwned\x07",
    "one-byte sequence": "a\x9b31m",
    "right to left": "a\u202etxt",
    "zero width": "a\u200bb",
    "null byte": "a\x00b",
}


@pytest.mark.parametrize("name", STEERING)
@pytest.mark.parametrize("place", ["name", "tag"])
def test_a_record_refuses_the_name(place: str, name: str) -> None:
    with pytest.raises(DataError) as caught:
        Record({"q_m": np.zeros(3)}, 1.0, **{"name": "a", place: STEERING[name]})
    (problem,) = caught.value.problems
    assert problem.what == f"{place} is {STEERING[name]!r}"
    assert problem.remedy.startswith("give a string of visible characters")
    assert str(problem).isprintable()


@pytest.mark.parametrize("name", STEERING)
def test_a_file_that_states_such_a_name_is_refused(trap: Path, name: str) -> None:
    stated = json.dumps({"fs": 1000.0, "name": STEERING[name], "tag": None})
    text = f"# modelgen record {stated}\nt,q_m\n0.000,1\n0.001,2\n0.002,3\n"
    (trap / "a.csv").write_text(text, encoding="utf-8")
    with pytest.raises(
        DataError, match=r"record: name is '.*'; give a string of visible characters \(rename"
    ):
        read_record(trap / "a.csv")


@pytest.mark.parametrize("name", [name for name in STEERING if name not in ("null byte",)])
def test_what_a_file_holds_is_printed_visibly(trap: Path, name: str) -> None:
    column = STEERING[name].replace("\n", "\v")
    (trap / "a.csv").write_text(f'time,"{column}"\n0.000,1\n0.001,2\n0.002,4\n', encoding="utf-8", newline="")
    for arguments in (["import", "a.csv"], ["import", "a.csv", "--json", "--overwrite"]):
        result = CliRunner().invoke(app, arguments)
        assert "Traceback" not in result.output
        assert all(line.isprintable() for line in result.output.split("\n"))


@pytest.mark.parametrize("name", STEERING)
def test_every_way_to_the_terminal_is_guarded(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    text = STEERING[name]
    explain(Problem(text, text, text))
    note([text])
    report({}, [f"a {text}"], as_json=False)
    print_json({"name": text, text: [text]})
    captured = capsys.readouterr()
    assert all(line.isprintable() for line in (captured.out + captured.err).split("\n"))
    assert json.loads(captured.out[captured.out.index("{") :]) == {"name": text, text: [text]}


def test_a_file_of_such_a_name_is_refused_from_the_command_line(trap: Path) -> None:
    if sys.platform == "win32":
        pytest.skip("no such file can be")
    text = "t,q_m,F\n" + "".join(f"{k / 1000},{k * (500 - k) / 1e4},{k % 5}\n" for k in range(500))
    (trap / "a\x1b[2J.csv").write_text(text, encoding="utf-8")
    module = Path(__file__).resolve().parents[2] / "generated" / "emps_rigid_qm.py"
    result = CliRunner().invoke(app, ["identify", "a\x1b[2J.csv", "--model", str(module)])
    assert result.exit_code == 2
    assert "name is 'a\\\\x1b[2J'" in result.stderr or "name is 'a\\x1b[2J'" in result.stderr
    assert all(line.isprintable() for line in result.output.split("\n"))
