"""Coverage-guided fuzzing of the readers: whatever the bytes, a result or a ModelgenError.

    pip install atheris
    python tests/fuzz/atheris_readers.py toml -max_total_time=600 -timeout=5 -rss_limit_mb=1024
    python tests/fuzz/atheris_readers.py csv -max_total_time=600 -timeout=5 -rss_limit_mb=1024

Further targets: npz, module. Options of libFuzzer: a traceback, a hang of 5 s or 1 GB of memory ends
the run and leaves the input in a file.
"""

from __future__ import annotations

import sys
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["modelgen"]):
    from modelgen.errors import ModelgenError
    from modelgen.module_check import module_problems, seal
    from modelgen.runtime.read import read_record
    from modelgen.spec import parse_spec

FOLDER = Path(tempfile.mkdtemp(prefix="modelgen_fuzz_"))


def toml(data: bytes) -> None:
    """Parse a spec."""
    parse_spec(data.decode("utf-8", errors="replace"), "fuzz.toml")


def csv(data: bytes) -> None:
    """Read a table, and its numbers."""
    path = FOLDER / "fuzz.csv"
    path.write_bytes(data)
    read_record(path, fs=1000.0)


def npz(data: bytes) -> None:
    """Read an archive."""
    path = FOLDER / "fuzz.npz"
    path.write_bytes(data)
    read_record(path)


def module(data: bytes) -> None:
    """Check a module with a good seal."""
    module_problems(seal(data.decode("utf-8", errors="replace")))


TARGETS: dict[str, Callable[[bytes], None]] = {"toml": toml, "csv": csv, "npz": npz, "module": module}


def main() -> None:
    """Fuzz the target of the first argument."""
    target = TARGETS[sys.argv.pop(1)]

    def one(data: bytes) -> None:
        try:
            target(data)
        except ModelgenError as error:
            assert all(problem.what and problem.remedy for problem in error.problems)
            assert str(error)

    warnings.simplefilter("error")
    atheris.Setup(sys.argv, one)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
