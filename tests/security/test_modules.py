"""Hostile modules: sealed by whoever made them, and still refused before a line of them runs."""

from __future__ import annotations

import codecs
from pathlib import Path

import pytest

from modelgen.errors import DataError, RenderError
from modelgen.generated_module.module_check import LISTED, module_problems, seal
from modelgen.render.environment import environment
from modelgen.render.writer import generate
from modelgen.runtime.model.model import load_model, model_from_text
from modelgen.spec.load import catalog_path, load_spec

TEXT = generate(load_spec(catalog_path("emps_rigid")), "qm")
PWN = "open('pwned', 'w').close()"
CLASS = "class StateSpace(NamedTuple):\n    'x'\n"
IDENTIFY = "def identify(records, **options):\n    'x'\n"
SEAL_LINE = next(line for line in TEXT.splitlines() if "of this file" in line)
NESTED = f"{TEXT}\nTITLE = {'-' * 100_000}1\n"
BRACKETS = f"{TEXT}\nTITLE = {'(' * 5000}{')' * 5000}\n"
COOKIE = f"# -*- coding: utf-7 -*-\n+AG8AcABlAG4-('pwned','w')\n{TEXT}"
UNREADABLE = "cannot be parsed|is no valid Python"  # as the version of Python has it

APPENDED = {  # statements below a good module, and the message
    "call": (PWN, "holds a node Expr"),
    "print": ("print(1)", "holds a node Expr"),
    "import os": ("import os", "imports more than NumPy"),
    "import sys": ("import sys", "imports more than NumPy"),
    "from os": ("from os import system", "imports more than NumPy"),
    "numpy by another name": ("import numpy", "imports more than NumPy"),
    "part of numpy": ("from numpy import load", "imports more than NumPy"),
    "star": ("from numpy import *", "imports more than NumPy"),
    "relative import": ("from . import x", "imports more than NumPy"),
    "second docstring": ("'text'", "holds a node Expr"),
    "other constant": ("SECRET = 1", "holds a node Assign"),
    "constant that computes": (f"TITLE = {PWN}", "computes TITLE when it is imported"),
    "f-string": ("TITLE = f'{open}'", "computes TITLE"),
    "comprehension": ("TITLE = [0 for _ in ()]", "computes TITLE"),
    "multiplication bomb": ("TITLE = 'x' * 10**10", "computes TITLE"),
    "power bomb": ("TITLE = 9**9**9", "computes TITLE"),
    "walrus": ("TITLE = (x := 1)", "computes TITLE"),
    "name": ("TITLE = np", "computes TITLE"),
    "two targets": ("TITLE = CHAIN = 'x'", "holds a node Assign"),
    "unpacking": ("TITLE, CHAIN = 'xy'", "holds a node Assign"),
    "attribute": ("np.zeros = 1", "holds a node Assign"),
    "annotation": (f"TITLE: {PWN} = 'x'", "holds a node AnnAssign"),
    "augmented": ("TITLE += 'x'", "holds a node AugAssign"),
    "if": ("if True:\n    import os", "holds a node If"),
    "try": ("try:\n    import os\nexcept Exception: pass", "holds a node Try"),
    "with": ("with open('pwned', 'w'): pass", "holds a node With"),
    "while": ("while True: pass", "holds a node While"),
    "for": ("for x in range(10): pass", "holds a node For"),
    "raise": ("raise SystemExit", "holds a node Raise"),
    "assert": (f"assert {PWN} is None", "holds a node Assert"),
    "delete": ("del TITLE", "holds a node Delete"),
    "async": ("async def columns(): pass", "holds a node AsyncFunctionDef"),
    "other function": ("def helper(): pass", "holds a node FunctionDef"),
    "module getattr": (f"def __getattr__(name):\n    {PWN}", "holds a node FunctionDef"),
    "other class": ("class Model: pass", "holds a node ClassDef"),
    "metaclass": ("class StateSpace(NamedTuple, metaclass=print):\n    'x'", "holds a node ClassDef"),
    "class with a call": (
        f"class StateSpace(NamedTuple):\n    'x'\n    {PWN}",
        "changes the class StateSpace",
    ),
    "class with a value": (
        "class StateSpace(NamedTuple):\n    'x'\n    A: np.ndarray = np.zeros(1)",
        "changes the class",
    ),
    "class decorator": ("@print\nclass StateSpace(NamedTuple):\n    'x'", "holds a node ClassDef"),
    "decorator": (f"@{PWN}\ndef columns(): return 1", "has a decorator, an annotation or a default"),
    "default": (f"def columns(x={PWN}): return 1", "has a decorator, an annotation or a default"),
    "keyword default": (f"def columns(*, x={PWN}): return 1", "has a decorator, an annotation or a default"),
    "return annotation": (f"def columns() -> {PWN}: return 1", "has a decorator, an annotation or a default"),
    "argument annotation": (f"def columns(x: {PWN}): return 1", "has the unusual argument x"),
    "identify that does more": (
        f"def identify(records, **options):\n    'x'\n    {PWN}",
        "changes the function identify",
    ),
    "identify with a default": (
        "def identify(records=print(1), **options):\n    'x'",
        "changes the function identify",
    ),
}
WITHIN = {  # the body of columns(), and the message
    "open": (PWN, "uses the name open"),
    "eval": ("return eval('1')", "uses the name eval"),
    "exec": ("exec('1')", "uses the name exec"),
    "compile": ("return compile('1', '', 'eval')", "uses the name compile"),
    "import function": ("return __import__('os')", "uses the name __import__"),
    "builtins": ("return __builtins__", "uses the name __builtins__"),
    "getattr": ("return getattr(np, 'load')", "uses the name getattr"),
    "globals": ("return globals()", "uses the name globals"),
    "vars": ("return vars(np)", "uses the name vars"),
    "input": ("return input()", "uses the name input"),
    "breakpoint": ("breakpoint()", "uses the name breakpoint"),
    "import within": ("import os", "holds a node Import"),
    "import from within": ("from os import system", "holds a node ImportFrom"),
    "numpy load": ("return np.load('x.npy', allow_pickle=True)", "uses the attribute load"),
    "numpy save": ("np.save('pwned', 1)", "uses the attribute save"),
    "numpy tofile": ("np.zeros(1).tofile('pwned')", "uses the attribute tofile"),
    "numpy ctypes": ("return np.ctypeslib", "uses the attribute ctypeslib"),
    "numpy f2py": ("return np.f2py.compile", "uses the attribute f2py"),
    "numpy to os": ("return np.os.system('x')", "uses the attribute os"),
    "class": ("return ().__class__", "uses the attribute __class__"),
    "globals of a function": ("return columns.__globals__", "uses the attribute __globals__"),
    "code of a function": ("columns.__code__ = None", "uses the attribute __code__"),
    "format": ("return '{0.__class__}'.format(1)", "uses the attribute format"),
    "patched numpy": ("np.zeros = abs", "uses the attribute zeros"),
    "lambda": ("return (lambda: 1)()", "holds a node Lambda"),
    "global": ("global TITLE", "holds a node Global"),
    "yield": ("yield 1", "holds a node Yield"),
    "walrus within": ("return (x := 1)", "holds a node NamedExpr"),
    "f-string within": ("return f'{1}'", "holds a node JoinedStr"),
    "star": ("return abs(*[1])", "holds a node Starred"),
    "bytes": ("return b'x'", "holds b'x'"),
    "try within": ("try:\n        return 1\n    finally:\n        return 2", "holds a node Try"),
    "dunder name": ("__builtins__ = 1", "uses the name __builtins__"),
}


