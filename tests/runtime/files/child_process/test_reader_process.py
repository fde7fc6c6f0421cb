"""Files that end, hang or bloat the process that reads them: a message, and the next file is read."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from modelgen.errors import DataError
from modelgen.runtime.files.child_process import reader_process
from modelgen.runtime.files.formats import open_source
from modelgen.runtime.files.open_channels import open_channels

h5py = pytest.importorskip("h5py")

# what a file does to the library that reads it, by its name; libraries are mended, files are not
PATCH = """
import ctypes, os, signal
import modelgen.runtime.files.child_process.hdf5_calls as calls

def patched(call):
    def answer(path, **arguments):
        if path.stem == "crash":
            signal.signal(signal.SIGSEGV, signal.SIG_DFL)
            os.kill(os.getpid(), signal.SIGSEGV)
        if path.stem == "abort":
            os.abort()
        if path.stem == "exit":
            os._exit(0)
        if path.stem == "hang":
            while True:
                pass
        if path.stem == "bloat":
            held = [bytearray(50_000_000) for _ in range(100)]
        if path.stem == "late" and call.__name__ == "stretch":
            os.abort()
        if path.stem == "noise":
            os.write(1, b"corrupted"), os.write(2, b"corrupted")
        yield from call(path, **arguments)
    return answer

for name in ("listing", "columns", "lengths", "stretch"):
    setattr(calls, name, patched(getattr(calls, name)))
"""
START = reader_process.START.replace("from modelgen", "exec(sys.argv[2]); from modelgen")


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder, and libraries that die of certain files in it."""
    for name in ("good", "crash", "abort", "exit", "hang", "bloat", "late", "noise"):
        with h5py.File(tmp_path / f"{name}.h5", "w") as file:
            file["q_m"], file["F"], file.attrs["fs"] = np.arange(50.0), np.ones(50), 1000.0
    monkeypatch.setattr(reader_process, "START", START)
    monkeypatch.setattr(reader_process, "MORE_ARGUMENTS", (PATCH,))
    reader_process.end_all()
    yield tmp_path
    reader_process.end_all()


DEATHS = {
    "crash": "the library that reads it ended with SIGSEGV",
    "abort": "the library that reads it ended with SIGABRT",
    "exit": "the library that reads it ended with code 0",
    "hang": "reading it takes far longer than a file of its size should",
    "bloat": "MemoryError|SIG",
}


@pytest.mark.slow
@pytest.mark.parametrize("name", DEATHS)
@pytest.mark.parametrize("used", [False, True])
def test_a_file_that_ends_the_process_that_reads_it(files: Path, name: str, used: bool) -> None:
    if used:
        assert open_source(files / "good.h5").names == ("F", "q_m")
    with pytest.raises(DataError, match=rf"{name}\.h5: is no readable HDF5 file \(.*({DEATHS[name]})"):
        open_source(files / f"{name}.h5")
    source = open_source(files / "good.h5")
    np.testing.assert_array_equal(source.load(("q_m",))["q_m"], np.arange(50.0))


def test_what_a_library_prints_is_no_answer(files: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert open_source(files / "noise.h5").fs == 1000.0
    assert capfd.readouterr() == ("", "")


@pytest.mark.slow
def test_a_record_in_stretches_survives_too(files: Path) -> None:
    columns = {"q_m": ("q_m", 1.0)}
    with pytest.raises(DataError, match=r"crash\.h5: is no readable"):
        open_channels(files / "crash.h5", columns, fs=1000.0)
    late = open_channels(files / "late.h5", columns, fs=1000.0)
    with pytest.raises(DataError, match=r"late\.h5: is no readable HDF5 file"):
        late.read("q_m", 0, 10)
    good = open_channels(files / "good.h5", columns, fs=1000.0)
    np.testing.assert_array_equal(good.read("q_m", 5, 10), np.arange(5.0, 10.0))


def test_a_process_that_was_ended_is_started_again(files: Path) -> None:
    source = open_source(files / "good.h5")
    process = reader_process._READERS["hdf5"].process
    assert process is not None
    process.kill()
    np.testing.assert_array_equal(source.load(("q_m",))["q_m"], np.arange(50.0))


def test_neither_the_folder_nor_the_environment_decides_what_is_run(
    files: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("json.py", "sitecustomize.py", "numpy.py"):
        (files / name).write_text("open('pwned', 'w')")
    monkeypatch.chdir(files)
    monkeypatch.setenv("PYTHONPATH", str(files))
    monkeypatch.setenv("PYTHONSTARTUP", str(files / "json.py"))
    assert open_source(Path("good.h5")).names == ("F", "q_m")
    assert not (files / "pwned").exists()


def test_no_process_is_left_behind(files: Path) -> None:
    open_source(files / "good.h5")
    process = reader_process._READERS["hdf5"].process
    assert process is not None
    reader_process.end_all()
    with pytest.raises(ProcessLookupError):
        os.kill(process.pid, 0)


def test_an_interrupted_call_leaves_nothing_for_the_next(
    files: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = reader_process.ask("hdf5.listing", files / "good.h5")
    with monkeypatch.context() as patch:
        patch.setattr(reader_process.json, "loads", _interrupt)
        with pytest.raises(KeyboardInterrupt):
            reader_process.ask("hdf5.columns", files / "good.h5", names=["a"])
    assert str(reader_process.ask("hdf5.listing", files / "good.h5")) == str(first)


def _interrupt(_: bytes) -> None:
    raise KeyboardInterrupt


def test_it_ends_with_the_process_that_started_it(files: Path) -> None:
    import subprocess
    import sys

    code = (
        "import os, sys; from pathlib import Path; "
        "from modelgen.runtime.files.child_process import reader_process as r; "
        "r.ask('hdf5.listing', Path(sys.argv[1])); print(r._READERS['hdf5'].process.pid, flush=True); "
        "os.kill(os.getpid(), 9)"
    )
    ran = subprocess.run(
        [sys.executable, "-c", code, str(files / "good.h5")], capture_output=True, timeout=60
    )
    child = int(ran.stdout)
    for _ in range(600):  # its input has ended, and so does it
        if not Path(f"/proc/{child}").exists() or "\nState:\tZ" in Path(f"/proc/{child}/status").read_text():
            return
        time.sleep(0.05)
    pytest.fail("the reading process lives on")
