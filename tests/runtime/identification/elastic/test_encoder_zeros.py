"""Zeros between encoders of motor and link, in every record another: they move no parameter."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen import CheckOptions, Record, identify
from modelgen.errors import IdentifiabilityError
from modelgen.runtime.identification.elastic.channel_errors import set_right
from modelgen.runtime.identification.elastic.encoder_zeros import (
    deflecting,
    encoder_zeros,
    of_other_records,
    zeros_at_mean,
)
from modelgen.runtime.iv.model_errors import delay_effect
from tests.runtime.identification.elastic.test_channels_set_right import (
    FS,
    errors,
    exact_channels,
    made,
    told,
)
from tests.symbolic.arms.elastic_arms import two_link, with_sensors
from tests.symbolic.arms.test_elastic_rows import both

MOTOR, OTHER = "motor_position_1", "motor_position_2"


def test_encoders_of_both_sides_have_a_zero_between_them_in_each_record() -> None:
    model = made()[0]
    assert deflecting(model) == (MOTOR, OTHER)
    names = [one.name for one in encoder_zeros(model, 2)]
    assert names == [f"zero of {key} in record {index}" for key in (MOTOR, OTHER) for index in (1, 2)]
    assert {one.words for one in encoder_zeros(model, 2)} == {
        f"{key} has a zero of its own" for key in (MOTOR, OTHER)
    }
    assert list(encoder_zeros(made(("motor",))[0], 2)) == []


@pytest.mark.slow
def test_zeros_of_torque_sensors_leave_the_estimate_as_it_is() -> None:
    """Offsets of drives took up what zeros read, 0.2 and 0.3 N m, and moments of links the rest."""
    spec = with_sensors(two_link(), *both("motor"), *both("link"), *both("between", "torque"))
    model, read, truth = exact_channels(spec, np.random.default_rng(3))
    torques = [key for key in model.channels if key.startswith("between_torque")]
    assert [one.channel for one in encoder_zeros(model, 1)] == sorted((*torques, MOTOR, OTHER))
    rng, sizes = np.random.default_rng(4), {"motor": 5e-6, "link": 5e-6, "tau": 0.05, "between": 0.05}
    noisy = {key: x + sizes[key.split("_")[0]] * rng.standard_normal(len(x)) for key, x in read.items()}
    off = noisy | {torques[0]: noisy[torques[0]] + 0.3, torques[1]: noisy[torques[1]] - 0.2}
    plain, found = (identify(model, Record(one, FS, "arm")) for one in (noisy, off))
    assert np.max(np.abs(errors(found, truth))) < 3.5
    for name, value in plain.params.items():
        assert abs(found.params[name] - value) < 0.3 * plain.bse[name], name


def test_records_that_were_held_out_have_the_mean_of_the_zeros() -> None:
    zeros, late = tuple(encoder_zeros(made()[0], 2)), delay_effect("tau_1")
    found = of_other_records({**dict(zip(zeros, (1.0, 3.0, 0.5, 0.5), strict=True)), late: 1e-3})
    assert {one.name: size for one, size in found.items()} == {
        late.name: 1e-3,
        f"zero of {MOTOR}": 2.0,
        f"zero of {OTHER}": 0.5,
    }
    assert all(one.record is None for one in found)


@pytest.mark.slow
@pytest.mark.parametrize("size", [2e-6, 2e-5, 2e-3, 0.3])
def test_zeros_of_any_size_leave_the_estimate_as_it_is(size: float) -> None:
    """Of 2e-6 rad moments of links were up to 9 deviations off, and gravity was said to be askew."""
    model, read, truth = made()
    n = len(read["tau_1"]) // 2
    records = []
    for index, (own, other) in enumerate(((1.0, -1.0), (-0.5, 0.7))):
        part = {key: samples[index * n :][:n] for key, samples in read.items()}
        part |= {MOTOR: part[MOTOR] + 30.0 * size * own, OTHER: part[OTHER] + 30.0 * size * other}
        records.append(Record(part, FS, f"part {index}"))
    options = CheckOptions(tests=True)
    found = identify(model, records, checks=options)
    assert np.max(np.abs(errors(found, truth))) < 3.5
    assert all("zero of its own" in said for said in told(found))
    plain = [Record({key: read[key][i * n :][:n] for key in read}, FS, f"part {i}") for i in range(2)]
    same = identify(model, plain, checks=options)
    for name, value in same.params.items():
        assert abs(found.params[name] - value) < 0.3 * same.bse[name], name
        assert found.bse[name] == pytest.approx(same.bse[name], rel=0.2), name


@pytest.mark.slow
def test_held_out_records_are_set_right_as_well() -> None:
    model, read, _ = made()
    n = len(read["tau_1"]) // 2
    parts = [
        Record({k: v[i * n :][:n] + 0.3 * (k == MOTOR) for k, v in read.items()}, FS, f"part {i}")
        for i in range(2)
    ]
    found = identify(model, parts, checks=CheckOptions(hold_out="part 1"))
    held = found.checks.held_out
    assert held is not None
    assert all(row.relative_error < 2.0 * (row.fitted_error or 0.0) for row in held.rows)


def test_springs_are_undeflected_on_average_without_the_zeros_that_say_so() -> None:
    model, read, _ = made()
    given = Record(read | {MOTOR: read[MOTOR] + 9.0}, FS, "arm")
    zeros = zeros_at_mean(model, given, 0, 1)
    assert {one.name for one in zeros} == {one.name for one in encoder_zeros(model, 1)}
    again = zeros_at_mean(model, set_right(model, given, 0, zeros), 0, 1)
    assert max(abs(size) for size in again.values()) < 1e-12
    (by_zero,) = (one for one in zeros if one.channel == MOTOR)
    plain = zeros_at_mean(model, Record(read, FS, "arm"), 0, 1)
    assert zeros[by_zero] == pytest.approx(9.0 + next(s for o, s in plain.items() if o.channel == MOTOR))


@pytest.mark.slow
@pytest.mark.parametrize("side", ["link", "motor"])
def test_encoders_of_two_joints_that_are_swapped_are_named(side: str) -> None:
    """Zeros of the channels as given were set right before: beside these no exchange explained anything.

    Of motors that are swapped all else is refused: noise was said to hide the motion.
    """
    model, read, _ = made()
    one, other = f"{side}_position_1", f"{side}_position_2"
    record = Record(read | {one: read[other], other: read[one]}, FS, "arm")
    if side == "motor":
        with pytest.raises(IdentifiabilityError, match="may be swapped with each other") as refused:
            identify(model, record)
        (where,) = (problem.where for problem in refused.value.problems)
    else:
        (where,) = (said.where for said in identify(model, record).checks.advice if said.kind == "swapped")
    assert f"channel {one} and {other}," in where
