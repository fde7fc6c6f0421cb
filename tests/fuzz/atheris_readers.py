"""Coverage-guided fuzzing of the readers: whatever the bytes, a result or a ModelgenError.

    pip install atheris
    python tests/fuzz/atheris_readers.py toml -max_total_time=600 -timeout=5 -rss_limit_mb=1024
    python tests/fuzz/atheris_readers.py csv -max_total_time=600 -timeout=5 -rss_limit_mb=1024

Further targets: urdf, npz, module. A run starts from good files, so that it gets past the first line.
Options of libFuzzer: a traceback, a hang of 5 s or 1 GB of memory ends a run and leaves its input behind.
"""

from __future__ import annotations

import io
import sys
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path

import atheris
import numpy as np

with atheris.instrument_imports(include=["modelgen"]):
    from modelgen.errors import ModelgenError
    from modelgen.generated_module.module_check import module_problems, seal
    from modelgen.render.writer import generate
    from modelgen.runtime.records.read_record import read_record
    from modelgen.runtime.records.record import Record
    from modelgen.runtime.records.write_record import write_record
    from modelgen.spec.arms.urdf.read_urdf import described_arm
    from modelgen.spec.description import parse_description
    from modelgen.spec.load import catalog_arms, catalog_names, catalog_path, load_spec
from tests.spec.arms.random_urdf import random_urdf

FOLDER = Path(tempfile.mkdtemp(prefix="modelgen_fuzz_"))


def toml(data: bytes) -> None:
    """Parse a spec, of a chain or an arm."""
    parse_description(data.decode("utf-8", errors="replace"), "fuzz.toml")


def urdf(data: bytes) -> None:
    """Read an arm's URDF."""
    described_arm(data.decode("utf-8", errors="replace"), "fuzz.urdf", ())


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


def specs() -> list[bytes]:
    """Return the catalogue's chains and arms."""
    return [catalog_path(name).read_bytes() for name in (*catalog_names(), *catalog_arms())]


def tables() -> list[bytes]:
    """Return tables as modelgen, a spreadsheet and a logger write them."""
    record = Record({"q_m": np.arange(9.0), "F": np.ones(9)}, 1000.0, "seed", "chirp")
    write_record(FOLDER / "seed.csv", record)
    return [
        (FOLDER / "seed.csv").read_bytes(),
        b"t;q_m;F\r\n0,000;1,5;-2\r\n0,001;1,6;1e-3\r\n0,002;1,7;0\r\n",
        b'"Logger","v2"\n\n"time","angle"\n"ms","rad"\n0,1\n1,2\n2,4\n',
        "\ufefft [s]\tq_m [\u00b0]\n0\t1\n0.1\t2\n0.2\t3\n".encode(),
        "t,q_m\n0,1\n1,2\n".encode("utf-16"),
    ]


def archives() -> list[bytes]:
    """Return a record as modelgen writes it."""
    stream = io.BytesIO()
    np.savez(stream, fs=1000.0, q_m=np.arange(9.0))
    return [stream.getvalue()]


def modules() -> list[bytes]:
    """Return a generated module."""
    return [generate(load_spec(catalog_path("emps_rigid")), "qm").encode()]


def urdfs() -> list[bytes]:
    """Return trees with joints of all kinds."""
    return [random_urdf(seed).encode() for seed in range(5)]


SEEDS: dict[str, Callable[[], list[bytes]]] = {
    "toml": specs,
    "urdf": urdfs,
    "csv": tables,
    "npz": archives,
    "module": modules,
}
TARGETS: dict[str, Callable[[bytes], None]] = {
    "toml": toml,
    "urdf": urdf,
    "csv": csv,
    "npz": npz,
    "module": module,
}


def main() -> None:
    """Fuzz the target of the first argument."""
    name = sys.argv.pop(1)
    target, corpus = TARGETS[name], FOLDER / "corpus"
    corpus.mkdir()
    for number, seed in enumerate(SEEDS[name]()):
        (corpus / str(number)).write_bytes(seed)

    def one(data: bytes) -> None:
        try:
            target(data)
        except ModelgenError as error:
            assert all(problem.what and problem.remedy for problem in error.problems)
            assert str(error)

    warnings.simplefilter("error")
    atheris.Setup([*sys.argv, str(corpus)], one)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
