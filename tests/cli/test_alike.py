"""Commands are alike: an option has one spelling and one form of value, or a reason why not."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

import modelgen
from modelgen.cli.data_arguments import DataOptions
from modelgen.cli.estimation_options import EstimationOptions
from modelgen.cli.examples import PURPOSES
from modelgen.cli.main import COMMANDS, app
from modelgen.project.tables import DataTable, IdentifyTable

GROUP: Any = typer.main.get_command(app)
FURTHER = ("method", "cutoff_hz", "tag", "pairing", "prune_percent", "period_s", "hold_out", "scan_cutoffs")
ESTIMATING = {*(one.name for one in fields(EstimationOptions)), *FURTHER}
READING = {one.name for one in fields(DataOptions)} | {"value", "overwrite"}
# commands that read records -> options of `identify` that they lack, and why
LACKING: dict[str, dict[str, str]] = {
    "identify": {},
    "fleet": {
        "tag": "records of a fleet are read on its workers: tags stand in the files",
    },
    "compare": {
        "hold_out": "shows parameters only, of which held-out records say nothing",
        "scan_cutoffs": "shows parameters only; a scan is of one model",
        "prune_percent": "shows parameters only; pruning is a list below them",
    },
    "validate": {
        "tag": "identifies only to hold out, from ends of the same records",
        "pairing": "as tag",
        "prune_percent": "shows signals, not parameters",
        "period_s": "shows signals, not parameters",
        "scan_cutoffs": "shows signals, not parameters",
    },
}
# options of the same name whose values differ in form, and why
FORMS = {
    "--output": "what is written differs: an estimate, a folder, a mapping, a record",
    "--sensors": "records of identify may be of several sets, each of its own",
    "--payload": "simulate makes one record, which carries what is named; others name the record as well",
    "--hold-out": "validate has no records to name: all of them are its own",
}
# commands without --overwrite, and why
NEVER_OVERWRITE = {
    "demo": "writes into a folder of its own",
    "generate": "replaces what it wrote itself, and nothing else",
}


def options(command: str) -> dict[str, Any]:
    return {one.name: one for one in GROUP.commands[command].params if one.opts[0].startswith("-")}


@pytest.mark.parametrize("command", LACKING)
def test_what_reads_records_takes_the_same_options(command: str) -> None:
    lacking = (READING | ESTIMATING) - options(command).keys()
    assert lacking == LACKING[command].keys()


def test_a_project_file_has_the_options_of_identify() -> None:
    of_identify = {one.name for one in fields(IdentifyTable)}
    assert ESTIMATING - of_identify == {"tag"}  # which is `tags` of a group of records
    assert of_identify <= ESTIMATING
    words = {"columns": "mapping", "scales": "scale", "fs_hz": "fs", "directions": "direction"}
    assert {words.get(one.name, one.name) for one in fields(DataTable)} | {"value", "overwrite"} == READING


def test_every_command_that_reads_records_is_in_the_table() -> None:
    assert {name for name in COMMANDS if "mapping" in options(name)} == LACKING.keys()


def test_an_option_has_one_spelling_and_one_form() -> None:
    forms: dict[str, set[tuple[Any, ...]]] = {}
    for command in COMMANDS:
        for one in options(command).values():
            for spelling in one.opts:
                forms.setdefault(spelling, set()).add((tuple(one.opts), one.metavar))
    assert {long for long, found in forms.items() if len(found) > 1} - {"-o"} == FORMS.keys()


def test_every_command_answers_in_json_and_never_overwrites_unasked() -> None:
    for command in COMMANDS:
        assert "--json" in options(command)["as_json"].opts
    without = {command for command in COMMANDS if "overwrite" not in options(command)}
    assert without == NEVER_OVERWRITE.keys()


def test_the_help_lists_every_command_once_by_purpose() -> None:
    assert sorted(name for names in PURPOSES.values() for name in names) == sorted(COMMANDS)
    shown = CliRunner().invoke(app, ["--help"]).output
    lines = shown.partition("Show this message and exit.")[2].splitlines()
    heads = [line.removesuffix(":") for line in lines if line.endswith(":") and not line.startswith(" ")]
    assert heads == list(PURPOSES)
    listed = [line.split()[0] for line in lines if line.startswith("  ") and line[2] != " "]
    assert listed == [name for names in PURPOSES.values() for name in names]
    assert "..." not in shown.partition("\n")[2]  # no sentence is cut short


def test_version() -> None:
    done = CliRunner().invoke(app, ["--version"])
    assert (done.exit_code, done.output) == (0, f"modelgen {modelgen.__version__}\n")


@pytest.mark.slow
def test_answers_are_saved_whole_and_never_over_a_file(tmp_path: Path) -> None:
    answer = tmp_path / "a.json"
    root = Path(__file__).resolve().parents[2]
    given = ["compare", *(str(root / "generated" / f"emps300_{name}.py") for name in ("qm_qc", "qm_ac"))]
    asked = CliRunner().invoke(app, [*given, "--fs", "2000", "-o", str(answer), "--json"])
    assert asked.exit_code == 0, asked.output
    assert answer.read_text() == asked.stdout
    again = CliRunner().invoke(app, [*given, "-o", str(answer)])
    assert again.exit_code == 2
    assert "exists already" in again.output
    assert answer.read_text() == asked.stdout


def test_saved_estimates_are_compared(tmp_path: Path) -> None:
    from generated import emps300_qm_qc
    from modelgen.runtime.model.model import model_from_module

    model = model_from_module(emps300_qm_qc)
    paths = [str(tmp_path / f"{k}.json") for k in range(2)]
    for k, path in enumerate(paths):
        record = modelgen.simulate(
            model,
            model.parameter_sets["light"],
            "chirp",
            fs=2000.0,
            duration_s=1.0,
            noise={"q_m": 1e-6},
            seed=k,
        ).record
        modelgen.identify(model, [record], "wls").save(path)
    done = CliRunner().invoke(app, ["compare", *paths])
    assert done.exit_code == 0, done.output
    assert "95 % intervals" in done.output and "consistent" in done.output
    alone = CliRunner().invoke(app, ["compare", paths[0]])
    assert alone.exit_code == 2
    assert "give two or more" in alone.output
