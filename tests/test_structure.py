"""The size and shape of the code: lines, parameters, files of a folder, import cycles."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatch
from functools import cache
from pathlib import Path

import pytest

FUNCTION_LINES = 60
PARAMETERS = 8
PAGE_LINES = 40  # the whole of an identification, each step by its name
FILE_LINES = 300
FOLDER_FILES = 20

# One thing on either side of a generated module, which stands between the two: as described, and as loaded.
TWO_SIDES = {"Feature", "Parameter", "Sensor", "Signal"}

# Kernels written for a compiler: one scope, and arguments that no structure may group.
KERNEL_FILES = ("*_kernel.py", "*_kernels.py", "compiled_*.py", "block_numba.py")
COMPILERS = {"njit", "jit"}

Function = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(frozen=True, order=True)
class Offender:
    """A place that exceeds a limit: a path below modelgen, the function where it is one, and its size."""

    rule: str
    path: str
    name: str
    size: int

    def __str__(self) -> str:
        return f"modelgen/{self.path} {self.name}".rstrip() + f": {self.size}"


@pytest.fixture(scope="module")
def sources(repo_root: Path) -> dict[str, str]:
    """The text of every module, by its path below modelgen."""
    root = repo_root / "modelgen"
    found = {
        path.relative_to(root).as_posix(): path.read_text(encoding="utf-8") for path in root.rglob("*.py")
    }
    assert len(found) > 200
    return dict(sorted(found.items()))


@cache
def tree(text: str) -> ast.Module:
    return ast.parse(text)


@cache
def functions(text: str) -> tuple[tuple[str, Function], ...]:
    """Every function of a text, methods and nested ones too, with its qualified name."""

    def inside(node: ast.AST, prefix: str) -> Iterator[tuple[str, Function]]:
        for child in ast.iter_child_nodes(node):
            if not isinstance(child, ast.stmt | ast.ExceptHandler | ast.match_case):
                continue  # expressions hold none
            if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef):
                yield prefix + child.name, child
            named = isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)
            yield from inside(child, f"{prefix}{child.name}." if named else prefix)

    return tuple(inside(tree(text), ""))


def is_kernel(path: str, function: Function) -> bool:
    """Whether a function is written for a compiler: by its file, or by its decorator."""
    if any(fnmatch(path.rpartition("/")[2], pattern) for pattern in KERNEL_FILES):
        return True
    return any(
        COMPILERS & {getattr(node, "id", ""), getattr(node, "attr", "")}
        for decorator in function.decorator_list
        for node in ast.walk(decorator)
    )


def lines_of(function: Function) -> int:
    """Lines from `def` to the end, without those of the docstring."""
    assert function.end_lineno is not None
    lines = function.end_lineno - function.lineno + 1
    if ast.get_docstring(function) is not None:
        docstring = function.body[0]
        assert docstring.end_lineno is not None
        lines -= docstring.end_lineno - docstring.lineno + 1
    return lines


def parameters_of(function: Function) -> int:
    """Number of parameters, `self` and `cls` not counted."""
    arguments = function.args
    positional = [argument.arg for argument in (*arguments.posonlyargs, *arguments.args)]
    own = len(positional) - (positional[:1] in (["self"], ["cls"]))
    return own + len(arguments.kwonlyargs) + (arguments.vararg is not None) + (arguments.kwarg is not None)


def long_functions(sources: Mapping[str, str]) -> list[Offender]:
    return [
        Offender("function lines", path, name, lines_of(function))
        for path, text in sources.items()
        for name, function in functions(text)
        if lines_of(function) > FUNCTION_LINES and not is_kernel(path, function)
    ]


def wide_functions(sources: Mapping[str, str]) -> list[Offender]:
    return [
        Offender("parameters", path, name, parameters_of(function))
        for path, text in sources.items()
        for name, function in functions(text)
        if parameters_of(function) > PARAMETERS
        and not is_kernel(path, function)
        and not path.startswith("cli/")  # every option of a command is a parameter
    ]


def long_files(sources: Mapping[str, str]) -> list[Offender]:
    sizes = {path: len(text.splitlines()) for path, text in sources.items()}
    return [Offender("file lines", path, "", size) for path, size in sizes.items() if size > FILE_LINES]


def large_folders(sources: Mapping[str, str]) -> list[Offender]:
    folders = [path.rpartition("/")[0] for path in sources]
    sizes = {folder: folders.count(folder) for folder in dict.fromkeys(folders)}
    return [Offender("folder files", path, "", size) for path, size in sizes.items() if size > FOLDER_FILES]


RULES = {
    "function lines": (FUNCTION_LINES, long_functions),
    "parameters": (PARAMETERS, wide_functions),
    "file lines": (FILE_LINES, long_files),
    "folder files": (FOLDER_FILES, large_folders),
}


@pytest.mark.parametrize("rule", RULES)
def test_sizes(rule: str, sources: dict[str, str]) -> None:
    limit, offenders_in = RULES[rule]
    offenders = offenders_in(sources)
    listed = "\n".join(map(str, sorted(offenders, key=lambda found: -found.size)))
    assert not offenders, f"{rule}, at most {limit}:\n{listed}"


def test_identify_is_one_page(sources: dict[str, str]) -> None:
    text = sources["runtime/identification/identify.py"]
    assert {name: lines for name, one in functions(text) if (lines := lines_of(one)) > PAGE_LINES} == {}


def test_one_name_for_one_thing(sources: dict[str, str]) -> None:
    assert not repeated_classes(sources)


def test_no_module_gives_a_name_twice(sources: dict[str, str]) -> None:
    assert not [f"modelgen/{path}: {name}" for path, text in sources.items() for name in given_twice(text)]


def given_twice(text: str) -> list[str]:
    """The names that a module gives a value more than once: the first is lost without a word."""
    names = [name for node in tree(text).body if isinstance(node, ast.Assign) for name in named_by(node)]
    return sorted({name for name in names if names.count(name) > 1})


def named_by(node: ast.Assign) -> list[str]:
    return [one.id for target in node.targets for one in ast.walk(target) if isinstance(one, ast.Name)]


def test_names_given_twice_are_found() -> None:
    assert given_twice("A, B = 1, 2\nC = 3\nB = 4\ndef f():\n    C = 5\n") == ["B"]


def repeated_classes(sources: Mapping[str, str]) -> dict[str, list[str]]:
    """The modules of every public class whose name another class has as well."""
    homes: dict[str, list[str]] = {}
    for path, text in sources.items():
        for node in tree(text).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                homes.setdefault(node.name, []).append(path)
    return {name: paths for name, paths in homes.items() if len(paths) > 1 and name not in TWO_SIDES}


@pytest.mark.slow
def test_no_import_cycle(sources: dict[str, str]) -> None:
    cycles = [" <-> ".join(sorted(group)) for group in cycles_of(import_graph(sources))]
    assert not cycles, "modules that import each other:\n" + "\n".join(cycles)


def import_graph(sources: Mapping[str, str]) -> dict[str, set[str]]:
    """What every module imports of modelgen, at its top or inside functions; not for type checkers only."""
    names = {module_name(path): path for path in sources}
    return {name: imported(sources[path], names) - {name} for name, path in names.items()}


def module_name(path: str) -> str:
    return ".".join(
        ["modelgen", *path.removesuffix(".py").removesuffix("__init__").rstrip("/").split("/")]
    ).rstrip(".")


def imported(text: str, names: Mapping[str, str]) -> set[str]:
    found: set[str] = set()
    pending: list[ast.AST] = [tree(text)]
    while pending:
        node = pending.pop()
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            # the other branch is executed, and so is the body of `if not TYPE_CHECKING`
            pending += node.body if isinstance(node.test, ast.UnaryOp) else node.orelse
            continue
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
        pending += ast.iter_child_nodes(node)
    return found & names.keys()


def cycles_of(graph: Mapping[str, set[str]]) -> list[list[str]]:
    """Groups of nodes that reach each other (strongly connected components, Tarjan 1972)."""
    order: dict[str, int] = {}
    lowest: dict[str, int] = {}
    stack: list[str] = []
    groups: list[list[str]] = []

    def visit(node: str) -> None:
        order[node] = lowest[node] = len(order)
        stack.append(node)
        for following in sorted(graph[node]):
            if following not in order:
                visit(following)
                lowest[node] = min(lowest[node], lowest[following])
            elif following in stack:
                lowest[node] = min(lowest[node], order[following])
        if lowest[node] == order[node]:
            cut = stack.index(node)
            group = stack[cut:]
            del stack[cut:]
            if len(group) > 1:
                groups.append(group)

    for node in graph:
        if node not in order:
            visit(node)
    return groups


# The rules themselves, on small sources: a rule that finds nothing would pass for ever.


def source_of(*lines: str) -> dict[str, str]:
    return {"part/module.py": "\n".join(lines)}


def test_classes_of_one_name_are_found() -> None:
    twice = {"a.py": "class Row: pass", "b.py": "class Row: pass\nclass _Row: pass"}
    assert repeated_classes(twice) == {"Row": ["a.py", "b.py"]}
    assert not repeated_classes({"a.py": "class Sensor: pass", "b.py": "class Sensor: pass"})


def test_a_docstring_is_not_counted() -> None:
    body = ["    x = 1"] * (FUNCTION_LINES - 1)
    docstring = ['    """First.', "", *["    More."] * 50, '    """']
    assert not long_functions(source_of("def f():", *docstring, *body))
    (found,) = long_functions(source_of("def f():", *docstring, *body, "    x = 2"))
    assert (found.name, found.size) == ("f", FUNCTION_LINES + 1)


def test_methods_and_nested_functions_are_counted() -> None:
    body = ["            x = 1"] * FUNCTION_LINES
    text = source_of("class A:", "    def f(self):", "        def g():", *body)
    assert {found.name for found in long_functions(text)} == {"A.f", "A.f.g"}


def test_kernels_are_set_aside() -> None:
    wide = f"def f({', '.join(f'a{i}' for i in range(PARAMETERS + 1))}): pass"
    assert [found.size for found in wide_functions(source_of(wide))] == [PARAMETERS + 1]
    for decorator in ("@njit", "@numba.njit(cache=True)"):
        assert not wide_functions(source_of(decorator, wide))
    assert wide_functions(source_of("@cache", wide))
    assert not wide_functions({"part/event_kernel.py": wide})
    assert not wide_functions({"cli/simulate.py": wide})


def test_self_is_not_counted_and_keywords_are() -> None:
    listed = ", ".join(f"a{i}" for i in range(PARAMETERS - 1))
    assert not wide_functions(source_of("class A:", f"    def f(self, {listed}, **more): pass"))
    (found,) = wide_functions(source_of(f"def f({listed}, *rest, **more): pass"))
    assert found.size == PARAMETERS + 1


def test_long_files_and_large_folders_are_found() -> None:
    assert not long_files({"a.py": "x\n" * FILE_LINES})
    assert [found.path for found in long_files({"a.py": "x\n" * (FILE_LINES + 1)})] == ["a.py"]
    many = {f"part/m{i}.py": "" for i in range(FOLDER_FILES)}
    assert not large_folders(many)
    assert [found.path for found in large_folders({**many, "part/__init__.py": ""})] == ["part"]


@pytest.mark.parametrize(
    ("last", "cyclic"),
    [
        ("from modelgen.a import x", True),
        ("from modelgen import a", True),
        ("def f():\n    import modelgen.a", True),
        ("if TYPE_CHECKING:\n    from modelgen.a import x", False),
        ("if not TYPE_CHECKING:\n    from modelgen.a import x", True),
        ("from modelgen.d import x", False),
    ],
)
def test_cycles_are_found(last: str, cyclic: bool) -> None:
    texts: Sequence[tuple[str, str]] = (
        ("__init__.py", ""),
        ("a.py", "from modelgen.b.c import x"),
        ("b/__init__.py", ""),
        ("b/c.py", last),
        ("d.py", ""),
    )
    found = cycles_of(import_graph(dict(texts)))
    assert [sorted(group) for group in found] == ([["modelgen.a", "modelgen.b.c"]] if cyclic else [])


# Judgement: the constants that decide stand in one table a package, each with its reason.

# Not judgement but definitions: MATLAB's `decimate`, and the median of |e| of normal noise.
DEFINITIONS = {"DECIMATE_RIPPLE_DB", "DECIMATE_CUTOFF", "MEDIAN_OF_NORMAL"}
TABLE = "thresholds.py"


def without_reason(text: str) -> list[str]:
    """The constants of a table above which, up to the next blank line, no comment stands, nor behind them."""
    found = []
    lines = text.splitlines()
    for index, line in enumerate(lines):
        if not line[:1].isupper() or " = " not in line:
            continue
        block = [line]
        for above in reversed(lines[:index]):
            if not above:
                break
            block.append(above)
        if not any("#" in one for one in (line, *(one for one in block if one.startswith("#")))):
            found.append(line.partition(" = ")[0])
    return found


def scattered_constants(sources: Mapping[str, str]) -> list[str]:
    """Numbers with a fraction that have a name of their own in a package whose judgement is in a table."""
    packages = {path.removesuffix(TABLE) for path in sources if path.endswith("/" + TABLE)}
    found = []
    for path, text in sources.items():
        folder, _, name = path.rpartition("/")
        if folder + "/" not in packages or name == TABLE:
            continue
        for node in tree(text).body:
            if isinstance(node, ast.Assign) and isinstance(node.value, ast.Constant):
                named = ast.unparse(node.targets[0])
                if isinstance(node.value.value, float) and named not in DEFINITIONS:
                    found.append(f"modelgen/{path}: {named}")
    return found


def test_every_threshold_has_its_reason(sources: dict[str, str]) -> None:
    tables = {path: text for path, text in sources.items() if path.endswith("/" + TABLE)}
    assert len(tables) > 10
    missing = [f"modelgen/{path}: {name}" for path, text in tables.items() for name in without_reason(text)]
    assert not missing, "say above each why it is what it is:\n" + "\n".join(missing)


def test_judgement_is_in_the_tables(sources: dict[str, str]) -> None:
    assert not scattered_constants(sources)


def test_a_constant_without_a_reason_is_found() -> None:
    assert without_reason("# Why.\nA = 1.0\nB = 2.0\n\nC = 3.0\nD = 4.0  # of the step\n") == ["C"]
    table = {"part/thresholds.py": "A = 1.0"}
    assert scattered_constants({**table, "part/module.py": "B = 1.0"}) == ["modelgen/part/module.py: B"]
    assert not scattered_constants({"part/module.py": "B = 1.0"})
    assert not scattered_constants({**table, "other/module.py": "B = 1.0\nC = 1"})


ARRAYS = re.compile(r"\b(?:Float|Complex|Int|Bool)Array\b|\bNDArray\b|\bndarray\b|\bArrayLike\b")
# "shape (n,)", or the shape alone where a name stands before it: "the residual, (n,)", "(lines,) each"
SHAPE = re.compile(r"\b[Ss]hapes?\b|\((?:\w|[ *+-])+,\)|\((?:\w|[ *+-])+(?:, (?:\w|[ *+-])+)+\)")


def public_functions(text: str) -> Iterator[tuple[str, Function]]:
    """Functions and methods that may be called from outside: no underscore in their name or their class's."""

    def inside(nodes: Sequence[ast.stmt], prefix: str) -> Iterator[tuple[str, Function]]:
        for node in nodes:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                yield from inside(node.body, f"{prefix}{node.name}.")
            elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and not node.name.startswith("_"):
                yield prefix + node.name, node

    return inside(tree(text).body, "")


