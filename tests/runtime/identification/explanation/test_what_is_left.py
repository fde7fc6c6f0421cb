"""Which of two estimates of the same records is more likely."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from modelgen.runtime.identification.explanation.explained import Begun, run_method
from modelgen.runtime.identification.explanation.what_is_left import gained, on_common_samples
from modelgen.runtime.identification.methods import IV, Auto
from modelgen.runtime.identification.options import CheckOptions, Filters
from modelgen.runtime.identification.task import prepared
from modelgen.runtime.records.record import Record
from tests.runtime.two_mass_records import SMALL, two_mass_records

STEP = 2.0 * np.pi / 16384


def rounded(record: Record) -> Record:
    read = {key: STEP * np.round(samples / STEP) if key[0] == "q" else samples
            for key, samples in record.signals.items()}  # fmt: skip
    return Record(read, record.fs, record.name)


def instruments(records: list[Record]) -> Begun:
    return run_method(prepared(SMALL, records, Auto(), Filters(), CheckOptions()), IV())


def test_samples_that_one_of_two_leaves_out_are_no_evidence() -> None:
    begun = instruments(list(two_mass_records()))
    fit = begun.found.fit
    block, *others = fit.blocks
    marked = np.arange(block.grid) % 3 == 0
    less = replace(
        fit,
        blocks=(block.without(marked), *others),
        residuals=(fit.residuals[0][~marked[block.place]], *fit.residuals[1:]),
    )
    assert abs(less.misfit - fit.misfit) > 100.0
    both = on_common_samples([fit, less])
    assert [one.misfit for one in both] == pytest.approx([less.misfit] * 2, abs=1e-6)
    # a record that only one of them uses says nothing, either
    fewer = replace(less, blocks=less.blocks[:1], residuals=less.residuals[:1], weights=less.weights[:1])
    both = on_common_samples([fit, fewer])
    assert both[0].misfit == pytest.approx(both[1].misfit, abs=1e-6)
    other = replace(begun, found=replace(begun.found, fit=less))
    assert gained(begun, other) == pytest.approx(0.0, abs=1e-6)


def test_what_encoders_make_of_motions_that_hardly_differ_decides_nothing() -> None:
    begun = instruments([rounded(record) for record in two_mass_records()])
    fit = begun.found.fit
    assert fit.simulated
    # by a third of a step: what is rounded differs everywhere
    moved = {
        index: Record({k: s + STEP / 3.0 if k[0] == "q" else s for k, s in one.signals.items()}, one.fs, "m")
        for index, one in fit.simulated.items()
    }
    other = replace(begun, found=replace(begun.found, fit=replace(fit, simulated=moved)))
    assert gained(begun, other) == 0.0
    assert gained(other, begun) == 0.0
