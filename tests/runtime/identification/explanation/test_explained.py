"""Which of two estimates of the same records is more likely."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modelgen.runtime.identification.explanation.explained import gained, run_method
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


def test_what_encoders_make_of_motions_that_hardly_differ_decides_nothing() -> None:
    records = [rounded(record) for record in two_mass_records()]
    begun = run_method(prepared(SMALL, records, Auto(), Filters(), CheckOptions()), IV())
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
