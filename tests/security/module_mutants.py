"""Modules that differ from a good one in one place, for the tests of what is executed without trust.

A mutant has a piece of its text replaced where a node of its syntax tree stands, so that the rest keeps the
generator's spelling; or it is the whole changed tree, written anew.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from functools import cache

from hypothesis import strategies as st

from modelgen.generated_module.module_check import HEADER, SEAL, ZEROS, seal
from modelgen.render.writer import generate
from modelgen.spec.load import parse_spec

MOTOR = """
chain = { name = "motor", motion = "rotation", title = "Motor ☃" }
bodies = [{ name = "m", inertia = "J", viscous = "F_v", coulomb = "F_s", offset = "O", actuator = "T" }]
known = { O = -0.25 }
[sensors.all]
q_m = { body = "m", measures = "position" }
"""
CARRIAGE = """
chain = { name = "carriage", motion = "translation" }
[[bodies]]
name = "m"
inertia = "M"
viscous = "F_v"
coulomb = "F_s"
friction = "asymmetric"
actuator = "T"
[parameters.nominal]
M = 95.0
[sensors.all]
q_m = { body = "m", measures = "position" }
"""
PAIR = """
chain = { name = "pair", motion = "rotation" }
bodies = [
    { name = "m", inertia = "J_m", coulomb = "F_s", actuator = "T" },
    { name = "c", inertia = "J_c", viscous = "F_v", offset = "O_c" },
]
links = [{ bodies = ["m", "c"], stiffness = "K", damping = "D", ratio = 2.5SPRING }]
[sensors.all]
q_m = { body = "m", measures = "position" }
"""
UNSEEN = PAIR.replace("SPRING", "")
CUBIC = PAIR.replace("SPRING", ', stiffness3 = "K3"') + 'a_c = { body = "c", measures = "position" }'
SEEN = UNSEEN + 'a_c = { body = "c", measures = "acceleration" }'
#: features and none, known values, directions, composites that have to be searched, cubic springs
TEXTS = tuple(
    generate(parse_spec(text, "chain.toml"), "all") for text in (MOTOR, CARRIAGE, UNSEEN, CUBIC, SEEN)
)

MOTOR_TEXT = TEXTS[0]
LITERALS = re.findall(r"^([A-Z0-9_]+) = ", MOTOR_TEXT, re.MULTILINE)

OPEN = "open('pwned', 'w').close()"
IMPORTED = "__import__('os').system('touch pwned')"
EXPRESSIONS = (
    *(
        OPEN,
        IMPORTED,
        "exec",
        "open",
        "np",
        "np.load",
        "np.os.system",
        "().__class__",
        "signals",
        "__builtins__",
    ),
    *(
        f"({OPEN} or 1)",
        f"(1 and {OPEN})",
        f"(x := {OPEN})",
        f"1 + {OPEN}",
        f"-{OPEN}",
        f"+{OPEN}",
        f"(not {OPEN})",
    ),
    *(f"~{OPEN}", f"1 if {OPEN} else 2", f"lambda x={OPEN}: x", f"[{OPEN}]", f"({OPEN},)", f"{{{OPEN}}}"),
    *(f"{{1: {OPEN}}}", f"{{**{OPEN}}}", f"[*{OPEN}]", f"1 < {OPEN} < 2", f"1 is {OPEN}", f"1 is not {OPEN}"),
    *(
        f"1 in {OPEN}",
        f"1 not in {OPEN}",
        f"1 == {OPEN} != 2 <= 3 >= 4 > 5",
        f"np[{OPEN}]",
        f"np[{OPEN}:1:2]",
    ),
    *(
        "[exec('1') for exec in (open,)]",
        "{open('pwned', 'w') for open in (open,)}",
        f"{{1: {OPEN} for _ in ''}}",
    ),
    *(
        f"({OPEN} for _ in range(2) if {OPEN})",
        f'f"{{{OPEN}!r:>{{1}}}}"',
        f"print(*{OPEN}, x={OPEN}, **{OPEN})",
    ),
    *(
        f"(yield {OPEN})",
        f"(yield from {OPEN})",
        f"(await {OPEN})",
        f"[{OPEN} async for _ in x]",
        f"{OPEN}.x",
    ),
    *(
        "9**9**9",
        "range(10**18)",
        "'x' * 10**10",
        "np.zeros((10**8, 10**8))",
        "1e999",
        "1j",
        "...",
        "b'x'",
        "0x9",
    ),
    *(
        "1 - 2 * 3 / 4 // 5 % 6 @ 7 << 8 >> 9 | 10 ^ 11 & 12",
        "True",
        "None",
        "'a' 'b'",
        "0.5",
        "-1.0",
        "'q_m'",
    ),
)
STATEMENTS = (
    *(OPEN, IMPORTED, f"x = {OPEN}", f"x += {OPEN}", f"x: {OPEN} = {OPEN}", f"{IMPORTED}.x: np.ndarray"),
    *("import os", "import os.path as p", "from os import system as s", "from numpy import *", "global x"),
    *(
        f"del {OPEN}.x",
        "pass",
        "nonlocal x",
        f"return {OPEN}",
        f"raise {OPEN} from {OPEN}",
        f"assert {OPEN}, 'x'",
    ),
    *(
        f"if {OPEN}: pass\nelif 1: pass\nelse: {OPEN}",
        f"while {OPEN}: break\nelse: pass",
        "while True: continue",
    ),
    *(f"for open in {OPEN}: continue\nelse: pass", f"async def f():\n    async for x in {OPEN}: pass"),
    *(f"with {OPEN} as x: pass", f"async def f():\n    async with {OPEN} as x: await x"),
    *(
        f"try: {OPEN}\nexcept {OPEN} as x: pass\nelse: pass\nfinally: pass",
        f"try: pass\nexcept* {OPEN}: pass",
    ),
    *(
        f"@{OPEN}\ndef f(a={OPEN}, /, b: {OPEN} = 1, *c, d={OPEN}, **e) -> {OPEN}: pass",
        "def __getattr__(n): pass",
    ),
    *(f"@{OPEN}\nclass A({OPEN}, metaclass={OPEN}):\n    x: {OPEN} = {OPEN}", "class A: pass"),
    f"match {OPEN}:\n"
    "    case 1 | 'x' | None: pass\n    case [a, *b]: pass\n    case {'k': v, **r}: pass\n"
    f"    case str(x, real=y) as z if {OPEN}: pass\n    case np.x: pass\n    case _: pass",
    *(f"def open(): pass\n{OPEN}", "x, *y = open", "TITLE = str(6 * 7)", "np.zeros = exec", "'text'", "1"),
)
if sys.version_info >= (3, 12):
    STATEMENTS = (*STATEMENTS, f"type X[T: ({OPEN}), *U, **P] = {OPEN}", f"def f[T: {OPEN}](): pass")
PAYLOADS = (*EXPRESSIONS, *STATEMENTS)
TOKEN = re.compile(r"\w+|\s+|[^\w\s]")


def payload_tree(payload: str) -> ast.AST:
    """Return the syntax tree of a payload, which may be an expression of an asynchronous generator."""
    return ast.parse("async def outer():\n" + "".join(f"    {line}\n" for line in payload.splitlines()))


def sized(rows: int, columns: int) -> str:
    """Return a module that declares so many rows and columns, and makes arrays for them."""
    start, end = MOTOR_TEXT.index("ROWS = "), MOTOR_TEXT.index("FRICTION = ")
    text = f"{MOTOR_TEXT[:start]}ROWS = ({'0,' * rows})\n{MOTOR_TEXT[end:]}"
    text = text.replace("BASE_PARAMETERS = ('J', 'F_v', 'F_s')", f"BASE_PARAMETERS = ({'0,' * columns})")
    return text.replace(", 1))\n    y", f", {rows}))\n    y").replace(", 1, 3))", f", {rows}, {columns}))")


@cache
def pieces(text: str) -> tuple[tuple[int, int, type[ast.AST]], ...]:
    """Return where each node of a text's syntax tree begins and ends, in characters, and what it is."""
    starts = [0]
    for line in text.splitlines(keepends=True):
        starts.append(starts[-1] + len(line.encode()))
    raw, found = text.encode(), []
    for node in ast.walk(ast.parse(text)):
        if hasattr(node, "lineno"):
            ends = (
                starts[node.lineno - 1] + node.col_offset,
                starts[node.end_lineno - 1] + node.end_col_offset,
            )
            found.append((*(len(raw[:end].decode()) for end in ends), type(node)))
    return tuple(found)


