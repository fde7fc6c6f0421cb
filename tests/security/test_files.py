"""Every place that opens an input, with everything that a path may lead to: one message, at once."""

from __future__ import annotations

import os
import resource
import signal
import stat
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from modelgen.cli.candidates import load_candidates
from modelgen.errors import DataError, ModelgenError
from modelgen.project.history import load_history
from modelgen.project.lock_file import load_lock
from modelgen.project.project_file import load_project
from modelgen.read_file import DATA, open_file
from modelgen.render.target import user_files
from modelgen.runtime.files.formats import READERS, open_source
from modelgen.runtime.files.npy_channels import open_npy
from modelgen.runtime.files.open_channels import FORMATS, open_channels
from modelgen.runtime.model.model import load_model
from modelgen.runtime.records.mapping_file import load_mapping
from modelgen.runtime.records.read_record import read_record
from modelgen.runtime.results.estimate_file import load_estimate
from modelgen.runtime.simulation.controller_file import load_controller
from modelgen.spec.arms.load import load_arm, parse_arm
from modelgen.spec.load import catalog_path, load_spec

CHAIN = load_spec(catalog_path("emps_rigid"))
ARM = '[arm]\nname = "a"\nurdf = "{}"\n'
MEGABYTES = 500
ENTRIES: dict[str, tuple[str, Callable[[Path], object]]] = {
    "spec": ("a.toml", load_spec),
    "arm": ("a.toml", load_arm),
    "urdf": ("a.urdf", lambda path: parse_arm(ARM.format(path.name), "a.toml", path.parent)),
    "module": ("a.py", load_model),
    "trusted module": ("a.py", lambda path: load_model(path, trust=True)),
    "mapping": ("a.toml", load_mapping),
    "controller": ("a.toml", load_controller),
    "instruments": ("a.toml", lambda path: load_candidates(path, CHAIN)),
    "estimate": ("a.json", load_estimate),
    "project": ("a.toml", load_project),
    "history": ("a.jsonl", load_history),
    "lock": ("a.lock", load_lock),
    "template": ("a.txt.j2", lambda path: user_files(CHAIN, "qm", path.parent)),
    "npy": ("a.npy", lambda path: open_npy({"q_m": path}, 1000.0)),
    **{f"record{suffix}": (f"a{suffix}", read_record) for suffix in READERS},
    **{
        f"stretches{suffix}": (f"a{suffix}", lambda path: open_channels(path, {"q_m": ("q_m", 1.0)}, 1000.0))
        for suffix in FORMATS
    },
}
DEEP, DIGITS = 50_000, "9" * 5000
CONTENTS = {
    "empty": b"",
    "UTF-16": "kp = 1\n".encode("utf-16"),
    "UTF-16 without a mark": "kp = 1\n".encode("utf-16-le"),
    "UTF-32": "kp = 1\n".encode("utf-32"),
    "UTF-32 the other way": b"\0\0\xfe\xff" + "kp = 1\n".encode("utf-32-be"),
    "EBCDIC": "t,q_m\n0,1\n1,2\n2,3\n".encode("cp500"),
    "null bytes": b"t,q_m\n0,1\n\0\0\0\0\n",
    "noise": np.random.default_rng(1).bytes(10_000),
    "one line": b"1," * 6_000_000,
    "deep TOML lists": b"a = " + b"[" * DEEP + b"]" * DEEP,
    "deep TOML tables": b"a = " + b"{a=" * DEEP + b"1" + b"}" * DEEP,
    "a key of many parts": b".".join([b"a"] * DEEP) + b" = 1",
    "a table of many parts": b"[" + b".".join([b"a"] * DEEP) + b"]",
    "quoted parts": b".".join([b'"a"'] * DEEP) + b" = 1",
    "deep JSON lists": b"[" * DEEP + b"]" * DEEP,
    "deep JSON tables": b'{"a":' * DEEP + b"1" + b"}" * DEEP,
    "TOML integer": f"a = {DIGITS}".encode(),
    "TOML hexadecimal": f"a = 0x{DIGITS}".encode(),
    "JSON integer": f'{{"format": {DIGITS}}}'.encode(),
    "JSON infinity": b'{"format": Infinity}',
    "many quotes": b'a = "' + b'\\"' * 400_000,
    "open quotes": b'a = """' + b'\\"""' * 200_000,
}


