"""The command line: every command, its JSON, its exit codes and its one-line explanations."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from modelgen.cli.main import app
from modelgen.spec.load import catalog_path
from tests.render.test_physical_from_base import star_or_chain

COMMANDS = (
    "demo",
    "new",
    "show",
    "generate",
    "import",
    "identify",
    "simulate",
    "validate",
    "compare",
    "export",
    "fleet",
    "design",
)


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty current folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(*arguments: str | Path) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def run_json(*arguments: str | Path) -> Any:
    """Run with --json and return what the whole of stdout says."""
    result = run(*arguments, "--json")
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


def assert_explained(result: Result, code: int, *words: str) -> None:
    """The exit code, with one line of "where: what; remedy" for each mistake on stderr.

    What was found in files that answer nothing stands before it.
    """
    assert result.exit_code == code, result.output
    lines = [line for line in result.stderr.splitlines() if code != 1 or ": found: " not in line]
    assert lines
    assert all(line.startswith("error: ") and "; " in line for line in lines), lines
    for word in words:
        assert word in result.stderr


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_json_and_help(command: str) -> None:
    result = run(command, "--help")
    assert result.exit_code == 0
    assert "--json" in result.stdout


@pytest.mark.parametrize(
    "arguments",
    [
        ("nonsense",),
        ("show",),
        ("show", "emps300", "--nonsense"),
        ("generate", "emps300", "--target", "fortran"),
    ],
)
def test_usage_errors_exit_2(arguments: tuple[str, ...]) -> None:
    assert_explained(run(*arguments), 2, "--help")


# new ---------------------------------------------------------------------------------------------------


def test_new_writes_a_spec_that_the_other_commands_read(here: Path) -> None:
    assert run("new", "axis").exit_code == 0
    assert run_json("show", "axis.toml")["chain"] == "axis"
    assert run_json("generate", "axis.toml")["written"]


def test_new_reports_the_file_as_json(here: Path) -> None:
    assert run_json("new", "axis") == {"written": ["axis.toml"]}


def test_new_never_overwrites(here: Path) -> None:
    Path("axis.toml").write_text("mine", encoding="utf-8")
    assert_explained(run("new", "axis"), 2, "axis.toml", "exists")
    assert Path("axis.toml").read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize(
    "name", ["class", "1axis", "my axis", "../axis", 'x" # ', 'x"\ntitle = "y', "", "a" * 65]
)
def test_new_refuses_names_that_are_none(here: Path, name: str) -> None:
    assert_explained(run("new", name), 2)
    assert list(here.iterdir()) == []


# show --------------------------------------------------------------------------------------------------


def test_show_tells_equations_rows_and_parameters() -> None:
    # lines are folded to the width of the terminal
    printed = " ".join(run("show", "emps300", "--sensors", "qm_ac").stdout.split())
    assert (
        "Gamma_m = J_m q_m'' + F_vm q_m' + F_sm sign(q_m') + F_vmc (q_m' - q_c') + K (q_m - q_c)" in printed
    )
    assert "0 = J_c q_c'' + F_vmc (q_c' - q_m') + K (q_c - q_m)" in printed
    assert "sum of the equations of m, c" in printed
    assert "q_c (position of c)" not in printed


def test_the_only_sensor_set_of_a_chain_that_cannot_be_built_is_one_message(here: Path) -> None:
    names = [f"b{i}" for i in range(6)]
    bodies = "".join(f'[[bodies]]\nname = "{name}"\ninertia = "J_{name}"\n' for name in names)
    links = "".join(
        f'[[links]]\nbodies = ["{a}", "{b}"]\nstiffness = "K_{a}{b}"\ndamping = "D_{a}{b}"\n'
        for i, a in enumerate(names)
        for b in names[i + 1 :]
    )
    bodies = bodies.replace('"J_b0"\n', '"J_b0"\nactuator = "T"\n')
    sensors = "".join(f'q{i} = {{ body = "b{i}", measures = "position" }}\n' for i in range(2))
    head = '[chain]\nname = "mesh"\nmotion = "rotation"\n'
    Path("mesh.toml").write_text(f"{head}{bodies}{links}[sensors.s]\n{sensors}", encoding="utf-8")
    result = run("show", "mesh.toml")
    assert result.exit_code == 2
    assert "the rows without a sensor on b2, b3, b4, b5 would have 1,775,130 terms" in " ".join(
        result.output.split()
    )


def test_show_as_json() -> None:
    described = run_json("show", "emps300")
    first, second = described["sensor_sets"]
    assert [first["sensor_set"], second["sensor_set"]] == ["qm_qc", "qm_ac"]
    assert [(row["name"], row["order"], row["differentiated"]) for row in second["rows"]] == [
        ("m", 4, 2),
        ("c", 4, 2),
        ("m+c", 2, 0),
    ]
    assert second["rows"][2]["columns"] == ["J_m", "F_vm", "F_sm", "J_c"]
    assert second["base_parameters"][5] == {"name": "K", "unit": "N m/rad"}
    assert second["identifiable"] == ["J_m", "F_vm", "F_sm", "J_c", "F_vmc", "K"]


@pytest.mark.parametrize("seed", [3, 8, 21, 34])
def test_show_prints_no_formula_that_two_lines_do_not_hold(here: Path, seed: int) -> None:
    Path("chain.toml").write_text(star_or_chain(seed), encoding="utf-8")
    (described,) = run_json("show", "chain.toml", "--sensors", "set")["sensor_sets"]
    printed = " ".join(run("show", "chain.toml", "--sensors", "set").stdout.split())
    assert described["composites"]
    for name, formula in described["composites"].items():
        assert name == formula or (f"{name} = {formula}" in printed) == (len(f"{name} = {formula}") <= 160)
    longest = max(len(formula) for formula in described["composites"].values())
    assert ("more than two lines, which --json holds" in printed) == (longest > 160)


def test_show_says_that_its_counts_hold_without_noise(here: Path) -> None:
    for sensors in ("all", "qm_ac"):
        printed = " ".join(run("show", "emps300", "--sensors", sensors).stdout.split())
        assert "without noise of the sensors" in printed


def test_show_names_composites_of_an_elimination(here: Path) -> None:
    run("new", "axis")
    text = Path("axis.toml").read_text(encoding="utf-8").partition("[sensors.")[0]
    sensor = '[sensors.qm]\nq_m = { body = "m", measures = "position" }\n'
    Path("axis.toml").write_text(text + sensor, encoding="utf-8")
    printed = run("show", "axis.toml").stdout
    assert "J_m*J_c/K" in printed
    said = " ".join(printed.split())
    assert (
        "identifiable without noise of the sensors (modelgen design says what noise leaves): J_m, F_vm,"
        in said
    )
    (described,) = run_json("show", "axis.toml")["sensor_sets"]
    assert {"name": "J_m*J_c/K", "unit": "(N m)/(rad/s^4)"} in described["base_parameters"]


def test_show_reads_every_chain_of_the_catalogue(repo_root: Path) -> None:
    for path in sorted((repo_root / "modelgen" / "catalog").glob("*.toml")):
        by_name, by_path = run("show", path.stem), run("show", path)
        assert by_name.exit_code == 0, by_name.output
        assert by_name.stdout == by_path.stdout


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("nonsense",), ("nonsense", "emps300")),
        (("nonsense.toml",), ("nonsense.toml",)),
        (("emps300", "--sensors", "qc"), ("sensors.qc", "qm_qc, qm_ac")),
    ],
)
def test_show_explains_what_it_cannot_find(
    here: Path, arguments: tuple[str, ...], words: tuple[str, ...]
) -> None:
    assert_explained(run("show", *arguments), 2, *words)


def test_show_reports_every_mistake_of_a_spec(here: Path) -> None:
    run("new", "axis")
    text = Path("axis.toml").read_text(encoding="utf-8")
    Path("axis.toml").write_text(
        text.replace('inertia = "J_c"', "").replace('"rotation"', '"swimming"', 1), "utf-8"
    )
    result = run("show", "axis.toml")
    assert_explained(result, 2, "chain.motion", "bodies[1].inertia")
    assert len(result.stderr.splitlines()) == 2


def test_show_without_sensor_sets(here: Path) -> None:
    run("new", "axis")
    text = Path("axis.toml").read_text(encoding="utf-8")
    Path("axis.toml").write_text(text.partition("[sensors.")[0], encoding="utf-8")
    assert_explained(run("show", "axis.toml"), 2, "axis.toml: sensors")


# generate ----------------------------------------------------------------------------------------------


def test_generate_writes_what_is_checked_in(here: Path, repo_root: Path) -> None:
    written = run_json("generate", "emps300", "-o", "modules")["written"]
    assert written == ["modules/emps300_qm_qc.py", "modules/emps300_qm_ac.py"]
    for path in map(Path, written):
        assert path.read_bytes() == (repo_root / "generated" / path.name).read_bytes()


def test_generate_one_sensor_set(here: Path) -> None:
    assert run("generate", "emps300", "--sensors", "qm_ac").exit_code == 0
    assert [path.name for path in Path("generated").iterdir()] == ["emps300_qm_ac.py"]


def test_check_names_every_module_that_has_drifted(here: Path) -> None:
    run("generate", "emps300", "tree")
    assert run_json("generate", "emps300", "tree", "--check")["drift"] == []
    different, old = Path("generated/emps300_qm_qc.py"), Path("generated/tree_old.py")
    different.write_text(different.read_text(encoding="utf-8") + "\n", encoding="utf-8")
    Path("generated/tree_mixed.py").rename(old)
    result = run("generate", "emps300", "tree", "--check", "--json")
    assert result.exit_code == 1
    assert json.loads(result.stdout)["drift"] == [
        {"path": str(different), "state": "different"},
        {"path": "generated/tree_mixed.py", "state": "missing"},
        {"path": str(old), "state": "left over"},
    ]
    assert not Path("generated/tree_mixed.py").exists()


def test_generate_spares_files_that_are_not_its_own(here: Path) -> None:
    Path("emps300_qm_qc.py").write_text("mine", encoding="utf-8")
    assert_explained(run("generate", "emps300", "-o", "."), 2, "emps300_qm_qc.py")
    assert [path.name for path in here.iterdir()] == ["emps300_qm_qc.py"]


def test_folder_that_cannot_be_made(here: Path) -> None:
    Path("taken").write_text("", encoding="utf-8")
    assert_explained(run("generate", "emps300", "-o", "taken/modules"), 2, "taken")


# simulate ----------------------------------------------------------------------------------------------

SIMULATE = ("simulate", "emps300", "--sensors", "qm_ac", "--parameters", "table_2", "--duration-s", "1")


def test_simulate_writes_a_record(here: Path) -> None:
    told = run_json(*SIMULATE, "--excitation", "chirp", "-o", "chirp.npz", "--fs-hz", "2000")
    assert told == {
        "written": ["chirp.npz"],
        "fs_hz": 2000.0,
        "samples": 2000,
        "channels": ["q_m", "a_c", "Gamma_m"],
    }
    assert Path("chirp.npz").is_file()


def test_simulation_repeats_to_the_byte(here: Path) -> None:
    noisy = ("--excitation", "trapezoid", "--noise", "q_m=2e-5", "--resolution", "q_m=1e-4")
    run(*SIMULATE, *noisy, "-o", "a.csv")
    run(*SIMULATE, *noisy, "-o", "b.csv")
    run(*SIMULATE, *noisy, "-o", "c.csv", "--seed", "1")
    assert Path("a.csv").read_bytes() == Path("b.csv").read_bytes() != Path("c.csv").read_bytes()


def test_simulate_the_users_own_excitation(here: Path) -> None:
    lines = ["t,feedforward", *(f"{k / 1000},{0.02 * (k // 100 % 2)}" for k in range(500))]
    Path("steps.csv").write_text("\n".join(lines), encoding="utf-8")
    arguments = ("simulate", "emps300", "--sensors", "qm_qc", "--parameters", "light")
    told = run_json(*arguments, "--excitation", "steps.csv", "-o", "a.csv")
    assert (told["fs_hz"], told["samples"]) == (1000.0, 500)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--excitation", "chirpy"), ("--excitation", "chirpy")),
        (("--excitation", "absent.csv"), ("absent.csv",)),
        (("--excitation", "chirp", "--parameters", "table_9"), ("--parameters", "table_1, table_2, light")),
        (("--excitation", "chirp", "--noise", "q_m"), ("--noise q_m",)),
        (("--excitation", "chirp", "--noise", "q_x=1"), ("q_x",)),
        (("--excitation", "chirp", "--resolution", "q_m=-1"), ("resolution", "q_m")),
        (("--excitation", "chirp", "--fs-hz", "-5"), ("fs",)),
        (("--excitation", "chirp", "-o", "data.docx"), (".docx",)),
        (("--excitation", "chirp", "--sensors", "none"), ("sensors.none",)),
    ],
)
def test_simulate_explains(here: Path, arguments: tuple[str, ...], words: tuple[str, ...]) -> None:
    assert_explained(run(*SIMULATE, "-o", "a.csv", *arguments), 2, *words)
    assert list(here.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "kept"),
    [
        (("import", "run.csv", "-o", "run.csv"), "run.csv"),
        (("identify", "other.csv,run.csv", "--model", "axis.py", "-o", "./run.csv"), "run.csv"),
        (("identify", "run.csv", "--model", "axis.py", "-o", "axis.py"), "axis.py"),
        (
            ("simulate", "emps300", "--sensors", "qm_qc", "--excitation", "run.csv", "-o", "run.csv"),
            "run.csv",
        ),
        (("identify", "run.csv", "--spec", "emps300", "--report", "a.html", "-o", "a.html"), "a.html"),
    ],
)
def test_overwrite_never_replaces_what_a_command_reads_or_writes_otherwise(
    here: Path, arguments: tuple[str, ...], kept: str
) -> None:
    (here / kept).write_text("t,q\n0,1\n1,2\n")
    result = run(*arguments, "--overwrite")
    assert result.exit_code == 2
    assert "is the file of" in result.output
    assert (here / kept).read_text() == "t,q\n0,1\n1,2\n"


@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        (("show", "map.toml"), "map.toml: is a mapping of columns (--map-file); give"),
        (
            ("run", "axis.toml"),
            "axis.toml: is the description of a chain; give a file that has one of records",
        ),
        (
            ("identify", "a.csv", "--spec", "emps300", "--map-file", "axis.toml"),
            "axis.toml: is the description",
        ),
        (("show", "a.csv"), "a.csv: is no TOML"),
    ],
)
def test_a_file_of_another_kind_is_named(here: Path, arguments: tuple[str, ...], what: str) -> None:
    (here / "map.toml").write_text('[channels.q_m]\ncolumn = "q"\n')
    (here / "axis.toml").write_bytes(catalog_path("emps300").read_bytes())
    (here / "a.csv").write_text("t,q\n0,1\n1,2\n")
    result = run(*arguments)
    assert result.exit_code == 2
    (said,) = [line for line in result.output.splitlines() if line.startswith("error")]
    assert what in said


def test_simulate_overwrites_only_if_asked(here: Path) -> None:
    Path("a.csv").write_text("mine", encoding="utf-8")
    arguments = (*SIMULATE, "--excitation", "chirp", "-o", "a.csv")
    assert_explained(run(*arguments), 2, "a.csv", "exists")
    assert run(*arguments, "--overwrite").exit_code == 0
    assert Path("a.csv").read_text(encoding="utf-8") != "mine"


# identify ----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the modules of emps300 and two short, noise-free records of its light set."""
    folder = tmp_path_factory.mktemp("bench")
    assert run("generate", "emps300", "-o", folder).exit_code == 0
    common = ("simulate", "emps300", "--sensors", "qm_ac", "--parameters", "light", "--duration-s", "3")
    assert run(*common, "--excitation", "chirp", "-o", folder / "chirp.npz").exit_code == 0
    assert run(*common, "--excitation", "trapezoid", "-o", folder / "trapezoid.csv").exit_code == 0
    return folder


