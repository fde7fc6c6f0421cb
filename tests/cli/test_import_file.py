"""modelgen import: what a file holds, a proposed mapping, and identify with it."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from modelgen.cli.main import app
from modelgen.errors import DataError
from modelgen.runtime.records.mapping_file import load_mapping
from modelgen.runtime.records.read_record import read_record


def run(*arguments: str | Path) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a module and a record, written as a German instrument would: ms, deg, decimal commas."""
    folder = tmp_path_factory.mktemp("people")
    assert run("generate", "emps300", "--sensors", "qm_ac", "-o", folder).exit_code == 0
    arguments = ("simulate", "emps300", "--sensors", "qm_ac", "--parameters", "light", "--duration-s", "3")
    assert run(*arguments, "--excitation", "chirp", "-o", folder / "chirp.npz").exit_code == 0
    record = read_record(folder / "chirp.npz")
    lines = [
        "Prüfstand 3;;;",
        "Datum;02.05.2022;;",
        "",
        "Zeit;Winkel Motor;Beschl Last;Drehmoment",
        "ms;°;rad/s²;Nm",
    ]
    for k in range(record.n):
        q, a, f = (record.signals[key][k] for key in ("q_m", "a_c", "Gamma_m"))
        values = (1e3 * k / record.fs, math.degrees(q), a, f)
        lines.append(";".join(f"{value:.12g}".replace(".", ",") for value in values))
    (folder / "chirp.csv").write_text("\r\n".join(lines), encoding="latin-1", newline="")
    return folder


# whose answer does not depend on the last digits of a file without noise
LEAST_SQUARES = ("--method", "wls", "--json")


@pytest.mark.slow
def test_from_a_foreign_file_to_the_same_estimate_in_two_commands(bench: Path) -> None:
    module, mapped = bench / "emps300_qm_ac.py", bench / "chirp.toml"
    told = run("import", bench / "chirp.csv", "--model", module, "-o", mapped, "--overwrite", "--json")
    assert told.exit_code == 0, told.output
    described = json.loads(told.stdout)
    assert {entry["key"]: entry["column"] for entry in described["channels"]} == {
        "q_m": "Winkel Motor",
        "a_c": "Beschl Last",
        "Gamma_m": "Drehmoment",
    }
    assert described["problems"] == []
    given = run("identify", bench / "chirp.csv", "--model", module, "--map-file", mapped, *LEAST_SQUARES)
    direct = run("identify", bench / "chirp.npz", "--model", module, *LEAST_SQUARES)
    assert given.exit_code == direct.exit_code == 0, given.output
    assert json.loads(given.stdout)["params"] == pytest.approx(json.loads(direct.stdout)["params"], rel=1e-6)


def test_import_prints_columns_units_and_the_next_command(bench: Path) -> None:
    result = run("import", bench / "chirp.csv", "-o", bench / "plain.toml", "--overwrite")
    assert result.exit_code == 0, result.output
    for words in ("Winkel Motor", "0.0174533 rad", "times: column Zeit in ms", "--map-file"):
        assert words in result.stdout
    mapping = load_mapping(bench / "plain.toml")
    assert dict(mapping.columns) == {
        "Winkel_Motor": "Winkel Motor",
        "Beschl_Last": "Beschl Last",
        "Drehmoment": "Drehmoment",
    }
    assert mapping.time_unit == "ms"


def test_a_file_whose_name_has_line_breaks_adds_no_lines(tmp_path: Path) -> None:
    file = tmp_path / "x\nproblem: none.csv"
    file.write_text("t,a\n0,1\n1,2\n2,4\n", encoding="utf-8")
    printed = run("import", file, "-o", tmp_path / "x.toml").stdout.splitlines()
    assert not [line for line in printed if line.startswith("problem: none")]
    assert printed[0].endswith("x\\nproblem: none.csv")


def test_a_unit_in_the_map_file_counts_and_must_be_of_the_channels_quantity(bench: Path) -> None:
    mapped = bench / "units.toml"
    columns = {"q_m": "Winkel Motor", "a_c": "Beschl Last", "Gamma_m": "Drehmoment"}
    text = "".join(f'[channels.{key}]\ncolumn = "{column}"\n' for key, column in columns.items())
    mapped.write_text(text.replace('Motor"', 'Motor"\nunit = "Nm"'), encoding="utf-8")
    refused = run(
        "identify", bench / "chirp.csv", "--model", bench / "emps300_qm_ac.py", "--map-file", mapped
    )
    assert refused.exit_code == 2
    assert "column Winkel Motor is in Nm, and rad is needed" in refused.stderr