@pytest.mark.parametrize("name", APPENDED)
def test_a_statement_that_modelgen_does_not_write(trap: Path, name: str) -> None:
    code, message = APPENDED[name]
    refused(trap, seal(f"{TEXT}\n\n{code}\n"), message)


@pytest.mark.parametrize("name", WITHIN)
def test_a_function_that_does_what_modelgen_does_not_write(trap: Path, name: str) -> None:
    code, message = WITHIN[name]
    refused(trap, seal(f"{TEXT}\n\ndef columns():\n    {code}\n"), message)


WHOLE = {
    "empty": (b"", "does not say that modelgen generated this file"),
    "script": (PWN.encode(), "does not say that modelgen generated this file"),
    "header in a string": (f"'''{TEXT}'''; {PWN}".encode(), "another digest"),
    "header in a docstring": (
        b'"""\n# Generated by modelgen from a.toml (SHA-256 0).\n"""\n',
        "does not say",
    ),
    "no digest": (TEXT.replace("# SHA-256 of this file", "# SHA-1").encode(), "has no digest of the file"),
    "two digests": (
        (TEXT + "\n" + next(x for x in TEXT.splitlines() if "of this file" in x)).encode(),
        "no digest",
    ),
    "changed number": (TEXT.replace("1.0", "2.0", 1).encode(), "was changed after it was generated"),
    "one line more": (TEXT.encode() + b"\n# more\n", "was changed after it was generated"),
    "cut short": (TEXT.encode()[:-100], "was changed after it was generated"),
    "broken syntax": (seal(TEXT + "\nx = (\n").encode(), "is no valid Python"),
    "null byte": (seal(TEXT + "\x00").encode(), UNREADABLE),
    "deep nesting": (
        seal(TEXT + "\nTITLE = " + "-" * 100_000 + "1\n").encode(),
        "cannot be parsed|is no valid Python",
    ),
    "many brackets": (
        seal(TEXT + "\nTITLE = " + "(" * 5000 + ")" * 5000 + "\n").encode(),
        "no valid Python|parsed",
    ),
    "utf-16": (codecs.BOM_UTF16 + TEXT.encode("utf-16-le"), "cannot be read"),
    "latin-1": (b"# -*- coding: latin-1 -*-\n# \xe9\n" + TEXT.encode(), "cannot be read"),
    "coding cookie": (
        seal("# -*- coding: utf-7 -*-\n+AG8AcABlAG4-('pwned','w')\n" + TEXT).encode(),
        "no valid|does not",
    ),
    "pickle": (b"\x80\x04cos\nsystem\n(S'touch pwned'\ntR.", "cannot be read"),
    "bytecode": (b"\xa7\r\r\n" + bytes(100), "cannot be read"),
}


