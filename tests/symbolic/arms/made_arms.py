"""Arms for tests, made by hand: known robots by their Denavit-Hartenberg rows, and random ones."""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from fractions import Fraction

from modelgen.spec.arms.arm import LINK_PARAMETERS, Angle, ArmSpec, Joint, Length, Shift, Step, Turn

DOWN = (Fraction(0), Fraction(0), Fraction("-9.81"))
#: cosine and sine of multiples of 90 degrees
QUARTERS = [(1, 0), (0, 1), (-1, 0), (0, -1)]
Size = float | str | int


def angle(degrees: float) -> Angle:
    """Return an exact angle: quarters are exact, others the rational point of the half-angle's tangent."""
    radians = math.radians(degrees)
    if degrees % 90 == 0:
        cosine, sine = QUARTERS[round(degrees / 90) % 4]
        return Angle(Fraction(cosine), Fraction(sine), radians)
    t = Fraction(math.tan(radians / 2)).limit_denominator(10**9)
    return Angle((1 - t * t) / (1 + t * t), 2 * t / (1 + t * t), radians)


def length(size: Size) -> Length:
    """Return a length; texts are names, with a minus sign in front or not."""
    if isinstance(size, str):
        return Length(Fraction(-1 if size.startswith("-") else 1), size.lstrip("-"))
    return Length(Fraction(str(size)))


def turn(axis: int, degrees: float) -> list[Step]:
    return [Turn(axis, angle(degrees))] if degrees else []


def shift(axis: int, size: Size) -> list[Step]:
    return [Shift(axis, length(size))] if size else []


def dh(alpha: float, d: Size, theta: float, r: Size) -> tuple[Step, ...]:
    """Return the steps of a modified Denavit-Hartenberg row: x alpha, x d, z theta, z r."""
    return (*turn(0, alpha), *shift(0, d), *turn(2, theta), *shift(2, r))


def placed(rpy: Sequence[float], xyz: Sequence[Size]) -> tuple[Step, ...]:
    """Return the steps of a placement as URDF has it: the translation, then yaw, pitch and roll."""
    steps: list[Step] = []
    for axis, size in enumerate(xyz):
        steps += shift(axis, size)
    for axis in (2, 1, 0):
        steps += turn(axis, rpy[axis])
    return tuple(steps)


def link_names(name: str) -> tuple[str, ...]:
    return tuple(f"{parameter}{name}" for parameter in LINK_PARAMETERS)


def joint(
    name: str, parent: str | None, steps: Sequence[Step], kind: str = "revolute", **options: object
) -> Joint:
    """Return a joint with all parameters of its link, and of its drive if `drive` is given."""
    names = {}
    if options.pop("drive", False):
        names = dict(zip(("rotor_inertia", "viscous", "coulomb", "offset"),
                         (f"{part}{name}" for part in ("Ia", "fv", "fs", "off")), strict=True))  # fmt: skip
    link = options.pop("link", link_names(name))
    return Joint(name, parent, kind, tuple(steps), link=link, **{**names, **options})  # type: ignore[arg-type]


def arm(
    joints: Sequence[Joint],
    gravity: Sequence[Fraction] = DOWN,
    transmission: Sequence[Sequence[Fraction]] | None = None,
    known: dict[str, float] | None = None,
    lengths: dict[str, float | None] | None = None,
) -> ArmSpec:
    count = sum(j.kind != "fixed" for j in joints)
    identity = tuple(tuple(Fraction(i == k) for k in range(count)) for i in range(count))
    rows = identity if transmission is None else tuple(tuple(map(Fraction, row)) for row in transmission)
    return ArmSpec("arm", "An arm", tuple(joints), tuple(gravity), rows, lengths or {}, known or {}, {},
                   "arm.toml", "0" * 64)  # fmt: skip


def serial(rows: Sequence[tuple[object, ...]], drive: bool = False, gravity: Sequence[Fraction] = DOWN,
           lengths: dict[str, float | None] | None = None) -> ArmSpec:  # fmt: skip
    """Return a serial arm of Denavit-Hartenberg rows (alpha, d, theta, r), prismatic with "P" behind."""
    joints: list[Joint] = []
    for number, row in enumerate(rows, start=1):
        kind = "prismatic" if row[4:] == ("P",) else "revolute"
        parent = joints[-1].name if joints else None
        joints.append(joint(str(number), parent, dh(*row[:4]), kind, drive=drive))  # type: ignore[arg-type]
    return arm(joints, gravity, lengths=lengths)


