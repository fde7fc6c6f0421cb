"""Expressions as a straight line of operations on arrays, with few arrays that are used again and again."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import groupby

from modelgen.render.arms.free_signs import free_signs
from modelgen.symbolic.arms.expressions.graph import Graph, Node, Ref, Symbol

#: Kinds of symbols that are arrays of the record.
INPUTS = ("position", "force", "reading", "load")
FUNCTIONS = {"cosine": "cos", "sine": "sin", "sign": "sign", "forward": "greater", "backward": "less"}


@dataclass(frozen=True)
class KernelOutput:
    """What is computed: a reference, and the section that it belongs to."""

    ref: Ref
    section: str


@dataclass(frozen=True)
class Operation:
    """One operation on whole arrays.

    Attributes
    ----------
    name
        Of its value.
    function
        add, subtract, multiply, divide, negative, positive (a copy), cos, sin, sign, greater, less.
    operands
        Names, and numbers.
    target
        The array that it is written to: o and the number of an output, or b and that of a buffer.
    section
        That of the first output that needs it.
    """

    name: str
    function: str
    operands: tuple[str | float, ...]
    target: str
    section: str


@dataclass(frozen=True)
class StraightLine:
    """Operations in their order, how many buffers they need, and the symbols that they read."""

    operations: tuple[Operation, ...]
    buffers: int
    inputs: tuple[Symbol, ...]

    def sections(self) -> Iterator[tuple[str, Iterator[Operation]]]:
        """Yield the operations in their order, by section; a section may come again.

        Columns of payloads and of mountings stand behind all joints: what they need is computed by then, and
        what they overwrite is no longer needed.
        """
        yield from groupby(self.operations, key=lambda operation: operation.section)


def straight_line(
    graph: Graph,
    outputs: Sequence[KernelOutput],
    names: Mapping[int, str],
    lengths: Mapping[str, float],
    speeds: Mapping[str, Ref],
    angles: Mapping[str, Ref] | None = None,
) -> StraightLine:
    """Return the operations that compute outputs.

    Parameters
    ----------
    graph : Graph
        Where they are.
    outputs : sequence of KernelOutput
        Output k is written to the array ok.
    names : mapping of int to str
        Names of nodes, all different; others are called v and a number. Positions and forces must have one.
    lengths : mapping of str to float
        Values of the named lengths [m].
    speeds : mapping of str to int
        Those whose directions are needed.
    angles : mapping of str to int, optional
        What cosine and sine are taken of, where it is not the joint's position itself.
    """
    line = _Line(graph, names, lengths, speeds, angles or {})
    read = [*speeds.values(), *(angles or {}).values()]
    line.negated = free_signs(graph, [output.ref for output in outputs], read, line.is_constant, names)
    own: dict[int, int] = {}
    for place, output in enumerate(outputs):
        ref = abs(output.ref)
        if line.stored(ref) == output.ref and not line.is_input(ref) and not line.is_constant(ref):
            own.setdefault(ref, place)
    # what is computed for which output; its number stands for the copy that ends it, if it needs one
    steps: list[tuple[int | None, int]] = []
    for place, output in enumerate(outputs):
        steps += [(index, place) for index in line.pending(abs(output.ref))]
        if own.get(abs(output.ref)) != place:
            steps.append((None, place))
    last: dict[int, int] = {}
    for step, (node, place) in enumerate(steps):
        used = [abs(outputs[place].ref)] if node is None else line.operands(node)
        last.update(dict.fromkeys(used, step))
    operations = []
    for step, (node, place) in enumerate(steps):
        if node is None:
            operations.append(line.copy(outputs[place], place, last, step))
        else:
            operations.append(line.operation(node, outputs[place].section, own, last, step))
    return StraightLine(tuple(operations), line.buffers, tuple(line.inputs))


@dataclass
class _Line:
    graph: Graph
    names: Mapping[int, str]
    lengths: Mapping[str, float]
    speeds: Mapping[str, Ref]
    angles: Mapping[str, Ref]
    constants: dict[int, float] = field(default_factory=dict)
    inputs: list[Symbol] = field(default_factory=list)
    buffers: int = 0
    negated: frozenset[int] = frozenset()
    _seen: set[int] = field(default_factory=set)
    _free: list[int] = field(default_factory=list)
    _held: dict[int, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.constants[0] = 0.0
        for index, node in enumerate(self.graph.nodes):
            value = self._constant(node)
            if value is not None:
                self.constants[index] = float(value)

    def _constant(self, node: Node) -> Fraction | float | None:
        if node.operation == "constant":
            return node.value
        if node.operation == "symbol":
            symbol = node.symbol
            return self.lengths[symbol.name] if symbol is not None and symbol.kind == "length" else None
        operands = [abs(ref) for ref in (node.left, node.right) if ref]
        if any(ref not in self.constants for ref in operands):
            return None
        left = self.number(node.left)
        if node.operation == "reciprocal":
            return 1.0 / left
        right = self.number(node.right)
        return left + right if node.operation == "sum" else left * right

    def number(self, ref: Ref) -> float:
        return self.constants[ref] if ref >= 0 else -self.constants[-ref]

    def is_constant(self, ref: Ref) -> bool:
        return abs(ref) in self.constants

    def stored(self, index: int) -> Ref:
        """Return what the array of a node holds: the node, or its negative."""
        return -index if index in self.negated else index

    def is_input(self, ref: Ref) -> bool:
        symbol = self.graph.nodes[abs(ref)].symbol
        return symbol is not None and symbol.kind in INPUTS

    def operands(self, index: int) -> Iterator[int]:
        """Yield the nodes that one is made of, arrays only."""
        node = self.graph.nodes[index]
        refs: tuple[Ref, ...] = (node.left, node.right)
        if node.symbol is not None and node.symbol.kind in ("cosine", "sine"):
            name = node.symbol.name
            refs = (self.angles.get(name) or self.graph.symbol(Symbol("position", name)),)
        elif node.symbol is not None and node.symbol.kind == "direction":
            refs = (self.speeds[node.symbol.name],)
        yield from (abs(ref) for ref in refs if not self.is_constant(ref))

    def pending(self, index: int) -> list[int]:
        """Return what a node needs that is not computed yet, operands first, and itself."""
        order: list[int] = []
        stack = [(index, False)]
        while stack:
            at, ready = stack.pop()
            if ready:
                order.append(at)
                continue
            if at in self._seen or at in self.constants:
                continue
            self._seen.add(at)
            symbol = self.graph.nodes[at].symbol
            if symbol is not None and symbol.kind in INPUTS:
                self.inputs.append(symbol)
                continue
            stack.append((at, True))
            stack += [(operand, False) for operand in reversed(list(self.operands(at)))]
        return order

    def operation(
        self, index: int, section: str, own: Mapping[int, int], last: Mapping[int, int], step: int
    ) -> Operation:
        """Return what computes a node; operands that nothing else needs may be overwritten by it."""
        function, operands = self._function(index)
        self._release(dict.fromkeys(self.operands(index)), last, step)
        if index in own:
            target = f"o{own[index]}"
        else:
            if not self._free:
                self._free.append(self.buffers)
                self.buffers += 1
            self._held[index] = self._free.pop()
            target = f"b{self._held[index]}"
        return Operation(self._name(index), function, operands, target, section)

    def copy(self, output: KernelOutput, place: int, last: Mapping[int, int], step: int) -> Operation:
        """Return what writes a value that is computed already, or its negative, to an output of its own."""
        constant, index = self.is_constant(output.ref), abs(output.ref)
        negative = not constant and self.stored(index) != output.ref
        self._release([index], last, step)
        operands = (self.value(output.ref if constant else index),)
        return Operation(
            f"e{place}", "negative" if negative else "positive", operands, f"o{place}", output.section
        )

    def _release(self, nodes: Iterable[int], last: Mapping[int, int], step: int) -> None:
        for node in nodes:
            if last.get(node) == step and node in self._held:
                self._free.append(self._held.pop(node))

    def _function(self, index: int) -> tuple[str, tuple[str | float, ...]]:
        node = self.graph.nodes[index]
        if node.symbol is not None:
            symbol = node.symbol
            operand = self.value(next(self.operands(index)))
            if symbol.kind != "direction":
                return FUNCTIONS[symbol.kind], (operand,)
            return FUNCTIONS[symbol.of], (operand,) if symbol.of == "sign" else (operand, 0.0)
        if node.operation == "reciprocal":
            return "divide", (1.0, self.value(node.left))
        turn = -1 if index in self.negated else 1
        if node.operation == "product":
            return "multiply", self._factors(turn, node)
        (left, first), (right, second) = (self._term(turn, ref) for ref in (node.left, node.right))
        if second < 0:
            return "subtract", (left, right)
        return ("subtract", (right, left)) if first < 0 else ("add", (left, right))

    def _term(self, turn: int, ref: Ref) -> tuple[str | float, int]:
        """Return an operand of a sum and its sign; that of a number is in the number."""
        if self.is_constant(ref):
            return turn * self.number(ref), 1
        return self._name(abs(ref)), turn if self.stored(abs(ref)) == ref else -turn

    def _factors(self, turn: int, node: Node) -> tuple[str | float, str | float]:
        """Return the operands of a product; the sign that arrays leave open is that of its number."""
        for ref in (node.left, node.right):
            if not self.is_constant(ref):
                turn *= 1 if self.stored(abs(ref)) == ref else -1
        left, right = (
            turn * self.number(ref) if self.is_constant(ref) else self._name(abs(ref))
            for ref in (node.left, node.right)
        )
        return left, right

    def value(self, ref: Ref) -> str | float:
        return self.number(ref) if self.is_constant(ref) else self._name(ref)

    def _name(self, index: int) -> str:
        return self.names.get(index, f"v{index}")
