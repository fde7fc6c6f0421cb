"""The entry point: how many threads BLAS gets."""

from __future__ import annotations

import os

import pytest

from modelgen.__main__ import BLAS_THREADS, use_one_blas_thread


@pytest.fixture(autouse=True)
def no_number(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in BLAS_THREADS:
        monkeypatch.setenv(name, "removed at the end of the test")
        monkeypatch.delenv(name)


def test_blas_gets_one_thread() -> None:
    use_one_blas_thread()
    assert os.environ["OPENBLAS_NUM_THREADS"] == os.environ["MKL_NUM_THREADS"] == "1"


@pytest.mark.parametrize("stated", BLAS_THREADS)
def test_a_number_in_the_environment_counts(stated: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(stated, "3")
    use_one_blas_thread()
    assert {name: os.environ.get(name) for name in BLAS_THREADS} == {
        name: "3" if name == stated else None for name in BLAS_THREADS
    }
