"""A winder that no other test knows, logged as German drives do: two commands to a report, then validated."""

from __future__ import annotations

import math
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from modelgen.cli.main import app
from modelgen.runtime.files.source import Source
from modelgen.runtime.records.mapping_file import load_mapping
from modelgen.runtime.records.propose_mapping import propose
from modelgen.runtime.records.read_record import read_record

SPEC = """
chain = { name = "winder", motion = "rotation" }
bodies = [
    { name = "servo", inertia = "J_s", viscous = "F_vs", coulomb = "F_cs", actuator = "T_s" },
    { name = "drum", inertia = "J_d", viscous = "F_vd", coulomb = "F_cd" },
]
links = [{ bodies = ["servo", "drum"], stiffness = "K_w", damping = "D_w" }]

[sensors.encoders]
phi_s = { body = "servo", measures = "position" }
phi_d = { body = "drum", measures = "position" }

[parameters.bench]
J_s = 2.1e-4
F_vs = 3e-4
F_cs = 0.04
J_d = 9e-4
F_vd = 1e-3
F_cd = 0.06
K_w = 210.0
D_w = 0.03
"""
LOOP = "[controller]\nkp = 4.0\nkv = 0.06\n"
HEAD = [
    "Messung;Wickler 4;;;",
    "Datum;14.03.2024 09:12:44;;;",
    "",
    "Zeit;Sollposition Servo;Istposition Servo;Istposition Trommel;Drehmoment Servo",
    "ms;°;°;°;Nm",
]


def run(*arguments: str | Path, code: int = 0) -> Result:
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert result.exit_code == code, result.output
    return result


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("winder")
    (folder / "winder.toml").write_text(SPEC, encoding="utf-8")
    (folder / "loop.toml").write_text(LOOP, encoding="utf-8")
    run("generate", folder / "winder.toml", "-o", folder)
    for kind in ("chirp", "trapezoid"):
        noise = ("--noise", "phi_s=3e-6", "--noise", "phi_d=3e-6", "--noise", "T_s=2e-3")
        options = ("--excitation", kind, "--controller", folder / "loop.toml", "--with-reference", *noise)
        common = ("--sensors", "encoders", "--duration-s", "3", "--fs-hz", "4000")
        run("simulate", folder / "winder.toml", *common, *options, "-o", folder / f"{kind}.npz")
        write_log(folder / f"{kind}.npz", folder / f"Wickler {kind}.csv")
    return folder


def write_log(source: Path, path: Path) -> None:
    """Degrees, milliseconds, decimal commas; and one sample stands there twice."""
    record = read_record(source)
    lines = []
    for k in range(record.n):
        angles = (math.degrees(record.signals[key][k]) for key in ("reference", "phi_s", "phi_d"))
        values = (
            f"{1e3 * k / record.fs:.2f}",
            *(f"{v:.7f}" for v in angles),
            f"{record.signals['T_s'][k]:.6f}",
        )
        lines.append(";".join(values).replace(".", ","))
    lines.insert(500, lines[499])
    path.write_text("\r\n".join([*HEAD, *lines]) + "\r\n", encoding="cp1252", newline="")


@pytest.mark.slow
def test_two_commands_to_a_report_and_the_second_is_printed_by_the_first(
    bench: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(bench)
    model = "winder_encoders.py"
    printed = run("import", "Wickler chirp.csv", "--model", model, "--overwrite").stdout
    assert "repeats 1 time stamp(s), first at sample 500" in printed
    mapping = load_mapping("Wickler chirp.map.toml")
    assert mapping.columns == {
        "phi_s": "Istposition Servo",
        "phi_d": "Istposition Trommel",
        "T_s": "Drehmoment Servo",
        "reference": "Sollposition Servo",
    }
    second = shlex.split(printed.splitlines()[-1])[1:]
    refused = run(*second, code=2)
    assert "jumps by 0" in refused.stderr and "--mend" in refused.stderr
    options = (
        "--mend",
        "duplicates",
        "--controller",
        "loop.toml",
        "--spec",
        "winder.toml",
        "-o",
        "estimate.json",
    )
    told = run(*second, *options, "--overwrite")
    assert "mended: 1 samples with a repeated, backward or missing time stamp dropped" in told.stderr
    assert "wrote report.html" in told.stderr and "wrote estimate.json" in told.stderr
    page = (bench / "report.html").read_text(encoding="utf-8")
    assert "closed loop: phi_s, tracking error" in page
    assert "mended: 1 samples" in page and "--map-file" in page
    validated = run(
        "validate",
        "Wickler trapezoid.csv",
        *("--model", model, "--estimate", "estimate.json", "--controller", "loop.toml"),
        *("--map-file", "Wickler chirp.map.toml", "--mend", "duplicates"),
    )
    assert "Wickler trapezoid, held out" in validated.stdout
    assert "mended: 1 samples" in validated.stderr


def test_what_would_fail_at_the_end_fails_at_the_beginning(bench: Path, tmp_path: Path) -> None:
    there = tmp_path / "there.json"
    there.write_text("{}", encoding="utf-8")
    common = ("identify", tmp_path / "absent.csv", "--model", bench / "winder_encoders.py")
    assert "there.json: exists already" in run(*common, "-o", there, code=2).stderr
    assert "has the suffix '.bmp'" in run(*common, "--figure", tmp_path / "a.bmp", code=2).stderr
    assert "has the suffix '.txt'" in run(*common, "--report", tmp_path / "a.txt", code=2).stderr


@pytest.mark.parametrize(
    ("told", "measured"),
    [
        ("Sollposition Servo", "Istposition Servo"),
        ("Servo.SetPos", "Servo.ActPos"),
        ("servo_pos_ref", "servo_pos"),
        ("Servo position setpoint", "Servo position actual"),
    ],
)
def test_what_was_asked_for_is_not_taken_for_what_was_measured(bench: Path, told: str, measured: str) -> None:
    from modelgen.runtime.model.model import load_model

    model = load_model(bench / "winder_encoders.py")
    names = (told, "drum angle", measured, "servo torque")
    source = Source(Path("log.csv"), names, lambda _: {}, units=dict.fromkeys(names[:3], "deg"))
    chosen = {entry.key: entry.column for entry in propose(source, model)}
    assert chosen == {"phi_s": measured, "phi_d": "drum angle", "T_s": "servo torque", "reference": told}
