"""A full disk, a folder that may not be written, Ctrl-C: one line, an exit code, and no file half written."""

from __future__ import annotations

import os
import pty
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from modelgen import __main__ as entry
from modelgen.generated_module.module_check import module_problems
from modelgen.runtime.numerics.numba_support import kept_code
from modelgen.runtime.records.record import Record
from modelgen.runtime.records.write_record import write_record

ROOT = Path(__file__).resolve().parents[2]
MODULE = ROOT / "generated" / "emps_rigid_qm.py"
LIMITED = (
    "import resource, sys\n"
    "from modelgen.cli.main import main\n"
    "resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]), int(sys.argv[1])))\n"
    "main(sys.argv[2:])\n"
)
WRITING = (
    "from modelgen.runtime.records.read_record import read_record\n"
    "from modelgen.runtime.records.write_record import write_record\n"
    "one = read_record('a.csv')"
)


def environment() -> dict[str, str]:
    # NumPy's and Numba's caches would be written, too
    return {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1"}


def with_disk_of(size: int, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the command line where no file may grow beyond `size` bytes."""
    command = [sys.executable, "-c", LIMITED, str(size), *arguments]
    return subprocess.run(command, env=environment(), capture_output=True, text=True, check=False)


@pytest.fixture
def record(processes: Path) -> Path:
    """A mass of 2 kg with friction, pushed back and forth, in a file."""
    t = np.arange(8000) / 1000.0
    q = 0.05 * np.sin(2.0 * np.pi * 1.5 * t) + 0.01 * np.sin(2.0 * np.pi * 7.0 * t)
    v, a = np.gradient(q, t), np.gradient(np.gradient(q, t), t)
    write_record(processes / "a.csv", Record({"q_m": q, "F": 2.0 * a + 5.0 * v + 3.0 * np.sign(v)}, 1000.0))
    return processes / "a.csv"


# A full disk --------------------------------------------------------------------------------------


def test_a_record_that_does_not_fit_is_not_left_in_part(record: Path) -> None:
    code = (
        LIMITED.split("main(")[0].replace("from modelgen.cli.main import main", WRITING)
        + "write_record('b.csv', one)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, "20000"], env=environment(), capture_output=True, text=True, check=False
    )
    assert done.stderr.splitlines()[-1] == (
        "modelgen.errors.ModelgenError: b.csv: cannot be written (File too large); "
        "check the path, its permissions and the free space"
    )
    assert list(record.parent.iterdir()) == [record]


def test_machine_code_that_cannot_be_kept_runs_all_the_same() -> None:
    made: list[bool] = []

    def njit(cache: bool = False, **options: bool) -> Callable[[Any], Any]:
        made.append(cache)

        def build(function: Any) -> Any:
            def run(*arguments: Any) -> Any:
                if cache:
                    raise OSError(28, "No space left on device")
                return function(*arguments)

            return run

        assert options == {"nogil": True}
        return build

    add = kept_code(njit, lambda a, b: a + b, nogil=True)
    assert (add(1, 2), add(3, 4)) == (3, 7)
    assert made == [True, False]


@pytest.mark.slow
def test_modules_that_fit_are_whole_and_the_others_are_absent(processes: Path) -> None:
    done = with_disk_of(9_000, "generate", "emps300", "-o", "out")
    assert done.returncode == 2
    assert "cannot be written (File too large)" in done.stderr
    written = sorted(path.name for path in (processes / "out").iterdir())
    assert written == ["emps300_qm_qc.py"]  # 8.5 kB; the other one has 9.4 kB
    assert module_problems((processes / "out" / written[0]).read_text(encoding="utf-8")) == []


@pytest.mark.slow
@pytest.mark.parametrize(("option", "name"), [("-o", "estimate.json"), ("--report", "report.html")])
def test_results_that_do_not_fit_leave_the_old_file(record: Path, option: str, name: str) -> None:
    old = record.with_name(name)
    old.write_text("old", encoding="utf-8")
    arguments = [
        "identify",
        record.name,
        "--model",
        str(MODULE),
        option,
        name,
        "--overwrite",
        "--method",
        "wls",
    ]
    done = with_disk_of(2_000, *arguments)
    assert done.returncode == 2
    assert f"error: {name}: cannot be written (File too large)" in done.stderr
    assert "Traceback" not in done.stderr
    assert old.read_text(encoding="utf-8") == "old"
    assert sorted(path.name for path in record.parent.iterdir()) == sorted([record.name, name])


# A folder that may not be written -----------------------------------------------------------------


@pytest.fixture
def locked() -> Iterator[Path]:
    """A folder that others than its owner may read only, outside the private folders of the tests."""
    with tempfile.TemporaryDirectory(prefix="modelgen_locked_") as name:
        folder = Path(name)
        (folder / "old.csv").write_bytes(b"old")
        folder.chmod(0o555)
        yield folder
        folder.chmod(0o755)


AS_NOBODY = (
    "import os, sys; from modelgen.atomic_write import make_folder, write_whole\n"
    "from modelgen.errors import ModelgenError\n"
    "if os.getuid() == 0: os.setuid(65534)\n"
    "for name in ('new.csv', 'old.csv'):\n"
    "    try: write_whole(sys.argv[1] + '/' + name, b'new', overwrite=True)\n"
    "    except ModelgenError as error: print(error)\n"
    "try: make_folder(__import__('pathlib').Path(sys.argv[1]) / 'sub')\n"
    "except ModelgenError as error: print(error)\n"
)


def test_a_folder_that_may_only_be_read(processes: Path, locked: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", AS_NOBODY, str(locked)],
        env=environment(),
        capture_output=True,
        text=True,
        check=True,
    )
    remedy = "check the path, its permissions and the free space"
    assert done.stdout.splitlines() == [
        f"{locked}/new.csv: cannot be written (Permission denied); {remedy}",
        f"{locked}/old.csv: cannot be written (Permission denied); {remedy}",
        f"{locked}/sub: cannot be made a folder (Permission denied); check the path and its permissions",
    ]
    assert [path.name for path in locked.iterdir()] == ["old.csv"]
    assert (locked / "old.csv").read_bytes() == b"old"


# Ctrl-C -------------------------------------------------------------------------------------------


def shell_code(process: subprocess.Popen[str]) -> int:
    """Return the exit code as a shell shows it: Python may end itself by the signal after cleaning up."""
    return process.returncode if process.returncode >= 0 else 128 - process.returncode


def interrupted_at(line: str, *arguments: str) -> tuple[int, str]:
    """Run a command in a terminal until it says `line`, press Ctrl-C; return exit code and what it said."""
    # Python answers SIGINT only where it is not ignored from the start, as in what a shell runs behind it
    heard = "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler); "
    command = [sys.executable, "-c", f"{heard}from modelgen.__main__ import run; run()", *arguments]
    terminal, stderr = pty.openpty()
    said, pressed = "", False
    with subprocess.Popen(command, env=environment(), stderr=stderr, text=True) as process:
        os.close(stderr)
        with suppress(OSError):  # a terminal whose other end is closed cannot be read
            while text := os.read(terminal, 4096).decode():
                said += text
                if line in said and not pressed:
                    process.send_signal(signal.SIGINT)
                    pressed = True
    os.close(terminal)
    assert pressed, said
    return shell_code(process), said


@pytest.mark.slow
@pytest.mark.parametrize("line", ["choosing filters", "filtering and solving", "judging the fit"])
def test_an_interrupted_identification_leaves_the_old_result(record: Path, line: str) -> None:
    old = record.with_name("estimate.json")
    old.write_text("old", encoding="utf-8")
    arguments = (
        "identify",
        record.name,
        "--model",
        str(MODULE),
        "--method",
        "iv",
        "-o",
        old.name,
        "--overwrite",
    )
    code, said = interrupted_at(line, *arguments)
    assert code == 130
    assert said.endswith("interrupted\r\n")
    assert "Traceback" not in said
    assert old.read_text(encoding="utf-8") == "old"
    assert sorted(path.name for path in record.parent.iterdir()) == [record.name, old.name]


def test_an_interrupt_while_the_program_is_still_loading(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    class Loading:
        def __getattr__(self, name: str) -> object:
            raise KeyboardInterrupt

    monkeypatch.setitem(sys.modules, "modelgen.cli.main", Loading())  # type: ignore[arg-type]
    with pytest.raises(SystemExit) as caught:
        entry.run()
    assert caught.value.code == 130
    assert capsys.readouterr().err == "interrupted\n"