@st.composite
def mutants(draw: st.DrawFn) -> str:
    """Draw a sealed module with one or two changes, mostly such as may be accepted."""
    text = draw(st.sampled_from(TEXTS))
    for _ in range(draw(st.integers(1, 2))):
        change = draw(st.sampled_from(CHANGES))
        try:
            text = change(draw, text)
        except (SyntaxError, Warning):  # of the change before: Python cannot read the text any more
            break
        if change in FOREIGN:
            break
    return seal(text)


def _mild(draw: st.DrawFn, text: str) -> str:
    """Replace a number or a text by another one."""
    where = [piece for piece in pieces(text) if piece[2] is ast.Constant]
    start, end, _ = draw(st.sampled_from(where))
    old = text[start:end]
    if old[:1] in "'\"" and not old.startswith('"""'):
        found = re.findall(rf"{old[0]}[\w+]+{old[0]}", text)
        new = draw(st.sampled_from(found) | st.text(max_size=5).map(repr))
    elif old.isdigit():
        new = str(draw(st.integers(0, 12)))
    else:
        new = repr(abs(draw(st.floats())))
    return text[:start] + new + text[end:]


def _number(draw: st.DrawFn, text: str) -> str:
    """Change a number in a formula or among the declared values."""
    found = draw(st.sampled_from([*re.finditer(r"\b\d+\.\d+\b", text)]))
    value = repr(draw(st.integers(1, 10**12)) / 1e6)
    return text[: found.start()] + value + text[found.end() :]