VERTICAL = (Fraction(0), Fraction("-9.81"), Fraction(0))
PLANAR = {
    n: serial([(0, 0, 0, 0), *[(0, size, 0, 0) for size in (0.5, 0.4)[: n - 1]]], gravity=VERTICAL)
    for n in (2, 3)
}
SCARA = [(0, 0, 0, 0), (0, 0.5, 0, 0), (0, 0.3, 0, 0), (0, 0, 0, 0, "P")]
STANFORD = [
    (0, 0, 0, 0),
    (-90, 0, 0, 0.1524),
    (90, 0, 0, 0, "P"),
    (0, 0, 0, 0),
    (-90, 0, 0, 0),
    (90, 0, 0, 0),
]
PUMA = [(0, 0, 0, 0), (-90, 0, 0, 0.2435), (0, 0.4318, 0, -0.0934), (90, -0.0203, 0, 0.4331),
        (-90, 0, 0, 0), (90, 0, 0, 0)]  # fmt: skip
RX90 = [(0, 0, 0, 0), (90, 0, 0, 0), (0, 0.45, 0, 0), (-90, 0, 0, 0.45), (90, 0, 0, 0), (-90, 0, 0, 0)]
UR10 = [(0, 0, 0, 0.1273), (90, 0, 0, 0), (0, -0.612, 0, 0), (0, -0.5723, 0, 0.163941), (90, 0, 0, 0.1157),
        (-90, 0, 0, 0.0922)]  # fmt: skip
PANDA = [(0, 0, 0, 0.333), (-90, 0, 0, 0), (90, 0, 0, 0.316), (90, 0.0825, 0, 0), (-90, -0.0825, 0, 0.384),
         (90, 0, 0, 0), (90, 0.088, 0, 0)]  # fmt: skip
LWR = [(0, 0, 0, 0.31), (90, 0, 0, 0), (-90, 0, 0, 0.4), (-90, 0, 0, 0), (90, 0, 0, 0.39), (90, 0, 0, 0),
       (-90, 0, 0, 0)]  # fmt: skip
ROBOTS = {"scara": SCARA, "stanford": STANFORD, "puma": PUMA, "rx90": RX90, "ur10": UR10, "panda": PANDA,
          "lwr": LWR}  # fmt: skip


def tx40() -> ArmSpec:
    """Return the TX40: placements as in its URDF, motor 6 coupled with axis 5."""
    places = [((0, 0, 0), (0, 0, 0.32)), ((-90, 0, 0), (0, 0, 0)), ((0, 0, 0), (0.225, 0, 0.035)),
              ((90, 0, 0), (0, -0.225, 0)), ((-90, 0, 0), (0, 0, 0)), ((90, 180, 0), (0, 0, 0))]  # fmt: skip
    names = [str(n) for n in range(1, 7)]
    joints = [joint(name, parent, placed(*place), drive=True)
              for name, parent, place in zip(names, [None, *names], places, strict=False)]  # fmt: skip
    ratios = [32, 32, 45, -48, 45, 32]
    transmission = [[Fraction(ratios[i]) * (i == k) for k in range(6)] for i in range(6)]
    transmission[5][4] = Fraction(32)
    return arm(joints, transmission=transmission)


def random_arm(
    rng: random.Random, joints: int | None = None, fixed: float = 0.2, tree: float = 0.3, light: float = 0.15
) -> ArmSpec:
    """Return a random chain or tree of all kinds of joints, with quarters and other angles, and zeros."""
    count = joints or rng.randint(1, 6)
    made: list[Joint] = []
    while sum(j.kind != "fixed" for j in made) < count:
        number = len(made) + 1
        parent = None
        if made:
            parent = rng.choice(made).name if rng.random() < tree else made[-1].name
        steps: list[Step] = []
        for _ in range(rng.randint(0, 4)):
            degrees = rng.choice([90, -90, 180, rng.choice([0, 30, round(rng.uniform(-180, 180), 2)])])
            size = rng.choice([0, 0.3, round(rng.uniform(-1, 1), 3)])
            steps += turn(rng.randrange(3), degrees) if rng.random() < 0.5 else shift(rng.randrange(3), size)
        kind = "fixed" if rng.random() < fixed else rng.choice(["revolute", "revolute", "prismatic"])
        options: dict[str, object] = {"drive": kind != "fixed" and rng.random() < 0.7}
        if rng.random() < light:
            options["link"] = ()
        if rng.random() < 0.2:
            options["friction"] = "asymmetric"
        made.append(joint(str(number), parent, steps, kind, **options))
    gravity = rng.choice([DOWN, VERTICAL, (Fraction(3), Fraction(0), Fraction("-9.2")), (Fraction(0),) * 3])
    return arm(made, gravity)
