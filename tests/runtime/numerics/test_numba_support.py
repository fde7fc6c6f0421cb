"""Kept machine code: it gives what the first process gave, and needs less of numba."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("numba")

SOURCE = """
def total(values):
    found = 0.0
    for value in values:
        found += value
    return found
"""
CALLED = """
import sys
import numpy as np
from numba import njit
from total import total
from modelgen.runtime.numerics.numba_support import kept_code
print(kept_code(njit, total)(np.arange(5.0)), "numba.typed.typeddict" in sys.modules)
"""


@pytest.mark.slow
def test_kept_code_is_loaded_without_what_compiling_needs(tmp_path: Path) -> None:
    (tmp_path / "total.py").write_text(SOURCE)
    path = os.pathsep.join([str(tmp_path), *filter(None, sys.path)])
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "kept"), "PYTHONPATH": path}
    command = [sys.executable, "-c", CALLED]
    said = [subprocess.check_output(command, env=environment, text=True) for _ in range(2)]
    assert said == ["10.0 True\n", "10.0 False\n"]
