from __future__ import annotations

import csv
import random
from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from modelgen.errors import ModelError
from modelgen.spec.arms.arm import Angle, ArmSpec, Turn
from modelgen.spec.arms.load import parse_arm
from modelgen.symbolic.arms.arm_rows import ArmRows, arm_rows
from modelgen.symbolic.arms.base_parameters import (
    ArmBaseModel,
    arm_base_model,
    dependencies,
)
from modelgen.symbolic.arms.unseen_changes import unseen_changes
from tests.symbolic.arms.made_arms import (
    PLANAR,
    PUMA,
    ROBOTS,
    SCARA,
    arm,
    dh,
    joint,
    link_names,
    random_arm,
    serial,
    tx40,
)
from tests.symbolic.arms.numerical_rank import numerical_rank
from tests.symbolic.arms.regressor_samples import random_regressor

PUBLISHED = Path(__file__).resolve().parents[4] / "shared" / "data" / "tx40" / "TX40_bp_5.csv"
#: base inertial parameters as the literature counts them
COUNTS = {"scara": 8, "puma": 36, "rx90": 36, "ur10": 36, "panda": 43, "lwr": 43}


@pytest.mark.parametrize(("spec", "count"), [(PLANAR[2], 6), (PLANAR[3], 9)])
def test_planar_arms(spec: ArmSpec, count: int) -> None:
    assert len(arm_base_model(arm_rows(spec)).base) == count


@pytest.mark.parametrize(("name", "count"), COUNTS.items())
def test_counts_of_known_robots(name: str, count: int) -> None:
    rows = arm_rows(serial(ROBOTS[name]))
    assert len(arm_base_model(rows).base) == count == numerical_rank(rows)
    if count > 30:  # with the base's wrench five more
        rows = arm_rows(serial(ROBOTS[name]), base_rows=True)
        assert len(arm_base_model(rows).base) == count + 5 == numerical_rank(rows)


def reproduces(model: ArmBaseModel, lengths: Mapping[str, float]) -> None:
    """Check that the base parameters give the same rows as all parameters, whatever these are."""
    regressor = random_regressor(model.rows, lengths, seed=7)
    values = dict(zip(model.rows.columns, np.random.default_rng(8).standard_normal(regressor.shape[1]),
                      strict=True))  # fmt: skip
    left = [k for k, name in enumerate(model.rows.columns) if name not in model.rows.spec.known]
    wanted = regressor[:, left] @ [values[model.rows.columns[k]] for k in left]
    base = [sum(f * values[name] for name, f in b.factors(lengths).items()) for b in model.base]
    found = regressor[:, list(model.columns)] @ base
    np.testing.assert_allclose(found, wanted, atol=1e-10 * np.abs(wanted).max())