@pytest.fixture
def identify(bench: Path) -> tuple[str | Path, ...]:
    """The arguments of an identification that works."""
    return ("identify", bench / "chirp.npz", bench / "trapezoid.csv", "--model", bench / "emps300_qm_ac.py")


LIGHT = {"J_m": 9.93e-6, "F_vm": 2e-5, "F_sm": 5e-3, "J_c": 6.72e-7, "F_vmc": 3.9e-5, "K": 0.3795}


@pytest.mark.slow
def test_identify_finds_the_simulated_parameters(identify: tuple[str | Path, ...]) -> None:
    estimate = run_json(*identify)
    assert estimate["params"] == pytest.approx(LIGHT, rel=5e-3)
    assert estimate["records"] == ["chirp", "trapezoid"]


@pytest.mark.slow
def test_identify_tells_what_a_reader_needs(identify: tuple[str | Path, ...]) -> None:
    printed = run(*identify, "--cutoff-hz", "180", "--details").stdout
    for word in (
        "K",
        "N m/rad",
        "95 %",
        "condition number",
        "relative error",
        "masked",
        "Cut-off 180 Hz as given",
    ):
        assert word in printed


@pytest.mark.slow
def test_identify_passes_every_option_on(identify: tuple[str | Path, ...]) -> None:
    options = {
        "--method": "pham2002",
        "--cutoff-hz": "300",
        "--filter-order": "5",
        "--decimation": "6",
        "--direction-cutoff-hz": "90",
        "--drop": "100",
        "--prune-percent": "1e-6",
        "--residual-dof": "r-1",
    }
    estimate = run_json(*identify, *(word for option in options.items() for word in option))
    assert (estimate["method"], estimate["residual_dof"]) == ("pham2002", "r-1")
    assert estimate["filtering"]["cutoff_hz"] == 300.0
    assert estimate["filtering"]["filter_order"] == 5
    assert estimate["filtering"]["decimation"] == [6, 6]
    assert estimate["filtering"]["direction_cutoff_hz"] == 90.0
    assert estimate["pruning"]["percent"] == 1e-6
    assert len(estimate["pruning"]["steps"]) == 5
    undropped = run_json(*identify, *(w for o in options.items() if o[0] != "--drop" for w in o))
    assert undropped["nobs"] > estimate["nobs"]