def test_import_never_overwrites_unasked(bench: Path) -> None:
    mapped = bench / "mine.toml"
    mapped.write_text("mine", encoding="utf-8")
    assert run("import", bench / "chirp.csv", "-o", mapped).exit_code == 2
    assert mapped.read_text(encoding="utf-8") == "mine"


def test_a_header_without_samples_is_refused(bench: Path, tmp_path: Path) -> None:
    data = tmp_path / "empty.csv"
    data.write_text("t,q_m,a_c,Gamma_m\n", encoding="utf-8")
    for further in ([], ["--model", bench / "emps300_qm_ac.py"]):
        refused = run("import", data, *further)
        assert refused.exit_code == 2
        assert "has a header but no samples" in refused.stderr


def test_microseconds_are_guessed_from_the_step(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("t,q\n" + "".join(f"{k * 200},{k}\n" for k in range(20)), encoding="utf-8")
    described = json.loads(run("import", path, "--json").stdout)
    assert described["time_unit"] == "us"  # a sample in 200 s or 200 ms is no record of a drive
    assert described["findings"] == []


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("channels = 3", ("channels: is missing",)),
        ("[channels.q]\nfactor = 2", ("channels.q.column: is missing",)),
        ('[channels.q]\ncolumn = "a"\nfactor = 0', ("channels.q.factor: is 0",)),
        ('[channels.q]\ncolumn = "a"\ncolour = 1\n[tme]', ("channels.q.colour: is not known", "tme: is not")),
        ('mend = "gaps"\n[channels.q]\ncolumn = "a"', ("mend: is no list",)),
        ('[time]\nfs_hz = -1\n[channels.q]\ncolumn = "a"', ("time.fs_hz: is -1",)),
        ("[channels", ("is not valid TOML",)),
    ],
)
def test_mistakes_in_a_mapping_file(tmp_path: Path, text: str, words: tuple[str, ...]) -> None:
    path = tmp_path / "map.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(DataError) as caught:
        load_mapping(path)
    assert [word in str(caught.value) for word in words] == [True] * len(words), str(caught.value)


def test_names_that_are_odd_survive_the_file(tmp_path: Path) -> None:
    column = 'a "b" \\ #]['
    np.savez(tmp_path / "run.npz", **{column: np.arange(5.0)}, fs=10.0)
    assert run("import", tmp_path / "run.npz").exit_code == 0
    mapping: Any = load_mapping(tmp_path / "run.map.toml")
    assert list(mapping.columns.values()) == [column]
    assert mapping.fs_hz == 10.0


def test_a_matrix_without_names_has_its_times_found_by_their_even_steps(tmp_path: Path) -> None:
    steps = 0.002 * np.arange(40)
    np.savez(tmp_path / "a.npz", data=np.column_stack([steps.round(4), np.sin(9.0 * steps), steps**2]))
    told = run("import", tmp_path / "a.npz", "--json")
    assert json.loads(told.stdout)["time"] == "data[:,0]"
    assert load_mapping(tmp_path / "a.map.toml").time == "data[:,0]"
    # what counts samples may be of any time, and two columns that rise evenly are ambiguous
    for name, columns in (("count", [np.arange(40), np.sin(9.0 * steps)]), ("two", [steps, 3.0 * steps])):
        np.savez(tmp_path / f"{name}.npz", data=np.column_stack(columns))
        assert json.loads(run("import", tmp_path / f"{name}.npz", "--json").stdout)["time"] is None


def test_what_identify_would_stop_at_is_a_problem_of_the_import(bench: Path, tmp_path: Path) -> None:
    model = next(bench.glob("emps300_qm_ac.py"))
    t = np.arange(200) * 500.0  # us, unnamed
    q, a, f = np.sin(0.05 * np.arange(200)), np.full(200, 0.7), np.cos(0.05 * np.arange(200))

    def lines(**columns: np.ndarray) -> list[str]:
        path = tmp_path / "run.npz"
        np.savez(path, **columns)
        done = run("import", path, "--model", model, "--overwrite")
        assert done.exit_code == 0, done.output
        return done.output.splitlines()

    good = lines(t=t, q_m=q, a_c=q, Gamma_m=f)
    assert "times: column t in us" in good and not [line for line in good if line.startswith("problem")]
    still = "\n".join(lines(t=t, q_m=q, a_c=a, Gamma_m=f))
    assert "column a_c: has one number in every sample; check its cable" in still
    assert "mend" not in still and "check it, set right what is a problem, then" in still
    infinite = "\n".join(lines(t=t, q_m=np.where(t == 0.0, np.inf, q), a_c=q, Gamma_m=f))
    assert "column q_m, sample 0: is inf" in infinite and "--mend fill" in infinite
    assert "name the column of a_c there" in "\n".join(lines(t=t, q_m=q, Gamma_m=f))