def takes_arrays(node: Function, arrays: re.Pattern[str] = ARRAYS) -> bool:
    arguments = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
    given = [one.annotation for one in arguments] + [node.returns]
    return any(arrays.search(ast.unparse(one)) for one in given if one is not None)


def test_public_functions_state_the_shapes_of_their_arrays(sources: Mapping[str, str]) -> None:
    silent, stated = [], 0
    for path, text in sources.items():
        for name, node in public_functions(text):
            if not takes_arrays(node):
                continue
            if SHAPE.search(ast.get_docstring(node) or ""):
                stated += 1
            else:
                silent.append(f"modelgen/{path}: {name}")
    assert stated > 300
    assert not silent


# A unit, that there is none, or that any will do ("in their unit"); or what is counted
UNIT = re.compile(
    r"\bSI\b|\bHz\b|\brad\b|\bN m\b|\b(?:in|per) (?:s|m|samples)\b|\[(?:s|m)\]|\b[Uu]nits?\b|\b[Ii]nstants\b"
    r"|\bseconds\b|\bdegrees\b|\bsamples\b|\b[Ss]hares?\b|\brelative\b|\bdimensionless\b|\bdeviations\b|\blags\b"
)
NAMED_UNIT = re.compile(r"_(?:hz|s|ms|rad|deg)$")
FLOATS = re.compile(r"\b(?:Float|Complex)Array\b|\bNDArray\b|\bndarray\b|\bArrayLike\b")
# Arrays in there are matrices, of whatever stands in them.
WITHOUT_UNITS = "runtime/numerics/"


