from __future__ import annotations

from dataclasses import replace

import numpy as np

from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.parameters.parameter import Parameter
from modelgen.runtime.parameters.physical_parameters import Covariances
from modelgen.runtime.parameters.pruning import Pruning, PruningStep
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.results.estimate_parts import (
    EstimatedFit,
    EstimatedModel,
    EstimatedParameters,
    RowDiagnostics,
)
from modelgen.runtime.results.summary import summary_text

GOLDEN = """\
emps300, sensors qm_qc: wls (weighted least squares)
Records: chirp, rest

parameter  unit              value  std. dev.      %     95 % from            to     noise     drift  eq. (11)
--------------------------------------------------------------------------------------------------------------
J_m        kg m^2      9.87000e-06  1.000e-08  0.101   9.85040e-06   9.88960e-06  8.00e-09  6.00e-09  4.00e-09
F_vm       N m s/rad  -2.00000e-05  4.000e-06   20.0  -2.78399e-05  -1.21601e-05  4.00e-06         0  1.00e-06

Standard deviations add in squares: noise, allowing for coloured residuals of changing size
(Newey-West), and drift with cut-off and weights. Eq. (11) is for white residuals only.

physical  unit          value  std. dev.      %    95 % from           to
-------------------------------------------------------------------------
J_total   kg m^2  1.10000e-05  2.000e-08  0.182  1.09608e-05  1.10392e-05

Samples r = 1200, condition number 12.5000 with columns of unit length, inf as they are
Error norm 1.1456, relative error 3.1200 %, sigma 0.9000 over r - c
Delay of Gamma_m: 105.0 us

Not identifiable:
  O_m: the link m-c would carry 3.79e+03 on average in record chirp and no force there exceeds 23.5:
    the encoders' zeros are unrelated

record  row  unit  used  masked  weight  residual rms  error %
--------------------------------------------------------------
chirp   m    N m   1200      30   250.0      0.004000    2.000
rest    m    N m      0    1230       0             -        -
Errors in % of the row's force, or of its largest term where it holds none; the relative error above
is that of all rows together, weighted.

Without parameters of 10 % and more, largest first:
  F_vm (20 %) removed: relative error now 3.5000 %
  What is left: J_m 9.90000e-06 (0.11 %)

Filters:
  Cut-off 250 Hz.
  chirp: every 8th sample of 5000 Hz.

Notes:
  sampled slowly
  rest, row m: not used
"""

GOLDEN_PAPER = """\
emps300, sensors qm_qc: pham2002 (the paper)
Records: chirp, rest

parameter  unit              value  std. dev.      %     95 % from            to
--------------------------------------------------------------------------------
J_m        kg m^2      9.87000e-06  1.000e-08  0.101   9.85040e-06   9.88960e-06
F_vm       N m s/rad  -2.00000e-05  4.000e-06   20.0  -2.78399e-05  -1.21601e-05

Standard deviations and intervals are the paper's, eq. (11): for white residuals only.

Samples r = 1200, condition number 12.5000 with columns of unit length, inf as they are
Error norm 1.1456, relative error 3.1200 %, sigma 0.9000 over r - 1, not as in eq. (11)

record  row  unit  used  masked  weight  residual rms  error %
--------------------------------------------------------------
chirp   m    N m   1200      30   250.0      0.004000    2.000
rest    m    N m      0    1230       0             -        -
Errors in % of the row's force, or of its largest term where it holds none; the relative error above
is that of all rows together, weighted.

No parameter has a relative standard deviation of 10 % or more.

Filters:
  Cut-off 250 Hz.
  chirp: every 8th sample of 5000 Hz.
"""


def made_up() -> Estimate:
    """An estimate with something in every part of the summary."""
    reason = (
        "the link m-c would carry 3.79e+03 on average in record chirp and no force there exceeds 23.5: "
        "the encoders' zeros are unrelated"
    )
    sentences = ("Cut-off 250 Hz.", "chirp: every 8th sample of 5000 Hz.")
    fit = EstimatedFit(
        method="wls",
        method_title="weighted least squares",
        covariance_kind="hac",
        filtering=FilterChoice(4, 250.0, 172.5, (8, 4), 172.5, 29.0, (), sentences, ("sampled slowly",)),
        rows=(
            RowDiagnostics("chirp", "m", "N m", 1200, 30, 250.0, 0.004, 0.02),
            RowDiagnostics("rest", "m", "N m", 0, 1230, 0.0, None, None),
        ),
        residuals=((1.0, np.array([0.5, -0.25, 1.0])),),
        condition_number=12.5,
        condition_number_raw=float("inf"),
        relative_error=0.0312,
        error_norm=1.1456439,
        sigma=0.9,
        residual_dof="r-c",
        pruning=Pruning(10.0, 0.0312, (PruningStep("F_vm", 20.0, 0.035),), (("J_m", 9.9e-6, 0.11),)),
        delays={"Gamma_m": 1.05e-4},
        notes=("rest, row m: not used",),
    )
    return Estimate(
        EstimatedModel("emps300", "qm_qc", "An axis"),
        ("chirp", "rest"),
        fit,
        Covariances(np.eye(2), np.eye(2), np.eye(2), np.eye(2)),
        EstimatedParameters(
            (
                Parameter("J_m", "kg m^2", 9.87e-6, 1e-8, 8e-9, 6e-9, 4e-9),
                Parameter("F_vm", "N m s/rad", -2e-5, 4e-6, 4e-6, 0.0, 1e-6),
            ),
            (Parameter("J_total", "kg m^2", 1.1e-5, 2e-8, 1e-8, 1e-8, 1e-8),),
            np.array([9.87e-6, -2e-5, np.nan]),
            {"O_m": 0.25},
            {"O_m": reason},
        ),
    )


def test_everything_is_said() -> None:
    assert summary_text(made_up()) == GOLDEN


def test_physical_parameters_stand_in_for_composites_of_long_formulas() -> None:
    whole = made_up()
    model = replace(whole.model, composites={"F_vm": "J_m*J_c/K + " * 40})
    told = summary_text(replace(whole, model=model))
    assert "J_m  " in told.split("Standard deviations")[0]
    assert "F_vm" not in told.split("Standard deviations")[0]
    assert "Composites of them: F_vm; the physical parameters below say what they hold" in told
    assert "J_c/K" not in told
    alone = replace(whole, model=model, parameters=replace(whole.parameters, physical=()))
    told = summary_text(alone)
    assert "F_vm" in told.split("Standard deviations")[0]
    assert "F_vm; no physical parameter follows" in " ".join(told.split())
    assert replace(whole, model=model).to_dict()["composites"] == model.composites


def test_what_there_is_not_leaves_no_trace() -> None:
    whole = made_up()
    fit = replace(
        whole.fit,
        method="pham2002",
        method_title="the paper",
        covariance_kind="printed",
        residual_dof="r-1",
        delays={},
        pruning=replace(whole.fit.pruning, steps=()),
        filtering=replace(whole.fit.filtering, notes=()),
        notes=(),
    )
    known = whole.parameters
    parameters = replace(known, physical=known.identified, not_identifiable={}, nuisance={})
    paper = replace(whole, fit=fit, parameters=parameters)
    assert summary_text(paper) == GOLDEN_PAPER


def test_numbers_that_are_none_do_not_break_the_table() -> None:
    whole = made_up()
    strange = replace(whole.parameters.identified[0], value=0.0, std=float("nan"))
    parameters = replace(whole.parameters, identified=(strange,))
    text = summary_text(replace(whole, parameters=parameters))
    assert "nan" in text
    assert "inf" in text