def link_to(target: str) -> Callable[[Path], object]:
    return lambda path: path.symlink_to(target)


def sparse(size: int, head: bytes = b"") -> Callable[[Path], object]:
    def make(path: Path) -> None:
        path.write_bytes(head)
        os.truncate(path, size)

    return make


PLACES: dict[str, Callable[[Path], object]] = {
    "absent": lambda path: None,
    "folder": Path.mkdir,
    "pipe": os.mkfifo,
    "socket": lambda path: os.mknod(path, stat.S_IFSOCK | 0o600),
    "device": link_to("/dev/zero"),
    "other device": link_to("/dev/tty"),
    "link to itself": lambda path: path.symlink_to(path),
    "link to nowhere": link_to("absent"),
    "link to a folder": link_to("/"),
    "sparse": sparse(300_000_000),
    "sparse, 10 TB": sparse(10**13),
    "sparse below a table": sparse(10**10, b"t,q_m\n0.000,1\n0.001,2\n"),
    "file without size": link_to("/proc/self/pagemap"),
}
NAMES = {"null byte": "a\0", "too long": "a" * 5000, "half a surrogate": "a\ud800", "not text": "a\udcff"}


@contextmanager
def bounded() -> Iterator[None]:
    """Five seconds of the processor and 500 MB; on a busy machine the clock goes on longer."""

    def late(*_: object) -> None:
        raise AssertionError("it waits without an end")

    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    before = resource.getrlimit(resource.RLIMIT_AS)
    old = signal.signal(signal.SIGALRM, late)
    resource.setrlimit(resource.RLIMIT_AS, (used + MEGABYTES * 1_000_000, before[1]))
    signal.setitimer(signal.ITIMER_REAL, 60.0)
    began = time.process_time()
    try:
        yield
        assert time.process_time() - began < 5.0
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, old)
        resource.setrlimit(resource.RLIMIT_AS, before)


@pytest.fixture
def limited(trap: Path) -> Iterator[None]:
    """Bound a test that is one case; what goes through many bounds each of them."""
    with bounded():
        yield


def refused(entry: str, path: Path) -> None:
    with pytest.raises(ModelgenError) as caught:
        ENTRIES[entry][1](path)
    assert caught.value.exit_code == 2
    for problem in caught.value.problems:
        assert str(problem).isprintable()
        assert len(str(problem)) < 2500


def wrong_cases(kinds: Iterable[str], check: Callable[[str, Path], None], trap: Path) -> dict[str, str]:
    """Return what went wrong, by case, each bounded and in a folder of its own.

    A test goes through all cases of an entry: pytest takes longer for a test than most cases do.
    """
    wrong = {}
    for number, kind in enumerate(kinds):
        folder = trap / f"folder{number}"
        folder.mkdir()
        try:
            with bounded():
                check(kind, folder)
        except (Exception, pytest.fail.Exception) as problem:
            wrong[kind] = f"{type(problem).__name__}: {problem}"
    return wrong


@pytest.mark.parametrize("entry", ENTRIES)
def test_what_is_no_file_to_read(trap: Path, entry: str) -> None:
    def check(kind: str, folder: Path) -> None:
        PLACES[kind](folder / ENTRIES[entry][0])
        refused(entry, folder / ENTRIES[entry][0])

    assert wrong_cases(PLACES, check, trap) == {}


