"""What a generated module may consist of: its syntax, names and imports, checked on the parsed text.

Importing such a module computes nothing: outside its functions there are only literals. Inside them there is
arithmetic on arrays, and no way to reach a file, another module or the interpreter.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator

from modelgen.errors import Problem

REMEDY = "generate the module again (modelgen generate)"


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


IMPORTS = ("from typing import NamedTuple", "import numpy as np")
# The only way out of the module is fixed to the letter: statements of identify() below its docstring.
IDENTIFY = (
    "import sys",
    "import modelgen",
    "return modelgen.identify(modelgen.model_from_module(sys.modules[__name__]), records, **options)",
)
CONSTANTS = _words(
    "ABSENT ACTUATORS BASE_PARAMETERS CHAIN COMPOSITES CONTRACT_VERSION CUBIC_SPRINGS FEATURES FRICTION "
    "IDENTIFIABLE KNOWN PARAMETERS PARAMETER_SETS ROLES ROWS SENSORS SENSOR_SET SIGNALS SPEC_SHA256 "
    "TITLE UNITS"
)
FUNCTIONS = _words(
    "base_from_physical base_jacobian columns features fit_physical measurement physical_from_base regressor "
    "state_space"
)
BUILTINS = _words("abs dict float len max range zip")
ATTRIBUTES = _words(
    "T abs append array asarray astype clip cosh default_rng exp eye imag inf linalg log max ndarray "
    "normal random sign sinh solve tolist where zeros"
)
LITERALS = (ast.Constant, ast.Tuple, ast.Dict, ast.UnaryOp, ast.USub, ast.Load)
SYNTAX = (
    *LITERALS,
    *(ast.Expr, ast.Assign, ast.AugAssign, ast.Return, ast.If, ast.For, ast.Break),
    *(ast.FunctionDef, ast.arguments, ast.arg),
    *(ast.List, ast.ListComp, ast.DictComp, ast.comprehension, ast.IfExp),
    *(ast.Name, ast.Attribute, ast.Subscript, ast.Slice, ast.Store, ast.Call, ast.keyword),
    *(ast.BinOp, ast.Add, ast.Sub, ast.Mult, ast.Div, ast.Pow, ast.MatMult),
    *(ast.BoolOp, ast.Or, ast.Compare, ast.Eq, ast.Lt, ast.Gt),
)


def allow_list_problems(tree: ast.Module) -> Iterator[Problem]:
    """Report what a generated module would not contain; `where` of a problem is its line."""
    known = BUILTINS | _bound_names(tree)
    for place, statement in enumerate(tree.body):
        what = _statement_problem(statement, first=place == 0)
        if what:
            yield Problem(f"line {statement.lineno}", what, REMEDY)
        elif isinstance(statement, ast.FunctionDef) and statement.name != "identify":
            for node in ast.walk(statement):
                what = _node_problem(node, known)
                if what:
                    yield Problem(f"line {getattr(node, 'lineno', statement.lineno)}", what, REMEDY)


def _bound_names(tree: ast.Module) -> frozenset[str]:
    """Return the names that the module itself gives a value to."""
    names = {
        node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
    }
    names |= {node.arg for node in ast.walk(tree) if isinstance(node, ast.arg)}
    names |= {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.ClassDef)}
    return frozenset({*names, "np"})


def _statement_problem(statement: ast.stmt, first: bool) -> str:
    """Return what is wrong with a statement outside all functions, or an empty text."""
    if getattr(statement, "type_params", None):  # of Python 3.12
        return "has type parameters"
    match statement:
        case ast.Expr(ast.Constant(str())) if first:
            return ""
        case ast.Import() | ast.ImportFrom():
            text = ast.unparse(statement)
            return "" if text in IMPORTS else f"imports more than NumPy ({text[:80]})"
        case ast.Assign([ast.Name(name)], value) if name in CONSTANTS:
            return "" if _is_literal(value) else f"computes {name} when it is imported"
        case ast.ClassDef("StateSpace", [ast.Name("NamedTuple")], [], body, []):
            same = _is_text(body[0]) and all(map(_is_field, body[1:]))
            return "" if same else "changes the class StateSpace"
        case ast.FunctionDef(name) if name in FUNCTIONS:
            return ""
        case ast.FunctionDef("identify", arguments, [ast.Expr(ast.Constant()), *body], []):
            same = (*map(ast.unparse, body),) == IDENTIFY and ast.unparse(arguments) == "records, **options"
            return "" if same and statement.returns is None else "changes the function identify"
    return f"holds {_described(statement)} that modelgen does not write"


def _node_problem(node: ast.AST, known: frozenset[str]) -> str:
    """Return what is wrong with a part of a function, or an empty text."""
    match node:
        case ast.Attribute(_, name, ctx) if name not in ATTRIBUTES or not isinstance(ctx, ast.Load):
            return f"uses the attribute {name}"
        case ast.Name(name) if name not in known or name.startswith("__"):
            return f"uses the name {name}"
        case ast.arg(name, annotation) if annotation is not None or name.startswith("__"):
            return f"has the unusual argument {name}"
        case ast.FunctionDef(name) if node.decorator_list or node.returns or not _plain_defaults(node.args):
            return f"has a decorator, an annotation or a default in {name}"
        case ast.Constant(value) if not isinstance(value, str | int | float | complex | None):
            return f"holds {value!r}"
    return "" if isinstance(node, SYNTAX) else f"holds {_described(node)} that modelgen does not write"


def _is_literal(value: ast.expr) -> bool:
    return all(isinstance(node, LITERALS) for node in ast.walk(value))


def _is_text(statement: ast.stmt) -> bool:
    return isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)


def _is_field(statement: ast.stmt) -> bool:
    return (
        isinstance(statement, ast.AnnAssign)
        and statement.value is None
        and ast.unparse(statement.annotation) == "np.ndarray"
    )


def _plain_defaults(arguments: ast.arguments) -> bool:
    defaults = [*arguments.defaults, *(default for default in arguments.kw_defaults if default is not None)]
    return all(isinstance(default, ast.Constant) and default.value is None for default in defaults)


def _described(node: ast.AST) -> str:
    return f"a node {type(node).__name__}"
