"""An expression graph with every node once: sums, products and reciprocals of symbols and exact constants.

A reference to a node is a signed integer, so that x and -x are one node and a minus sign costs nothing:
0 is zero, 1 is one, and -7 is minus node 7. What can be simplified is simplified when a node is made: zeros
and ones vanish, constants are fractions and stand in front of products, x - x is zero, x + x is 2 x.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import Literal, NamedTuple

SymbolKind = Literal[
    "position", "cosine", "sine", "length", "parameter", "force", "torque", "reading", "direction", "load"
]
Direction = Literal["", "sign", "forward", "backward"]
Operation = Literal["constant", "symbol", "sum", "product", "reciprocal"]

#: A signed reference to a node.
Ref = int
ZERO: Ref = 0
ONE: Ref = 1


class Symbol(NamedTuple):
    """A leaf of the graph.

    =========  ================================================================================
    kind       meaning
    =========  ================================================================================
    position   coordinate of the joint `name`, differentiated `order` times
    cosine     cosine of the coordinate of the joint `name`; likewise sine
    length     a length that has a name
    parameter  a parameter of the arm
    force      force or torque of the motor of the joint `name`, differentiated `order` times
    torque     force or torque that the link of the joint `name` receives, likewise
    reading    what the sensor `name` gives, likewise
    direction  sign, forward or backward (`of`) of the speed `name`: constant between reversals
    load       1 while the arm carries the payload `name`, else 0: constant, too
    =========  ================================================================================
    """

    kind: SymbolKind
    name: str
    order: int = 0
    of: Direction = ""


class Node(NamedTuple):
    """One node: its operation, and what it works on.

    `left` and `right` are the operands of a sum or product (of a reciprocal: `left`); a constant has its
    `value`, a symbol its `symbol`.
    """

    operation: Operation
    left: Ref = 0
    right: Ref = 0
    value: Fraction = Fraction(0)
    symbol: Symbol | None = None


class Graph:
    """Nodes in the order in which they were made: operands come before what is made of them."""

    def __init__(self) -> None:
        self.nodes: list[Node] = [Node("constant"), Node("constant", value=Fraction(1))]
        self._known: dict[tuple[object, ...], Ref] = {}
        # constants, and products with one: how often which node without a constant counts
        self._scaled: dict[Ref, tuple[Fraction, Ref]] = {}

    def constant(self, value: Fraction | int) -> Ref:
        """Return a constant."""
        if value == 0:
            return ZERO
        size = abs(Fraction(value))
        if size == 1:
            return ONE if value > 0 else -ONE
        key = ("constant", size)
        found = self._known.get(key)
        if found is None:
            found = self._made(key, Node("constant", value=size))
            self._scaled[found] = (size, ONE)
        return found if value > 0 else -found

    def symbol(self, symbol: Symbol) -> Ref:
        """Return a symbol."""
        key = ("symbol", symbol)
        found = self._known.get(key)
        return self._made(key, Node("symbol", symbol=symbol)) if found is None else found

    def add(self, left: Ref, right: Ref) -> Ref:
        """Return left + right."""
        if left == 0:
            return right
        if right == 0:
            return left
        if left == -right:
            return ZERO
        if abs(left) > abs(right):
            left, right = right, left
        if left < 0:
            return -self.add(-left, -right)
        if left == right or left == 1 or left in self._scaled or abs(right) in self._scaled:
            merged = self._merged(left, right)
            if merged is not None:
                return merged
        key = ("sum", left, right)
        found = self._known.get(key)
        return self._made(key, Node("sum", left, right)) if found is None else found

    def subtract(self, left: Ref, right: Ref) -> Ref:
        """Return left - right."""
        return self.add(left, -right)

    def multiply(self, left: Ref, right: Ref) -> Ref:
        """Return left * right."""
        if left == 0 or right == 0:
            return ZERO
        if left < 0:
            return self.multiply(-left, -right) if right < 0 else -self.multiply(-left, right)
        if right < 0:
            return -self.multiply(left, -right)
        if left == 1:
            return right
        if right == 1:
            return left
        if left in self._scaled or right in self._scaled:
            factor, first = self._scaled.get(left, (Fraction(1), left))
            other, second = self._scaled.get(right, (Fraction(1), right))
            return self.scale(factor * other, self.multiply(first, second))
        if left > right:
            left, right = right, left
        key = ("product", left, right)
        found = self._known.get(key)
        return self._made(key, Node("product", left, right)) if found is None else found

    def scale(self, factor: Fraction, ref: Ref) -> Ref:
        """Return a constant times a node."""
        if factor == 0 or ref == 0:
            return ZERO
        sign = 1 if (factor > 0) == (ref > 0) else -1
        inner, base = self._scaled.get(abs(ref), (Fraction(1), abs(ref)))
        size = abs(factor) * inner
        if base == ONE or size == 1:
            return sign * (self.constant(size) if base == ONE else base)
        constant = self.constant(size)
        key = ("product", constant, base)
        found = self._known.get(key)
        if found is None:
            found = self._made(key, Node("product", constant, base))
            self._scaled[found] = (size, base)
        return sign * found

    def reciprocal(self, ref: Ref) -> Ref:
        """Return 1 / ref.

        Raises
        ------
        ZeroDivisionError
            If it is the constant zero.
        """
        if ref < 0:
            return -self.reciprocal(-ref)
        if ref in (ZERO, ONE) or (ref in self._scaled and self._scaled[ref][1] == ONE):
            return self.constant(1 / (self._scaled[ref][0] if ref > 1 else Fraction(ref)))
        key = ("reciprocal", ref)
        found = self._known.get(key)
        return self._made(key, Node("reciprocal", ref)) if found is None else found

    def total(self, terms: Iterable[Ref]) -> Ref:
        """Return the sum of terms."""
        total = ZERO
        for term in terms:
            total = self.add(total, term)
        return total

    def dot(self, left: Sequence[Ref], right: Sequence[Ref]) -> Ref:
        """Return the sum of the products of two sequences of the same length."""
        return self.total(self.multiply(a, b) for a, b in zip(left, right, strict=True) if a and b)

    def needed(self, refs: Iterable[Ref]) -> list[int]:
        """Return the nodes that these references are made of, operands first."""
        pending = [abs(ref) for ref in refs]
        seen = set(pending)
        while pending:
            node = self.nodes[pending.pop()]
            for operand in (node.left, node.right):
                if operand and abs(operand) not in seen:
                    seen.add(abs(operand))
                    pending.append(abs(operand))
        return sorted(seen)

    def operations(self, refs: Iterable[Ref]) -> int:
        """Return the number of additions, multiplications and divisions that these references cost."""
        nodes = (self.nodes[index] for index in self.needed(refs))
        return sum(node.operation in ("sum", "product", "reciprocal") for node in nodes)

    def _merged(self, left: Ref, right: Ref) -> Ref | None:
        """Return the sum of two multiples of one node, or None if they are of two."""
        factor, first = self._scaled.get(left, (Fraction(1), left))
        other, second = self._scaled.get(abs(right), (Fraction(1), abs(right)))
        if first != second:
            return None
        return self.scale(factor + (other if right > 0 else -other), first)

    def _made(self, key: tuple[object, ...], node: Node) -> Ref:
        self.nodes.append(node)
        self._known[key] = len(self.nodes) - 1
        return len(self.nodes) - 1