@pytest.mark.parametrize("entry", [name for name in ENTRIES if name != "template"])
def test_a_name_that_no_file_has(trap: Path, entry: str) -> None:
    def check(kind: str, folder: Path) -> None:
        refused(entry, folder / (NAMES[kind] + ENTRIES[entry][0]))

    assert wrong_cases(NAMES, check, trap) == {}


@pytest.mark.parametrize("entry", [name for name in ENTRIES if name != "trusted module"])
def test_what_is_no_such_text(trap: Path, entry: str) -> None:
    def check(kind: str, folder: Path) -> None:
        path = folder / ENTRIES[entry][0]
        path.write_bytes(CONTENTS[kind])
        plain = CONTENTS[kind].isascii() and b"\0" not in CONTENTS[kind]
        if entry == "template" and plain and len(CONTENTS[kind]) < 1_000_000:
            assert user_files(CHAIN, "qm", folder) == {"emps_rigid_qm.txt": CONTENTS[kind].decode()}
            return
        refused(entry, path)

    assert wrong_cases(CONTENTS, check, trap) == {}


def test_every_case_is_bounded_and_named(trap: Path) -> None:
    def check(kind: str, folder: Path) -> None:
        if kind == "waits":
            signal.setitimer(signal.ITIMER_REAL, 0.01)
            time.sleep(10.0)
        if kind == "fills":
            bytearray(2 * MEGABYTES * 1_000_000)
        if kind == "is taken":
            with pytest.raises(ModelgenError):
                folder.exists()

    wrong = wrong_cases(["good", "waits", "fills", "is taken"], check, trap)
    assert {kind: text.partition(":")[0] for kind, text in wrong.items()} == {
        "waits": "AssertionError",
        "fills": "MemoryError",
        "is taken": "Failed",
    }


@pytest.mark.usefixtures("limited")
def test_a_file_that_may_not_be_read(trap: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (trap / "a.toml").write_text("")

    def refuse(*_: object) -> int:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("modelgen.read_file.os.open", refuse)
    for entry in ("spec", "mapping", "controller", "instruments"):
        with pytest.raises(ModelgenError, match=r"a\.toml: cannot be read \(Permission denied\)"):
            ENTRIES[entry][1](trap / "a.toml")


@pytest.mark.usefixtures("limited")
def test_what_is_exchanged_after_it_was_looked_at(trap: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = trap / "a.csv"
    path.write_text("t\n")
    look = os.stat

    def exchange(place: object, *arguments: object, **options: object) -> os.stat_result:
        found = look(place)  # type: ignore[arg-type]
        path.unlink()
        os.mkfifo(path)
        return found

    monkeypatch.setattr("modelgen.read_file.os.stat", exchange)
    with pytest.raises(ModelgenError, match=r"a\.csv: cannot be read \(it is a pipe\)"):
        open_file(path, DATA)


@pytest.mark.usefixtures("limited")
def test_a_link_to_a_file_and_a_file_with_holes_are_read(trap: Path) -> None:
    text = "t,q_m\n" + "".join(f"{k / 1000},{k % 7}\n" for k in range(100))
    (trap / "b.csv").write_text(text)
    (trap / "a.csv").symlink_to(trap / "b.csv")
    assert read_record(trap / "a.csv").n == 100
    with (trap / "c.bin").open("wb") as file:
        file.write(bytes(range(256)) * 40_000)
        file.truncate(500_000_000)
    with open_file(trap / "c.bin", DATA) as file:  # a fiftieth of it was written
        assert file.read(3) == b"\0\1\2"


@pytest.mark.usefixtures("limited")
@pytest.mark.parametrize("name", ["q_m,F\n1,2\n3,4\n", "t;q_m;F\n0.5;-1.25;+3e-4\n" * 40, "a\n1\n"])
def test_short_tables_of_a_mainframe_are_told(trap: Path, name: str) -> None:
    path = trap / "mainframe.csv"
    path.write_bytes(name.encode("cp500"))
    with pytest.raises(DataError, match="EBCDIC"):
        open_source(path)
