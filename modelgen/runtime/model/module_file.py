"""Execute the text of one generated module, from a file or from memory."""

from __future__ import annotations

import hashlib
import importlib.util
import os
import re
import sys
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import CodeType, ModuleType

from modelgen.errors import DataError, Problem
from modelgen.generated_module.module_check import module_problems, module_text
from modelgen.read_file import MODULE, read_text

TRUST = "check the path, or pass trust=True (--trust) if you know the file: loading a module executes it"
MADE_BY = "__made_by__"  # in such a module: a function and its arguments that make it again


class _TextLoader(SourceFileLoader):
    """Loads the very text that was checked, past the bytecode cache and a coding cookie.

    The cache compares seconds and sizes: a module generated twice within a second would be served stale.
    """

    def __init__(self, name: str, path: str, text: str) -> None:
        super().__init__(name, path)
        self._text = text

    def get_code(self, fullname: str) -> CodeType:
        # as text: a coding cookie in bytes could turn what was checked into something else
        return compile(self._text, self.path, "exec", dont_inherit=True)


def execute_file(path: Path, trust: bool = False) -> ModuleType:
    """Execute a generated ``.py`` file and return its module; without `trust` after `refuse_foreign` only.

    The module is kept in ``sys.modules`` under a name derived from the path; the import path is left alone.
    See `modelgen.runtime.model.model.load_model`.
    """
    text, where = read_module(path), str(path)
    place = str(path.resolve())
    if not trust:
        refuse_foreign(text, where)
    return _execute(_module_name(path.stem, os.fsencode(place)), place, text, where)


def read_module(path: Path) -> str:
    """Return the text of a module's file, which `execute_text` takes.

    Raises
    ------
    DataError
        When it is no ``.py`` file, or cannot be read.
    """
    if path.suffix != ".py":
        raise DataError.at(str(path), "is no .py file", "give the module that modelgen generate has written")
    return module_text(read_text(path, MODULE))


def execute_text(text: str, name: str, trust: bool = False) -> ModuleType:
    """Execute a generated module's text and return its module, kept in ``sys.modules`` like a file's."""
    text = module_text(text)
    if not trust:
        refuse_foreign(text, name)
    return _execute(_module_name(name, text.encode()), f"<{name}>", text, where=name)


def refuse_foreign(text: str, where: str) -> None:
    """Refuse a text that modelgen did not write, or not like this.

    Raises
    ------
    DataError
        With the first things that a generated module would not hold.
    """
    problems = module_problems(text)
    if problems:
        raise DataError(*(Problem(f"{where}: {p.where}", p.what, f"{p.remedy}; {TRUST}") for p in problems))


def _module_name(stem: str, identity: bytes) -> str:
    return f"modelgen_model_{re.sub(r'[^0-9A-Za-z_]', '_', stem)}_{hashlib.sha256(identity).hexdigest()[:12]}"


def _execute(name: str, place: str, text: str, where: str) -> ModuleType:
    loader = _TextLoader(name, place, text)
    spec = importlib.util.spec_from_loader(name, loader)
    assert spec is not None  # a loader was given
    module = importlib.util.module_from_spec(spec)
    before = sys.modules.get(name)
    # the module's own identify() looks itself up by name
    sys.modules[name] = module
    try:
        loader.exec_module(module)
    except BaseException as error:
        if before is None:
            del sys.modules[name]
        else:
            sys.modules[name] = before
        if not isinstance(error, (Exception, SystemExit)):
            raise
        remedy = "generate the module again (modelgen generate)"
        if isinstance(error, SyntaxError):
            raise DataError.at(
                f"{where}: line {error.lineno}", f"is no valid Python ({error.msg})", remedy
            ) from error
        what = f"raised {type(error).__name__} when imported ({error})"
        raise DataError.at(where, what, remedy) from error
    # no module can be pickled: another process executes the text that was checked here
    module.__dict__[MADE_BY] = (_execute, (name, place, text, where))
    return module