@pytest.mark.parametrize("name", WHOLE)
def test_a_file_that_is_no_generated_module(trap: Path, name: str) -> None:
    content, message = WHOLE[name]
    path = trap / "model.py"
    path.write_bytes(content)
    with pytest.raises(DataError, match=message) as caught:
        load_model(path)
    assert all("model.py" in problem.where for problem in caught.value.problems)


def test_line_ends_of_another_system_are_no_change(trap: Path) -> None:
    path = trap / "model.py"
    path.write_bytes(TEXT.replace("\n", "\r\n").encode())
    assert load_model(path).chain == "emps_rigid"


def test_a_foreign_file_runs_with_trust_only(trap: Path) -> None:
    path = trap / "model.py"
    path.write_text(TEXT + "\nTITLE = str(6 * 7)\n")
    with pytest.raises(DataError, match=r"pass trust=True \(--trust\) if you know the file"):
        load_model(path)
    assert load_model(path, trust=True).title == "42"


def test_text_in_memory_is_checked_as_well() -> None:
    with pytest.raises(DataError, match="holds a node Expr"):
        model_from_text(seal(f"{TEXT}\n\n{PWN}\n"))


def test_a_long_foreign_script_gives_a_short_message() -> None:
    assert len(module_problems(seal(TEXT + "\nx = 1" * 1000))) == LISTED


def test_nothing_outside_the_allow_list_is_ever_rendered(monkeypatch: pytest.MonkeyPatch) -> None:
    env = environment()
    source, _, _ = env.loader.get_source(env, "module.py.j2")  # type: ignore[union-attr]
    altered = env.from_string(source + "\nimport os\n")
    monkeypatch.setattr("jinja2.Environment.get_template", lambda self, name: altered)
    with pytest.raises(
        RenderError, match=r"module emps_rigid_qm, line \d+: imports more than NumPy \(import os\)"
    ):
        generate(load_spec(catalog_path("emps_rigid")), "qm")


def refused(folder: Path, text: str, message: str) -> None:
    path = folder / "model.py"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(DataError) as caught:
        load_model(path)
    assert message in str(caught.value)
    assert "model.py: line " in str(caught.value)
