"""Groups of options: a command that takes one has all of its options, with their defaults and texts."""

from __future__ import annotations

import json
from dataclasses import fields
from importlib import import_module
from inspect import signature
from pathlib import Path

import pytest
from typer.testing import CliRunner

from modelgen.cli.data_arguments import DataOptions
from modelgen.cli.estimation_options import EstimationOptions
from modelgen.cli.main import COMMANDS, app
from modelgen.cli.options import expanded

ESTIMATING = ("identify", "validate", "compare", "fleet")
ROOT = Path(__file__).resolve().parents[2]
QC, AC = (str(ROOT / "generated" / f"emps300_{name}.py") for name in ("qm_qc", "qm_ac"))


def listed(command: str) -> dict[str, object]:
    function = COMMANDS[command]
    return dict(
        signature(expanded(getattr(import_module(f"modelgen.cli.commands.{function}"), function))).parameters
    )


@pytest.mark.parametrize("command", ESTIMATING)
@pytest.mark.parametrize("group", [DataOptions, EstimationOptions])
def test_every_command_that_estimates_has_the_options_of_the_group(command: str, group: type) -> None:
    found = listed(command)
    reference = listed("identify")
    for one in fields(group):
        assert found[one.name] == reference[one.name]


def test_a_command_is_called_with_its_groups() -> None:
    called = []

    def command(given: DataOptions, estimation: EstimationOptions, count: int = 3) -> None:
        called.append((given, estimation, count))

    options = {name: one.default for name, one in signature(expanded(command)).parameters.items()}
    expanded(command)(**{**options, "fs": 10.0, "drop": 4})
    assert called == [(DataOptions(fs=10.0), EstimationOptions(drop=4), 3)]


@pytest.mark.parametrize(
    "options",
    [("--drop", "3"), ("--map", "q_m=x"), ("--delay", "none"), ("--cutoff-hz", "40"), ("--keep", "K")],
)
def test_options_that_would_do_nothing_are_refused(options: tuple[str, str]) -> None:
    done = CliRunner().invoke(app, ["compare", QC, AC, *options])
    assert done.exit_code == 2
    assert "--data: is missing" in done.output


def test_validate_refuses_options_of_an_identification_it_does_not_make(tmp_path: Path) -> None:
    none = str(tmp_path / "none.json")
    given = ["validate", none, "--model", QC, "--estimate", none, "--controller", none]
    for options in (["--method", "iv"], ["--robust", "huber"], ["--identify-cutoff-hz", "40"]):
        done = CliRunner().invoke(app, [*given, *options])
        assert done.exit_code == 2
        assert "--hold-out: is missing" in done.output


@pytest.mark.slow
def test_compare_takes_the_options_of_identify(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    run = CliRunner().invoke
    simulate = ["simulate", "emps300", "--sensors", "qm_qc", "--parameters", "table_1", "--duration-s", "1"]
    assert run(app, [*simulate, "--excitation", "chirp", "-o", "chirp.npz"]).exit_code == 0
    shared = ["--cutoff-hz", "200", "--filter-order", "3", "--decimation", "5", "--delay", "Gamma_m=1e-4"]
    data = ["--method", "wls", "--map", "q_m=q_m", "--robust", "huber", "--keep", "K"]
    one = run(app, ["identify", "chirp.npz", "--model", QC, *shared, *data, "--json"])
    assert one.exit_code == 0, one.output
    twin = tmp_path / "twin.py"
    twin.write_text(Path(QC).read_text(encoding="utf-8"), encoding="utf-8")
    both = run(app, ["compare", QC, str(twin), *shared, *data, "--data", "chirp.npz", "--json"])
    assert both.exit_code == 0, both.output
    expected = json.loads(one.stdout)
    for estimate in json.loads(both.stdout)["estimates"]["parameters"].values():
        for name, value in expected["params"].items():
            assert estimate[name]["value"] == pytest.approx(value, rel=1e-12)
            assert estimate[name]["std"] == pytest.approx(expected["bse"][name], rel=1e-9)
