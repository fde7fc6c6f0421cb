"""Rows of arms as vectors over parameters and signals: entries are alike where they are the same function."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from functools import cache

from typer.testing import CliRunner

from modelgen.cli.formal_rows import formal_regressor
from modelgen.cli.main import app
from modelgen.runtime.model.model import Model
from modelgen.symbolic.compare import compare
from tests.runtime.made_arm_records import catalogued, model_of

RUN = CliRunner()


@cache
def scara(length: Fraction | None = None) -> Model:
    spec = catalogued("scara")
    return model_of(spec if length is None else replace(spec, lengths={**spec.lengths, "L1": length}))


def test_arms_are_equal_row_by_row_where_their_lengths_are() -> None:
    one = formal_regressor(scara(), "one")
    assert compare(one, formal_regressor(scara(), "other")).verdict == "equal"
    longer = compare(one, formal_regressor(scara(Fraction(1, 2)), "longer"))
    alike = {line for line in longer.lines if "not in" not in line}
    # the spindle's travel is the one that knows nothing of the upper arm
    assert alike == {"one, row 3: row 3 of longer", "longer, row 3: row 3 of one"}


def test_torques_behind_the_drives_are_not_those_of_the_drives() -> None:
    models = {
        name: model_of(catalogued("elastic_two_link"), sensor_set=name) for name in ("encoders", "torques")
    }
    formal = {name: formal_regressor(model, name) for name, model in models.items()}
    found = compare(formal["encoders"], formal["torques"]).lines
    assert "encoders, row 1 spring: a combination of rows of torques" in found
    assert "torques, row 1 link: not in encoders" in found


def test_compare_takes_files_of_arms() -> None:
    result = RUN.invoke(app, ["compare", "elastic_two_link"])
    assert result.exit_code == 0, result.output
    assert "elastic_two_link_encoders and elastic_two_link_torques: different" in result.output
    assert "--data" in result.output and "1/s^derivative" not in result.output
