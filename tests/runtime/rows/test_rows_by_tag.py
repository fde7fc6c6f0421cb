from __future__ import annotations

import pytest

from generated import emps300_qm_ac, emps300_qm_qc
from modelgen.errors import DataError
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.options import values_of
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.rows.rows_by_tag import rows_for_tags
from modelgen.runtime.simulation.simulate import simulate

QM_AC = model_from_module(emps300_qm_ac)
TRUTH = emps300_qm_ac.PARAMETER_SETS["light"]


def test_the_papers_pairing_of_qm_ac() -> None:
    assert rows_for_tags(QM_AC, "pham2002") == {"chirp": ["m", "c"], "trapezoid": ["m+c"]}


def test_models_without_differentiated_rows_need_no_pairing() -> None:
    assert rows_for_tags(model_from_module(emps300_qm_qc), "pham2002") is None


def test_one_setting_pairs_the_records_with_the_rows() -> None:
    records = [
        simulate(QM_AC, TRUTH, kind, fs=5000.0, duration_s=3.0).record for kind in ("chirp", "trapezoid")
    ]
    assert [record.tag for record in records] == ["chirp", "trapezoid"]
    estimate = identify(QM_AC, records, **values_of(rows_for_tag="pham2002", drift_check=False))
    assert [(row.record, row.row) for row in estimate.fit.rows] == [
        ("chirp", "m"),
        ("chirp", "c"),
        ("trapezoid", "m+c"),
    ]
    for name, value in TRUTH.items():
        assert estimate.params[name] == pytest.approx(value, rel=5e-3), name


def test_another_word_is_refused() -> None:
    record = simulate(QM_AC, TRUTH, "chirp", fs=5000.0, duration_s=2.0).record
    with pytest.raises(DataError, match="rows_for_tag: is 'paper'"):
        identify(QM_AC, record, **values_of(rows_for_tag="paper"))


def test_a_pairing_whose_tags_no_record_has_says_how_to_give_them() -> None:
    record = simulate(QM_AC, TRUTH, "chirp", fs=5000.0, duration_s=2.0).record
    with pytest.raises(DataError, match=r"no record has the tag 'trapezoid'; give it .*--tag .*=trapezoid\)"):
        identify(QM_AC, record, **values_of(rows_for_tag="pham2002"))
