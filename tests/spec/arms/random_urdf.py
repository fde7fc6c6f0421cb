"""Random arms as URDF: trees of revolute, prismatic, continuous and fixed joints, axes of all sorts."""

from __future__ import annotations

import math
import random

AXES = ("1 0 0", "0 1 0", "0 0 1", "0 0 -1", "0 -1 0", "-1 0 0", "1 1 0", "0.3 -0.5 0.9")
ANGLES = (0.0, 0.5 * math.pi, -0.5 * math.pi, math.pi, 0.3, -1.1)
KINDS = ("revolute", "revolute", "continuous", "prismatic", "fixed")


def random_urdf(seed: int, joints: int = 6) -> str:
    """Return a URDF whose joints are j1, j2, ... in the order of the file, shuffled, as its links are."""
    draw = random.Random(seed)
    pieces = ['<link name="l0"/>']
    for k in range(1, joints + 1):
        parent = k - 1 if draw.random() < 0.7 else draw.randrange(k)
        kind = "revolute" if k == 1 else draw.choice(KINDS)
        pieces.append(
            f'<joint name="j{k}" type="{kind}"><parent link="l{parent}"/><child link="l{k}"/>{_origin(draw)}'
            f'<axis xyz="{draw.choice(AXES)}"/><limit lower="-2" upper="2" velocity="3" effort="40"/>'
            f'<dynamics damping="{draw.uniform(0, 2)}" friction="{draw.uniform(0, 2)}"/></joint>'
        )
        pieces.append(f'<link name="l{k}">{_inertial(draw)}</link>')
    draw.shuffle(pieces)
    return "<?xml version='1.0'?>\n<robot name='arm'>\n" + "\n".join(pieces) + "\n</robot>\n"


def _origin(draw: random.Random) -> str:
    xyz = " ".join(str(draw.choice((0, 0.1, draw.uniform(-1, 1)))) for _ in range(3))
    return f'<origin xyz="{xyz}" rpy="{" ".join(str(draw.choice(ANGLES)) for _ in range(3))}"/>'


def _inertial(draw: random.Random) -> str:
    a, b, c = (draw.uniform(0.1, 1.0) for _ in range(3))
    off = [draw.uniform(-0.05, 0.05) for _ in range(3)]
    tensor = dict(zip(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), (b + c, a + c, a + b, *off), strict=True))
    entries = " ".join(f'{key}="{value}"' for key, value in tensor.items())
    return f'<inertial>{_origin(draw)}<mass value="{draw.uniform(0.5, 5)}"/><inertia {entries}/></inertial>'