def _line(draw: st.DrawFn, text: str) -> str:
    """Leave out, repeat or exchange a line of formulas."""
    lines = text.splitlines(keepends=True)
    where = [place for place, line in enumerate(lines) if re.match(r" {4,}(?:[A-Zy]\[|\w\[|\")", line)]
    first, second = draw(st.sampled_from(where)), draw(st.sampled_from(where))
    kind = draw(st.integers(0, 2))
    if kind == 0:
        del lines[first]
    elif kind == 1:
        lines.insert(first, lines[first])
    else:
        lines[first], lines[second] = lines[second], lines[first]
    return "".join(lines)


def _sign(draw: st.DrawFn, text: str) -> str:
    """Exchange an operator, a comparison or a key between formulas."""
    found = draw(st.sampled_from([*re.finditer(r' [-+*/<>] |[sfp]\["[^"]+"\]', text)]))
    like = [" + ", " - ", " * ", " / "] if found.group()[1] in "+-*/" else [" > ", " < "]
    if '"' in found.group():
        like = sorted(set(re.findall(rf'{found.group()[0]}\["[^"]+"\]', text)))
    return text[: found.start()] + draw(st.sampled_from(like)) + text[found.end() :]


def _payload(draw: st.DrawFn, text: str) -> str:
    """Replace a node by any other one, or put a statement before it."""
    start, end, _ = draw(st.sampled_from(pieces(text)))
    payload = draw(st.sampled_from(PAYLOADS))
    column = start - text.rfind("\n", 0, start) - 1
    payload = payload.replace("\n", "\n" + " " * column)
    keep = draw(st.booleans())
    return text[:start] + payload + ("\n" + " " * column + text[start:end] if keep else "") + text[end:]


def _token(draw: st.DrawFn, text: str) -> str:
    """Replace a token by another one, or by any characters."""
    tokens = [*TOKEN.finditer(text)]
    found = draw(st.sampled_from(tokens))
    new = draw(st.sampled_from([t.group() for t in tokens[::7]]) | st.text(max_size=3))
    return text[: found.start()] + new + text[found.end() :]


def _tree(draw: st.DrawFn, text: str) -> str:
    """Change a node of the tree, and write the whole tree anew."""
    payload = draw(st.sampled_from(EXPRESSIONS))
    new = (
        ast.parse(payload, mode="eval").body if " async for " not in payload else ast.Name("exec", ast.Load())
    )
    tree = ast.parse(text)
    where = [*_expressions(tree)]
    parent, field, place = draw(st.sampled_from(where))
    if place is None:
        setattr(parent, field, new)
    else:
        getattr(parent, field)[place] = new
    header = "\n".join(
        (*(found.group() for found in HEADER.finditer(text)), SEAL.search(text).expand(rf"\g<1>{ZEROS}"))  # type: ignore[union-attr]
    )
    return f"{header}\n{ast.unparse(tree)}\n"


def _expressions(tree: ast.AST) -> Iterator[tuple[ast.AST, str, int | None]]:
    """Yield the place of every expression in a tree that may be read: parent, field, place in a list."""
    for parent in ast.walk(tree):
        for field, value in ast.iter_fields(parent):
            for place, item in enumerate(value) if isinstance(value, list) else ((None, value),):
                if isinstance(item, ast.expr) and not isinstance(parent, ast.JoinedStr | ast.FormattedValue):
                    yield parent, field, place


MILD = (_mild, _number, _line, _sign)
FOREIGN = (_payload, _token, _tree)
CHANGES = (*[_number] * 8, *MILD, *MILD, *FOREIGN)