@pytest.mark.slow
def test_identify_saves_the_estimate_and_overwrites_only_if_asked(
    here: Path, identify: tuple[str | Path, ...]
) -> None:
    printed = run_json(*identify, "-o", "estimate.json")
    assert json.loads(Path("estimate.json").read_text(encoding="utf-8")) == printed
    Path("estimate.json").write_text("mine", encoding="utf-8")
    assert_explained(run(*identify, "-o", "estimate.json"), 2, "estimate.json", "exists")
    assert run(*identify, "-o", "estimate.json", "--overwrite").exit_code == 0
    assert json.loads(Path("estimate.json").read_text(encoding="utf-8")) == printed


@pytest.mark.slow
def test_identify_maps_scales_and_times_columns(here: Path, bench: Path) -> None:
    lines = (bench / "trapezoid.csv").read_text(encoding="utf-8").splitlines()
    header = lines[1].split(",")
    assert header == ["t", "q_m", "a_c", "Gamma_m"]
    rows = [[float(cell) for cell in line.split(",")] for line in lines[2:]]
    foreign = [f"{t!r},{-1024.0 * q!r},{a!r},{g!r}" for t, q, a, g in rows]
    Path("foreign.csv").write_text("\n".join(["clock,angle,acc,current", *foreign]), encoding="utf-8")
    model = ("--model", bench / "emps300_qm_ac.py", "--cutoff-hz", "150", "--method", "wls")
    columns = (
        "--map",
        "q_m=-angle",
        "--map",
        "a_c=acc",
        "--map",
        "Gamma_m=current",
        "--scale",
        "q_m=0.0009765625",
    )
    ours = run_json("identify", bench / "trapezoid.csv", *model)
    by_time = run_json("identify", "foreign.csv", *model, *columns, "--time", "clock")
    by_fs = run_json("identify", "foreign.csv", *model, *columns, "--fs", "5000")
    assert by_time["params"] == pytest.approx(ours["params"], rel=1e-9)
    assert by_fs["params"] == pytest.approx(ours["params"], rel=1e-9)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--map", "q_m"), ("--map q_m",)),
        (("--map", "q_n=q_m"), ("--map", "q_n", "q_m")),
        (("--map", "q_m=theta"), ("theta",)),
        (("--scale", "q_m=zero"), ("zero",)),
        (("--cutoff-hz", "5000"), ("cutoff_hz",)),
        (("--drop", "-1"), ("drop",)),
        (("--fs", "1000"), ("1000",)),
        (("--model", "absent.py"), ("absent.py",)),
    ],
)
def test_identify_explains(
    identify: tuple[str | Path, ...], arguments: tuple[str, ...], words: tuple[str, ...]
) -> None:
    assert_explained(run(*identify, *arguments), 2, *words)