def documented(text: str) -> Iterator[tuple[str, Function, str]]:
    """Public functions and methods with what their docstring, and that of their class, says."""
    classes = {one.name: one for one in tree(text).body if isinstance(one, ast.ClassDef)}
    for name, node in public_functions(text):
        owner = classes.get(name.partition(".")[0])
        said = [ast.get_docstring(one) or "" for one in (node, owner) if one is not None]
        yield name, node, "\n".join(said)


def without_unit(text: str) -> list[str]:
    """The public functions with arrays of floats that do not say in which unit these are."""
    return [
        name
        for name, node, said in documented(text)
        if takes_arrays(node, FLOATS)
        and not UNIT.search(said)
        and not any(NAMED_UNIT.search(one.arg) for one in (*node.args.args, *node.args.kwonlyargs))
    ]


def test_public_functions_state_the_units_of_their_arrays(sources: Mapping[str, str]) -> None:
    outside = {path: text for path, text in sources.items() if not path.startswith(WITHOUT_UNITS)}
    silent = [f"modelgen/{path}: {name}" for path, text in outside.items() for name in without_unit(text)]
    assert not silent, "say in which unit (SI, the row's, any) their arrays are:\n" + "\n".join(silent)


@pytest.mark.parametrize(
    ("argument", "said", "found"),
    [
        ("x: FloatArray", "Return the mean, shape (n,).", True),
        ("x: FloatArray", "Return the mean of one sample, shape (n,), of the same sign.", True),
        ("x: FloatArray", "Return the mean, in SI, shape (n,).", False),
        ("x: FloatArray", "Return the mean, in their unit, shape (n,).", False),
        ("time_s: FloatArray", "Return the mean, shape (n,).", False),
        ("x: IntArray", "Return the mean, shape (n,).", False),
        ("x: float", "Return the mean.", False),
    ],
)
def test_arrays_without_a_unit_are_found(argument: str, said: str, found: bool) -> None:
    assert without_unit(f'def f({argument}):\n    """{said}"""') == ["f"] * found
    method = f'class A:\n    """Arrays{{}}."""\n\n    def f(self, {argument}):\n        """{said}"""'
    assert without_unit(method.format("")) == ["A.f"] * found
    assert not without_unit(method.format(", in SI"))
