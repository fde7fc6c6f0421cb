"""Columns of payloads: as many as their link's, whatever the arm, and independent of all others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from modelgen.spec.arms.arm import LINK_PARAMETERS, Payload
from modelgen.spec.arms.parameters import link_names
from modelgen.symbolic.arms.arm_rows import arm_rows
from modelgen.symbolic.arms.base_parameters import arm_base_model
from tests.runtime.made_arm_records import catalogued
from tests.symbolic.arms.numerical_rank import numerical_rank
from tests.symbolic.arms.regressor_samples import random_regressor


# lengths of scara are symbols, links of two_link turn about one direction
@pytest.mark.parametrize("name", ["two_link", "scara", "puma560"])
@pytest.mark.parametrize("place", [0, 1, -1])
@pytest.mark.parametrize("base_rows", [False, True])
def test_the_payload_of_any_link_is_told_from_the_arm(name: str, place: int, base_rows: bool) -> None:
    arm = catalogued(name)
    joint = arm.joints[place].name
    carried = replace(arm, payloads=(Payload("disc", joint, link_names("disc")),))
    rows = arm_rows(carried, base_rows=base_rows)
    found = arm_base_model(rows)
    own = [one for one in found.base if one.name.partition(" ")[0].endswith("_disc")]
    others = [one.name for one in found.base if one not in own]
    assert others == [one.name for one in arm_base_model(arm_rows(arm, base_rows=base_rows)).base]
    assert len(found.base) == numerical_rank(rows)
    regressor = random_regressor(rows, {name: value or 1.0 for name, value in arm.lengths.items()})
    link = regressor[:, [rows.columns.index(f"{kind}_{joint}") for kind in LINK_PARAMETERS]]
    assert len(own) == np.linalg.matrix_rank(link, tol=1e-9 * np.abs(link).max() * len(link))


def test_two_payloads_of_one_link_and_a_weighed_one() -> None:
    arm = catalogued("puma560")
    pair = tuple(Payload(name, arm.joints[-1].name, link_names(name)) for name in ("disc", "tool"))
    rows = arm_rows(replace(arm, payloads=pair, known={"m_disc": 4.6}))
    names = [one.name for one in arm_base_model(rows).base]
    assert "m_tool" in names and "m_disc" not in names
    assert len(names) == numerical_rank(rows)
