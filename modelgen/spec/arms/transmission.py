"""Gears and couplings: motor positions = transmission @ joint positions, which must be invertible."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction

from modelgen.documents import Document
from modelgen.errors import Problem
from modelgen.spec.arms.arm import ArmSpec, Joint
from modelgen.spec.words import shown, suggest


def check_transmission(
    document: Document, spec: ArmSpec, joints: Mapping[str, Joint] | None
) -> Iterator[Problem]:
    """Yield what is wrong with couplings; `joints` is None where names may be missing."""
    moving = [joint.name for joint in spec.moving]
    first: dict[tuple[object, object], int] = {}
    before = False
    for k, table in enumerate(document.get("couplings") or ()):
        where, pair = f"couplings[{k}]", tuple((table or {}).get(key) for key in ("motor", "joint"))
        for key, name in zip(("motor", "joint"), pair, strict=True):
            if joints is None or name is None or name in moving:
                continue
            fixed = name in joints
            what = f"{shown(name)} is {'fixed' if fixed else 'not a joint'}"
            remedy = "name a joint that moves" if fixed else suggest(str(name), moving, "joints that move")
            before = True
            yield Problem(f"{where}.{key}", what, remedy)
        if None in pair:
            before = True
        elif pair[0] == pair[1]:
            before = True
            yield Problem(where, f"couples {shown(pair[0])} with itself", "write gear into the joint's table")
        elif first.setdefault((pair[0], pair[1]), k) != k:
            before = True
            other = first[pair[0], pair[1]]
            yield Problem(where, f"couples what couplings[{other}] does", "keep one of them")
    if not before and joints is not None and not is_invertible(spec.transmission):
        what = "leave motors that move together: their positions do not give those of the joints"
        yield Problem("couplings", what, "correct a ratio or a gear")


def is_invertible(matrix: Sequence[Sequence[Fraction]]) -> bool:
    """Return whether a square matrix has an inverse, by exact elimination; nearly all of it is diagonal."""
    rows = [{k: value for k, value in enumerate(row) if value} for row in matrix]
    for column in range(len(rows)):
        pivot = next((k for k in range(column, len(rows)) if column in rows[k]), None)
        if pivot is None:
            return False
        rows[column], rows[pivot] = rows[pivot], rows[column]
        for row in rows[column + 1 :]:
            if column in row:
                factor = row[column] / rows[column][column]
                for k, value in rows[column].items():
                    row[k] = row.get(k, Fraction(0)) - factor * value
                    if not row[k]:
                        del row[k]
    return True