def test_identify_reports_the_mistakes_of_every_file(bench: Path) -> None:
    result = run("identify", "absent.csv", "b.docx", "--model", bench / "emps300_qm_ac.py")
    assert_explained(result, 2, "absent.csv", "b.docx")
    assert len(result.stderr.splitlines()) == 2


def test_identify_refuses_to_execute_any_file(here: Path, bench: Path) -> None:
    Path("script.py").write_text("open('executed', 'w')", encoding="utf-8")
    assert_explained(run("identify", bench / "chirp.npz", "--model", "script.py"), 2, "script.py")
    assert not Path("executed").exists()


def test_data_that_cannot_answer_exit_1(here: Path, bench: Path) -> None:
    # at a standstill nearly all the time: every row of the sensor set is masked or without motion
    lines = ["t,q_m,a_c,Gamma_m"]
    lines += [f"{k / 1000},{1e-9 * (k % 2)},{1e-9 * (k % 3)},{1e-9 * (k % 5)}" for k in range(2000)]
    Path("still.csv").write_text("\n".join(lines), encoding="utf-8")
    result = run("identify", "still.csv", "--model", bench / "emps300_qm_ac.py", "--cutoff-hz", "100")
    assert_explained(result, 1)


# what happens around the commands ----------------------------------------------------------------------


