"""Every snippet of the documentation and every example of the help runs, page by page, from top to bottom.

A block with a title is written to the file of that name, `console` lines that start with $ are commands, and
the Python of a page is one program.
"""

from __future__ import annotations

import re
import shlex
import shutil
import tomllib
from pathlib import Path
from typing import NamedTuple

import pytest
from typer.testing import CliRunner

from modelgen.cli.examples import EXAMPLES
from modelgen.cli.main import app

# what dask's local clusters leave behind
pytestmark = [
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
    pytest.mark.filterwarnings("ignore:Port .* is already in use:UserWarning"),
]

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted(path.relative_to(ROOT / "docs").as_posix() for path in (ROOT / "docs").rglob("*.md"))


class Block(NamedTuple):
    language: str
    title: str | None
    text: str


def blocks_of(page: str) -> list[Block]:
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    found = re.findall(r'^```(\w+)(?: title="([^"]+)")?\n(.*?)^```$', text, re.MULTILINE | re.DOTALL)
    return [Block(language, title or None, body) for language, title, body in found]


def commands_of(block: Block) -> list[str]:
    """Return the commands of a block; a backslash at the end of a line joins the next one."""
    return [line.removeprefix("$ ") for line in block.text.replace("\\\n", "").splitlines()]


def run_command(line: str) -> str:
    program, *arguments = shlex.split(line)
    assert program == "modelgen", line
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, f"{line}\n{result.output}"
    return result.output


def assert_printed(shown: str, printed: str) -> None:
    """Word by word; the last digits of numbers may differ from machine to machine."""
    digits = r"[\d.]+"
    assert re.sub(digits, "#", shown) in re.sub(digits, "#", printed)
    begin = printed.index(shown[: shown.index("\n")])
    for here, there in zip(re.findall(digits, shown), re.findall(digits, printed[begin:]), strict=False):
        if here.strip(".") and there.strip("."):
            assert float(here) == pytest.approx(float(there), rel=0.05)


LONG = ("trust", "python", "monitor", "arm", "sensors", "compare", "validate", "long-records")


@pytest.mark.parametrize(
    "page",
    [pytest.param(page, marks=pytest.mark.slow) if Path(page).stem in LONG else page for page in PAGES],
)
def test_every_snippet_runs(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {"__name__": "docs"}
    printed: list[str] = []
    for block in blocks_of(page):
        if block.title is not None:
            Path(block.title).parent.mkdir(parents=True, exist_ok=True)
            Path(block.title).write_text(block.text, encoding="utf-8")
        elif block.language == "console":
            printed = [run_command(line) for line in commands_of(block)]
        elif block.language == "text":
            assert_printed(block.text, printed[-1])
        elif block.language == "python":
            exec(compile(block.text, page, "exec"), names)
        else:
            assert block.language == "toml", f"{page}: a block of {block.language} that nothing runs"
            tomllib.loads(block.text)


@pytest.mark.slow
def test_the_first_chain_of_the_readme_goes_through(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its lines as they stand there, down to the report; the answer holds what was simulated."""
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    (spec,) = re.findall(r"^```toml\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    (block,) = re.findall(r"^```\n(modelgen show axis.*?)^```$", text, re.MULTILINE | re.DOTALL)
    Path("axis.toml").write_text(spec, encoding="utf-8")
    lines = [line.partition(" #")[0].strip() for line in block.replace("\\\n", " ").splitlines()]
    printed = [run_command(line) for line in lines if line.startswith("modelgen")]
    assert "Verdict: " in printed[-1] and Path("report.html").is_file()
    guess = tomllib.loads(spec)["parameters"]["guess"]
    for name in ("J_m", "J_c", "K"):
        assert float(re.findall(rf"^  {name} +([\d.]+)", printed[-1], re.MULTILINE)[0]) == pytest.approx(
            guess[name], rel=0.02
        )


def test_the_tutorial_ends_with_a_report() -> None:
    blocks = [block for block in blocks_of("tutorial.md") if block.language == "console"]
    commands = [line for block in blocks for line in commands_of(block)]
    assert sum(line.startswith("modelgen identify") for line in commands) == 2
    assert "--report report.html" in commands[-1]


def test_every_link_leads_somewhere() -> None:
    broken = []
    for page in PAGES:
        path = ROOT / "docs" / page
        for target in re.findall(r"\]\(([^)#]+)[^)]*\)", path.read_text(encoding="utf-8")):
            if not target.startswith(("http:", "https:")) and not (path.parent / target).is_file():
                broken.append(f"{page}: {target}")
    assert broken == []


def test_every_page_is_in_the_navigation() -> None:
    listed = re.findall(r"[\w/-]+\.md", (ROOT / "mkdocs.yml").read_text(encoding="utf-8"))
    assert sorted(listed) == PAGES


PROJECT = 'spec = "emps300"\nsensors = "qm_ac"\n'
GROUPS = "".join(f'[[records]]\nfiles = ["run{k}.csv"]\n' for k in (1, 2))
LOOP = "[controller]\nkp = 0.19\nkv = 1.7e-3\n"


@pytest.mark.slow
def test_examples_of_the_help_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In an order in which each finds what it needs; the demo has a test of its own."""
    monkeypatch.chdir(tmp_path)
    Path("loop.toml").write_text(LOOP, encoding="utf-8")
    lines = {command: list(lines) for command, lines in EXAMPLES.items()}
    for command in ("new", "show", "generate", "simulate"):
        for line in lines[command]:
            if "--check" not in line:
                run_command(line)
    run_command("modelgen generate emps300")
    run_command("modelgen generate emps300 --check")
    simulate = "modelgen simulate emps300 --sensors qm_ac --parameters light --excitation chirp"
    run_command(f"{simulate} --duration-s 3 -o run1.csv")
    run_command(f"{simulate} --duration-s 3 --noise q_m=2e-6 -o run2.csv")
    for machine in ("axis1", "axis2"):
        Path(machine).mkdir()
    shutil.copy("chirp.npz", "axis1/run1.npz")
    noise = "--noise q_m=2e-6 --noise a_c=0.5 --noise Gamma_m=1e-4 --seed 2"
    run_command(f"{simulate} {noise} -o axis2/run1.npz")
    Path("axis.project.toml").write_text(PROJECT + GROUPS, encoding="utf-8")
    later = [
        command for command in EXAMPLES if command not in ("demo", "new", "show", "generate", "simulate")
    ]
    for command in later:
        for line in lines[command]:
            run_command(line)


def test_every_command_has_an_example() -> None:
    assert {command.name or command.callback.__name__ for command in app.registered_commands} == set(EXAMPLES)


@pytest.mark.parametrize("command", EXAMPLES)
def test_the_help_shows_its_examples(command: str) -> None:
    printed = run_command(f"modelgen {command} --help")
    for line in EXAMPLES[command]:
        assert line in printed
