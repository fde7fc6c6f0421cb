"""The same estimate where rows are made again as where they are kept; and what other methods need is told."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from modelgen.errors import DataError
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.options import values_of
from modelgen.runtime.records.record import Record
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.rows.remade_rows import ChunkWindow
from modelgen.runtime.rows.row_block import DrawnBlock
from tests.runtime.identification.test_one_road import (
    bench,
    experiment,
    in_files,
    in_small_chunks,
    outcome,
    same,
)

LITTLE = 1e-3


@pytest.fixture
def made_again(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How often chunks were made again; whoever asks for rows whole is refused."""
    made: list[int] = []
    before = ChunkWindow.__getitem__

    def counted(self: ChunkWindow[Any], number: int) -> Any:
        made.append(number)
        return before(self, number)

    def refused(self: DrawnBlock) -> Any:
        assert self.in_memory, "all rows were asked for at a time"
        return whole(self)

    whole = DrawnBlock._whole
    monkeypatch.setattr(ChunkWindow, "__getitem__", counted)
    monkeypatch.setattr(DrawnBlock, "_whole", refused)
    return made


@pytest.mark.parametrize(
    "seed", [*range(8), *(pytest.param(k, marks=pytest.mark.slow) for k in range(8, 50))]
)
def test_rows_made_again_change_nothing(
    seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, made_again: list[int]
) -> None:
    model, records = experiment(seed)
    expected = outcome(model, records, method="wls")
    assert not made_again
    in_small_chunks(monkeypatch, int(np.random.default_rng(seed).integers(200, 1500)), 1 + seed % 3)
    sources = [in_files(record, tmp_path / record.name) for record in records]
    same(outcome(model, sources, method="wls", memory_limit_mb=LITTLE), expected)
    assert len(set(made_again)) > 1 or isinstance(expected, str)


@pytest.mark.parametrize(
    "options",
    [
        {"hold_out": 0.2},
        {"bounds": "physical"},
        {"scan_cutoffs": "auto"},
        {"drift_check": False, "drop": 300},
        {"rows_for_tag": "pham2002"},
        {"keep": ["F_vm"], "prune_percent": 1.0},
    ],
    ids=str,
)
def test_nor_with_options(options: dict[str, Any], made_again: list[int]) -> None:
    model, records = bench()
    expected = outcome(model, records, method="wls", **options)
    same(outcome(model, records, method="wls", memory_limit_mb=LITTLE, **options), expected)
    assert made_again


@pytest.mark.slow
def test_periodic_records_and_wide_chains(monkeypatch: pytest.MonkeyPatch, made_again: list[int]) -> None:
    model, records = bench()
    again = [Record({k: np.tile(v[:2500], 8) for k, v in r.signals.items()}, r.fs, r.name) for r in records]
    expected = outcome(model, again, method="wls")
    assert isinstance(expected, Estimate)
    monkeypatch.setattr("modelgen.runtime.rows.observation.WIDE", 1)
    same(outcome(model, again, method="wls", memory_limit_mb=LITTLE), expected)
    assert made_again


@pytest.mark.slow
def test_a_limit_that_is_not_reached_changes_nothing(made_again: list[int]) -> None:
    model, records = bench()
    expected, found = (
        identify(model, records, **values_of(memory_limit_mb=limit)) for limit in (None, 1000.0)
    )
    assert found.to_json() == expected.to_json()
    assert not made_again


def test_the_default_is_least_squares_where_instruments_do_not_fit(made_again: list[int]) -> None:
    model, records = bench()
    found = identify(model, records, **values_of(memory_limit_mb=LITTLE))
    assert found.fit.method == "wls"
    assert any("memory_limit_mb" in note for note in found.fit.notes)
    assert made_again
    truth = model.parameter_sets["table_2"]
    for entry in found.parameters.identified:
        assert abs(entry.value - truth[entry.name]) < 5.0 * entry.std


@pytest.mark.slow
@pytest.mark.parametrize(
    "options",
    [
        {"method": "iv"},
        {"method": "tls"},
        {"method": "pham2002"},
        {"method": "wls", "robust": "huber"},
        {"method": "wls", "delays": "estimate"},
    ],
    ids=str,
)
@pytest.mark.parametrize("decimation", [None, 1])
def test_other_methods_say_what_they_need_and_what_fits(
    options: dict[str, Any], decimation: int | None
) -> None:
    model, records = bench()
    with pytest.raises(DataError, match="memory_limit_mb: is 2, and method") as told:
        identify(model, records, **values_of(memory_limit_mb=2.0, decimation=decimation, **options))
    (problem,) = told.value.problems
    for way in problem.remedy.split(", or "):
        fits = {**options, "memory_limit_mb": 2.0, "decimation": decimation}
        given = records
        if way.startswith("give decimation="):
            fits["decimation"] = int(way.removeprefix("give decimation="))
        elif way.startswith("cut the records to "):
            share = int(way.split()[4]) / sum(record.n for record in records)
            given = [record.part(0, int(share * record.n), record.name) for record in records]
        elif way.startswith("use method wls"):
            fits["method"] = "wls"
        elif way.startswith("raise it to "):
            fits["memory_limit_mb"] = float(way.removeprefix("raise it to "))
        else:
            assert way == "leave out robust weights and delays to estimate"
            fits = {"method": "wls", "memory_limit_mb": 2.0, "decimation": decimation}
        assert isinstance(outcome(model, given, **fits), Estimate)


def test_the_residual_was_not_kept() -> None:
    model, records = bench()
    found = identify(model, records, **values_of("wls", memory_limit_mb=LITTLE))
    assert found.nobs == identify(model, records, "wls").nobs
    with pytest.raises(DataError, match="resid: was not kept"):
        _ = found.resid


@pytest.mark.parametrize("limit", [0.0, -1.0, math.nan, math.inf, True, "64"])
def test_a_limit_that_is_none_is_refused(limit: Any) -> None:
    model, records = bench()
    with pytest.raises(DataError, match=r"memory_limit_mb: is .*give a number of MB above 0"):
        identify(model, records, **values_of(memory_limit_mb=limit))
