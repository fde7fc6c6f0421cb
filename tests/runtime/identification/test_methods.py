from __future__ import annotations

import numpy as np
import pytest

from generated import emps_rigid_qm
from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.identification import job as module
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import METHODS
from modelgen.runtime.least_squares.wls import fit_matched
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.records.record import Record
from tests.runtime.two_mass_records import SMALL, two_mass_records

RIGID = model_from_module(emps_rigid_qm)


def test_all_methods_take_a_job_to_rows_and_their_fit() -> None:
    t = np.arange(6000) / 1000.0
    speed, acceleration = np.cos(5.0 * t), -5.0 * np.sin(5.0 * t)
    force = 95.0 * acceleration + 200.0 * speed + 20.0 * np.sign(speed) - 3.0
    record = Record({"q_m": np.sin(5.0 * t) / 5.0, "F": force}, 1000.0, "swing", "swing")
    choice = choose_filter(RIGID, [record], cutoff_hz=40.0, direction_cutoff_hz=30.0)
    assert list(METHODS) == ["auto", "wls", "iv", "tls", "pham2002"]
    # the paper keeps what its filters leave at both ends
    for method, tolerance in zip(METHODS.values(), (1e-2, 1e-2, 1e-2, 1e-2, 0.1), strict=True):
        observation, fit = method.run(Job(RIGID, (record,), choice, rows_for_tag={"swing": ["m"]}))
        assert observation.columns == RIGID.base_parameters
        np.testing.assert_allclose(fit.solution.x[:2], [95.0, 200.0], rtol=tolerance)


@pytest.mark.parametrize(("samples", "looked"), [(0.0, False), (20.0, True)])
def test_no_large_delay_is_looked_for_where_rows_leave_noise(
    samples: float, looked: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of moves that hardly stand out of an encoder's steps 15 ms left half as much, 8 deviations off."""
    records = tuple(two_mass_records(late={"Gamma_m": samples}))
    job = Job(SMALL, records, choose_filter(SMALL, records), late=("Gamma_m",))
    monkeypatch.setattr(module, "coarse_delays", lambda *_: {"Gamma_m": 0.015})
    begun = job._first_delays(fit_matched(job.calm(records)))
    assert begun == {"Gamma_m": 0.015 if looked else 0.0}