def test_interruption_exits_130(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(path: Path) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("modelgen.spec.description.load_description", interrupted)
    result = run("show", "emps300")
    assert (result.exit_code, result.stderr) == (130, "interrupted\n")


# as a process ------------------------------------------------------------------------------------------


def process(*arguments: str, folder: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-W", "error", "-m", "modelgen", *arguments]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def test_mistakes_as_a_process(repo_root: Path) -> None:
    done = process("show", "nonsense", folder=repo_root)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("error: ") and len(done.stderr.splitlines()) == 1


def test_generated_folder_is_up_to_date(repo_root: Path) -> None:
    specs = [str(path) for path in sorted(repo_root.glob("modelgen/catalog/*.toml"))]
    done = process("generate", "--check", *specs, folder=repo_root)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.slow
def test_identify_takes_tags_a_pairing_and_named_directions(identify: tuple[str | Path, ...]) -> None:
    tags = ("--tag", "chirp=chirp", "--tag", "trapezoid=trapezoid")
    rows = run_json(*identify, "--pairing", "pham2002", *tags)["rows"]
    assert [(row["record"], row["row"]) for row in rows if row["used"]] == [
        ("chirp", "m"),
        ("chirp", "c"),
        ("trapezoid", "m+c"),
    ]
    assert_explained(run(*identify, "--tag", "chrip=chirp"), 2, "chrip", "chirp")
    assert_explained(run(*identify, "--direction", "sign_m=q_m"), 2, "sign_m")
    assert_explained(run(*identify, "--direction", "sign_m"), 2, "write --direction NAME=VALUE")