def coupled(rng: random.Random, spec: ArmSpec) -> ArmSpec:
    """Return the arm with random couplings and some known parameters."""
    count = len(spec.moving)
    while True:
        matrix = [[Fraction(rng.choice([0, 0, 0, 1, -2, 30])) for _ in range(count)] for _ in range(count)]
        if np.linalg.matrix_rank(np.array(matrix, dtype=float)) == count:
            break
    names = arm_rows(spec).columns
    known = {name: 0.5 for name in rng.sample(names, k=len(names) // 5)}
    return replace(spec, transmission=tuple(map(tuple, matrix)), known=known)


@pytest.mark.parametrize("seed", range(60))
def test_random_arms_are_regrouped_exactly(seed: int) -> None:
    # what `arm_base_model` returns is proven modulo a prime; here by other means, in floating point
    rng = random.Random(seed)
    spec = random_arm(rng)
    if seed % 3 == 0:
        spec = coupled(rng, spec)
    rows = arm_rows(spec, base_rows=rng.random() < 0.3)
    try:
        model = arm_base_model(rows)
    except ModelError as error:
        assert "no parameter is left" in str(error)
        assert numerical_rank(rows) == 0
        return
    assert len(model.base) == numerical_rank(rows)
    reproduces(model, {})
    wanted = [name for name in rows.columns if name not in spec.known]
    assert set(model.identifiable) | set(model.absent) == set(wanted)
    assert not set(model.identifiable) & set(model.absent)


@pytest.mark.parametrize("kind", ["joint", "motor"])
def test_two_motors_on_two_joints_share_their_inertias(kind: str) -> None:
    # both motors move both joints: the sum of both inertias acts on each, their difference between them
    spec = serial(PUMA[:2], drive=True)
    spec = replace(spec, transmission=((Fraction(1), Fraction(1)), (Fraction(1), Fraction(-1))))
    model = arm_base_model(arm_rows(spec, kind))  # type: ignore[arg-type]
    assert "only in combination" in model.absent["Ia2_motor"]
    assert len(model.base) == numerical_rank(model.rows)
    reproduces(model, {})


def parsed(text: str) -> dict[str, float]:
    found = {}
    for part in text.replace("- ", "+ -").split("+"):
        factor, _, name = part.strip().lstrip("-").rpartition("*")
        found[name] = float(factor or 1) * (-1 if part.strip().startswith("-") else 1)
    return found


def test_tx40_has_the_published_groupings_and_one_more() -> None:
    if not PUBLISHED.exists():
        pytest.skip(f"{PUBLISHED} is absent: published base parameters of the TX40")
    model = arm_base_model(arm_rows(tx40()))
    ours = {b.combination[0][0]: b.factors({}) for b in model.base}
    motor = {"Iam6": "Ia6_motor", "fvm6": "fv6_motor", "fsm6": "fs6_motor"}
    published = [parsed(row[0]) for row in csv.reader(PUBLISHED.read_text().splitlines())]
    assert len(published) == 60 and len(ours) == 61 == numerical_rank(model.rows)
    for grouping in published:
        named = {motor.get(name, name): factor for name, factor in grouping.items()}
        assert ours.pop(next(iter(named))) == pytest.approx(named, abs=1e-12)
    assert list(ours) == ["Ia6"]


SYMBOLIC = [(0, 0, 0, 0), (-90, 0, 0, "r2"), (0, "d3", 0, "-r3"), (90, "-d4", 0, "r4"), (-90, 0, 0, 0),
            (90, 0, 0, 0)]  # fmt: skip


def test_named_lengths_stand_in_the_formulas() -> None:
    model = arm_base_model(arm_rows(serial(SYMBOLIC, lengths=dict.fromkeys(("r2", "d3", "r3", "d4", "r4")))))
    names = [b.name for b in model.base]
    assert names[1] == "Ixx2 - Iyy2 - d3**2*m3 - d3**2*m4 - d3**2*m5 - d3**2*m6"
    assert "my3 - mz4 - r4*m4 - r4*m5 - r4*m6" in names
    assert names[0].startswith("Izz1 + Iyy2 + 2*r2*mz2 + r2**2*m2 + Iyy3 + (2*r2 - 2*r3)*mz3 + ")
    numbers = {"r2": 0.2435, "d3": 0.4318, "r3": 0.0934, "d4": 0.0203, "r4": 0.4331}
    plain = arm_base_model(arm_rows(serial(PUMA)))
    for symbolic, number in zip(model.base, plain.base, strict=True):
        assert symbolic.factors(numbers) == pytest.approx(number.factors({}), abs=1e-15)
    reproduces(model, numbers)


def test_lengths_that_are_zero_or_equal_belong_into_the_rows_as_numbers() -> None:
    # about one vertical axis: the second link's first moments show only where the axes lie apart
    apart = [(0, 0, 0, 0), (0, "d2", 0, 0), (0, "-d3", 0, 0)]
    wide = arm_base_model(arm_rows(serial(apart, lengths={"d2": 0.4, "d3": 0.3})))
    assert wide.columns == arm_base_model(arm_rows(serial(apart, lengths={"d2": None, "d3": None}))).columns
    with pytest.raises(ModelError, match="more columns depend on others"):
        arm_base_model(arm_rows(serial(apart, lengths={"d2": 0.0, "d3": 0.3})))


@pytest.mark.parametrize("coupling", [(2, 1, 3), (3, 1, -2), (3, 2, 1)])
def test_a_coupled_rotor_turns_as_a_link_does(
    coupling: tuple[int, int, int],
) -> None:
    """A motor on the base that moves a parallelogram: its inertia is one with that of the link it turns."""
    joints = "".join(f'[[joints]]\nname = "{k}"\nd = "L{k}"\n' for k in (1, 2, 3))
    lengths = "[lengths]\nL1 = 0.3\nL2 = 0.4\nL3 = 0.5\n"
    motor, joint, ratio = coupling
    couplings = f'[[couplings]]\nmotor = "{motor}"\njoint = "{joint}"\nratio = {ratio}\n'
    head = '[arm]\nname = "p"\ngravity = [0, -9.81, 0]\ndrive = ["rotor_inertia", "viscous"]\n'
    named = arm_base_model(arm_rows(parse_arm(head + joints + couplings + lengths, "p.toml")))
    numbers = joints.replace('"L1"', "0.3").replace('"L2"', "0.4").replace('"L3"', "0.5")
    plain = arm_base_model(arm_rows(parse_arm(head + numbers + couplings, "p.toml")))
    assert named.columns == plain.columns
    assert len(named.columns) == numerical_rank(named.rows, {"L1": 0.3, "L2": 0.4, "L3": 0.5})


def test_a_slide_at_45_degrees_leaves_no_rounding_in_the_formulas() -> None:
    slide = '[[joints]]\nname = "s"\ntype = "prismatic"\nrpy = [0, 45, 0]\nxyz = [0.1, 0, 0]\n'
    head = '[arm]\nname = "p"\ngravity = [0, 0, -9.81]\n[[joints]]\nname = "1"\n'
    text = "; ".join(one.name for one in arm_base_model(arm_rows(parse_arm(head + slide, "p.toml"))).base)
    assert "e-" not in text and " 1*" not in text


def test_known_parameters_are_no_part_of_a_combination() -> None:
    spec = serial(PUMA, drive=True)
    payload = link_names("6")
    model = arm_base_model(arm_rows(replace(spec, known=dict.fromkeys(payload, 0.1))))
    assert not any(name in payload for b in model.base for name, _ in b.combination)
    assert not set(payload) & {*model.identifiable, *model.absent}
    reproduces(model, {})
    rows = arm_rows(spec)
    with pytest.raises(ModelError, match="no parameter is left"):
        arm_base_model(replace(rows, spec=replace(spec, known=dict.fromkeys(rows.columns, 1.0))))


def test_a_fixed_link_is_regrouped_into_its_parent() -> None:
    tool = joint("tool", "2", dh(0, 0, 0, 0.1), "fixed")
    spec = serial(PUMA[:2])
    model = arm_base_model(arm_rows(replace(spec, joints=(*spec.joints, tool))))
    plain = arm_base_model(arm_rows(spec))
    assert [b.combination[0] for b in model.base] == [b.combination[0] for b in plain.base]
    assert model.base[-2].name == "mx2 + mxtool"
    reproduces(model, {})


@pytest.mark.parametrize("seed", range(12))
def test_what_the_closed_form_leaves_out_is_restored(seed: int) -> None:
    # short numbers, as fractions of 30 bits above and below the line come back from one residue
    rng = random.Random(seed)
    rows = arm_rows(
        serial(SCARA if seed % 2 else [(0, 0, 0, 0), (90, 0, 0, 0.5), (0, 0.5, 0, 0.2)], drive=True)
    )
    wanted = range(len(rows.columns))
    changes = list(unseen_changes(rows.spec, {}, False))
    exact = dependencies(rows, wanted)
    assert dependencies(rows, wanted, rng.sample(changes, k=len(changes) // 2)) == exact
    assert dependencies(rows, wanted, []) == exact


def test_a_wrong_change_is_never_believed() -> None:
    rows: ArmRows = arm_rows(serial(PUMA))
    changes = [*unseen_changes(rows.spec, {}, False), {("6", "mx"): Fraction(1)}]
    with pytest.raises(ModelError, match="no exact combination"):
        dependencies(rows, range(len(rows.columns)), changes)


def test_angles_too_small_for_double_precision_show_in_the_numerical_rank() -> None:
    # an axis 1e-10 rad from perpendicular: exact arithmetic tells rotor and link apart, numbers do not
    t = 1 + Fraction(1, 10**10)
    nearly = Turn(0, Angle((1 - t * t) / (1 + t * t), 2 * t / (1 + t * t), np.pi / 2 + 1e-10))
    rows = arm_rows(arm([joint("1", None, ()), joint("2", "1", (nearly,), drive=True)]))
    assert numerical_rank(rows) < len(arm_base_model(rows).base)
