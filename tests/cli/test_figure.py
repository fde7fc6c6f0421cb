"""Pictures of measured and rebuilt forces: every format, the same bytes each time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from modelgen.cli.figure import forces_figure, write_picture
from modelgen.runtime.curves.rebuilt import Rebuilt

MAGIC = {".png": b"\x89PNG", ".svg": b"<?xml", ".pdf": b"%PDF"}


@pytest.mark.slow
@pytest.mark.parametrize("suffix", MAGIC)
def test_the_same_rows_give_the_same_bytes(tmp_path: Path, suffix: str) -> None:
    t = np.arange(200) / 100.0
    rows = [
        Rebuilt(f"run {k}", "m", "N m", 0.0, 0.01, np.sin(k * t), np.cos(k * t), 0, True) for k in (1, 2, 3)
    ]
    paths = [tmp_path / f"{name}{suffix}" for name in "ab"]
    for path in paths:
        write_picture(forces_figure(rows), path, overwrite=False)
    first, second = (path.read_bytes() for path in paths)
    assert first == second
    assert first.startswith(MAGIC[suffix])
