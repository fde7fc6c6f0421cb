"""Steps of placements: rows of Khalil and Kleinfinger, origins of URDF, ways back, and what is simplified."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from modelgen.spec.arms.angles import angle_of, read_angle
from modelgen.spec.arms.arm import Length, Shift, Step, Turn
from modelgen.spec.arms.lengths import read_length
from modelgen.spec.arms.load import parse_arm
from modelgen.spec.arms.placements import (
    inverse,
    origin_placement,
    rotation_of,
    row_placement,
    simplified,
)
from tests.spec.arms.rigid_bodies import transform

LENGTHS = {"L": 0.7, "H": -0.3}


def matrix(steps: tuple[Step, ...] | list[Step]) -> np.ndarray:
    result = np.eye(4)
    for step in steps:
        result = result @ transform(step, LENGTHS)
    return result


@pytest.mark.parametrize("seed", range(10))
def test_a_row_is_that_of_khalil_and_kleinfinger(seed: int) -> None:
    rng = np.random.default_rng(seed)
    names = ("gamma", "alpha", "theta", "b", "d", "r")
    values = dict(zip(names, [*rng.choice([0, 90, -90, 30, 123.4], 3), *rng.uniform(-1, 1, 3)], strict=True))
    steps = row_placement(
        {n: (read_angle if n in names[:3] else read_length)(float(v)) for n, v in values.items()}
    )
    g, a, t = np.radians([values[n] for n in names[:3]])
    b, d, r = (values[n] for n in names[3:])
    # Khalil and Dombre, eq. (7.13): the frame of a joint behind a branch
    cg, sg, ca, sa, ct, st = (f(angle) for angle in (g, a, t) for f in (np.cos, np.sin))
    expected = [
        [cg * ct - sg * ca * st, -cg * st - sg * ca * ct, sg * sa, d * cg + r * sg * sa],
        [sg * ct + cg * ca * st, -sg * st + cg * ca * ct, -cg * sa, d * sg - r * cg * sa],
        [sa * st, sa * ct, ca, r * ca + b],
        [0, 0, 0, 1],
    ]
    np.testing.assert_allclose(matrix(steps), expected, atol=1e-14)


@pytest.mark.parametrize("seed", range(10))
def test_an_origin_is_that_of_urdf(seed: int) -> None:
    rng = np.random.default_rng(seed)
    xyz, rpy = rng.uniform(-1, 1, 3), rng.choice([0, 90, 180, -90, 20.5, -77], 3)
    steps = origin_placement([read_length(float(x)) for x in xyz], [read_angle(float(a)) for a in rpy])
    np.testing.assert_allclose(matrix(steps)[:3, 3], xyz, atol=1e-15)
    expected = Rotation.from_euler("xyz", rpy, degrees=True).as_matrix()
    np.testing.assert_allclose(matrix(steps)[:3, :3], expected, atol=1e-14)
    exact = np.array([[float(entry) for entry in row] for row in rotation_of(steps)])
    np.testing.assert_allclose(exact, expected, atol=1e-14)


def random_steps(seed: int) -> list[Step]:
    rng = np.random.default_rng(seed)
    steps: list[Step] = []
    for _ in range(12):
        axis = int(rng.integers(3))
        if rng.random() < 0.5:
            steps.append(Turn(axis, angle_of(Fraction(int(rng.choice([0, 90, -90, 180, 33]))))))
        else:
            name = rng.choice(["", "L", "H"])
            steps.append(Shift(axis, Length(Fraction(int(rng.integers(-2, 3))), str(name) or None)))
    return steps


@pytest.mark.parametrize("seed", range(20))
def test_simplified_is_the_same_motion_and_its_inverse_undoes_it(seed: int) -> None:
    steps = random_steps(seed)
    short = simplified(steps)
    assert len(short) <= len(steps)
    np.testing.assert_allclose(matrix(short), matrix(steps), atol=1e-13)
    np.testing.assert_allclose(matrix(short) @ matrix(inverse(short)), np.eye(4), atol=1e-13)
    assert simplified([*steps, *inverse(steps)]) == ()  # exactly: fractions cancel


def test_rows_and_placements_of_one_file_describe_the_same_arm() -> None:
    head = '[arm]\nname = "a"\n[[joints]]\nname = "1"\n'
    rows = parse_arm(head + 'alpha = -90\nd = "L"\nr = 0.2\n[lengths]\nL = 0.7\n', "a.toml")
    origin = parse_arm(head + 'xyz = ["L", 0.2, 0]\nrpy = [-90, 0, 0]\n[lengths]\nL = 0.7\n', "a.toml")
    np.testing.assert_allclose(
        matrix(rows.joints[0].placement), matrix(origin.joints[0].placement), atol=1e-15
    )
