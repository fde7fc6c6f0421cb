"""Gears and couplings: motor positions = transmission @ joint positions, which must be invertible."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction

from modelgen.documents import Document
from modelgen.errors import Problem
from modelgen.spec.arms.arm import ArmSpec, Joint
from modelgen.spec.words import shown, suggest

_PRIMES = (2**61 - 1, 2**89 - 1)


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
    """Return whether a square matrix has an inverse, by elimination modulo two primes.

    What is not zero modulo a prime is not zero; both divide only determinants made for it.
    """
    return any(_is_invertible_modulo(matrix, prime) for prime in _PRIMES)


def _is_invertible_modulo(matrix: Sequence[Sequence[Fraction]], prime: int) -> bool:
    if any(value.denominator % prime == 0 for row in matrix for value in row):
        return False
    rows = [[v.numerator * pow(v.denominator, -1, prime) % prime for v in row] for row in matrix]
    for column in range(len(rows)):
        pivot = next((k for k in range(column, len(rows)) if rows[k][column]), None)
        if pivot is None:
            return False
        rows[column], rows[pivot] = rows[pivot], rows[column]
        inverse = pow(rows[column][column], -1, prime)
        for k in range(column + 1, len(rows)):
            factor = rows[k][column] * inverse % prime
            if factor:
                rows[k] = [(a - factor * b) % prime for a, b in zip(rows[k], rows[column], strict=True)]
    return True
