"""Hostile modules: sealed by whoever made them, and still refused before a line of them runs."""

from __future__ import annotations

import codecs
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from modelgen.errors import DataError, RenderError
from modelgen.generated_module.module_check import module_problems, seal
from modelgen.read_file import MODULE, InputKind
from modelgen.render.environment import environment
from modelgen.render.writer import generate
from modelgen.runtime.model.model import load_model, model_from_text
from modelgen.spec.load import catalog_path, load_spec
from tests.security.module_mutants import EXPRESSIONS, LITERALS, STATEMENTS, TEXTS, sized

ROOT = Path(__file__).resolve().parents[2]
TEXT = generate(load_spec(catalog_path("emps_rigid")), "qm")
MOTOR, CARRIAGE, UNSEEN, CUBIC, SEEN = TEXTS
PWN = "open('pwned', 'w').close()"


# What the generator writes ------------------------------------------------------------------------


def test_nothing_outside_the_skeleton_is_ever_rendered(monkeypatch: pytest.MonkeyPatch) -> None:
    env = environment()
    source, _, _ = env.loader.get_source(env, "module.py.j2")  # type: ignore[union-attr]
    altered = env.from_string(source + "\nimport os\n")
    get = type(env).get_template
    monkeypatch.setattr(
        "jinja2.Environment.get_template",
        lambda self, name, *more: altered if name == "module.py.j2" else get(self, name, *more),
    )
    with pytest.raises(RenderError) as caught:
        generate(load_spec(catalog_path("emps_rigid")), "qm")
    (problem,) = caught.value.problems
    last = TEXT.count("\n") + 1
    assert problem.where == f"module emps_rigid_qm, line {last}"
    assert problem.what == "has an empty line where modelgen writes nothing more"
    assert problem.remedy == "report what it was made from: modelgen must not write such a module"


def test_a_chain_that_is_too_large_is_told_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("modelgen.generated_module.module_check.MODULE", InputKind(1000, ""))
    with pytest.raises(
        RenderError, match=r"file: is larger than 0\.001 MB; describe the machine with fewer bodies"
    ):
        generate(load_spec(catalog_path("emps_rigid")), "qm")


# Foreign code anywhere ----------------------------------------------------------------------------


def code_lines(text: str) -> Iterator[int]:
    """Yield the places of the lines that are no inner line of a docstring."""
    inside = False
    for place, line in enumerate(text.splitlines()):
        if not inside:
            yield place
        inside ^= line.count('"""') == 1


@pytest.mark.slow
@pytest.mark.parametrize("text", TEXTS)
def test_a_statement_before_any_line_is_refused_there(text: str) -> None:
    lines = text.splitlines(keepends=True)
    foreign = [s for s in STATEMENTS if s not in ("1", "'text'")]  # a literal may hold these
    for number, place in enumerate([*code_lines(text), len(lines)]):
        statement = foreign[number % len(foreign)]
        indent = re.match(" *", lines[place] if place < len(lines) else "")[0]  # type: ignore[index]
        code = "".join(f"{indent}{line}\n" for line in statement.splitlines())
        changed = "".join((*lines[:place], code, *lines[place:]))
        (problem,) = module_problems(seal(changed))
        # a literal, and a direction with its line, are told where they begin
        assert int(problem.where.removeprefix("line ")) <= place + 1, statement
        inner = lines[place : place + 1] and lines[place].startswith("        ")
        assert inner or lines[place : place + 1] == ["}\n"] or problem.where == f"line {place + 1}", statement


@pytest.mark.slow
@pytest.mark.parametrize("text", TEXTS)
def test_an_expression_in_place_of_any_value_is_refused(text: str) -> None:
    # numbers, keys and names that the generator writes too are no foreign code
    foreign = [e for e in EXPRESSIONS if e not in ("True", "None", "0.5", "-1.0", "'q_m'", "'a' 'b'")]
    values = r"""(?<=[ (])(?:\d+\.\d+|'\w+'|[sfpd]\["\w+"\]|\d+)(?=[,)\n ])"""
    texts = [found.span() for found in re.finditer(r'""".*?"""|^#[^\n]*', text, re.DOTALL | re.MULTILINE)]
    places = [
        spot
        for spot in re.finditer(values, text)
        if not any(start < spot.start() < end for start, end in texts)
    ]
    assert len(places) > 30
    for number, spot in enumerate(places):
        expression = foreign[number % len(foreign)]
        changed = text[: spot.start()] + expression + text[spot.end() :]
        assert module_problems(seal(changed)), changed[spot.start() - 30 : spot.end() + 60]


@pytest.mark.parametrize("text", TEXTS)
def test_a_line_that_is_missing_is_noticed_where_it_must_stand(text: str) -> None:
    lines = text.splitlines(keepends=True)
    formula = re.compile(r" +([A-Fy]\[.*|\"[^\"]+\": .*|p\[.*,|if d.*|[-(0-9].*,|f = .*|[\]'].*|.*[,}])$")
    for place in code_lines(text):
        if formula.match(lines[place]) or lines[place].startswith("CUBIC"):
            continue
        (problem,) = module_problems(seal("".join((*lines[:place], *lines[place + 1 :])))) or [None]
        assert problem is not None, lines[place]
        assert problem.where == "header" or int(problem.where.removeprefix("line ")) <= place + 2


NAMED = {  # ways of old: a name bound in one place and called in another, what an annotation evaluates
    "comprehension variable": (
        "    s = signals\n    return {\n",
        "    s = [0 for exec in ()]\n    exec('import os')\n    return {\n",
    ),
    "argument": ("def regressor(signals):", "def regressor(signals, open=None):"),
    "argument of another function": ("def base_from_physical(parameters):", "def base_from_physical(open):"),
    "call of an argument": ("    D = np.zeros(", f"    {PWN}\n    D = np.zeros("),
    "target of an annotation": ("    F: np.ndarray", "    __import__('os').system('id').x: np.ndarray"),
    "value of a field": ("    F: np.ndarray", "    F: np.ndarray = np.load('x')"),
    "base class": ("class StateSpace(NamedTuple):", "class StateSpace(NamedTuple, metaclass=print):"),
    "decorator": ("def columns():", f"@{PWN}\ndef columns():"),
    "default": ("directions=None", f"directions={PWN}"),
    "return annotation": ("def columns():", f"def columns() -> {PWN}:"),
    "type parameters": ("def columns():", f"def columns[T: {PWN}]():"),
    "import": ("import numpy as np\n", "import numpy as np\nimport os\n"),
    "numpy by another name": ("import numpy as np\n", "import os as np\n"),
    "constant that computes": ("CONTRACT_VERSION = 1", "CONTRACT_VERSION = 2 - 1"),
    "unary operators": ("CONTRACT_VERSION = 1", "CONTRACT_VERSION = --1"),
    "f-string": ("CHAIN = '", "CHAIN = f'{open}"),
    "call of a text": ("ABSENT = {}", "ABSENT = 'x'({})"),
    "power bomb": ("1.0 / p[", "9**9**9 / p["),
    "range bomb": ("in range(24)", "in range(10**18)"),
    "array bomb": (", 1, 3))", ", 100000, 100000))"),
    "repeated text": ("ABSENT = {}", "ABSENT = {'x' * 10**10: 'x'}"),
    "exponent": ('p["J_m"]', 'p["J_m"] ** 999999999'),
    "number without end": ("1.0 / p[", f"{'9' * 5000}.0 / p["),
    "infinite number": ("1.0 / p[", "1e999 / p["),
    "carriage return": ("    return y", "    return y\r    open('pwned')"),
    "form feed": ("    return y", "\x0c    return y"),
    "wide digits": ("y[:, 0]", "y[:, \uff10]"),
    "docstring that ends": ('"""Return the left', '"""x"""; open(\'pwned\')  # """Return the left'),
    "docstring with an escape": ('"""Return the left', '"""\\x00Return the left'),
    "docstring in another script": ('"""Return the left', '"""\u202eReturn the left'),
    "comment": ("import numpy as np\n", "# -*- coding: utf-7 -*-\nimport numpy as np\n"),
    "line that goes on": ("import numpy as np\n", "import numpy as \\\n np\n"),
    "semicolon": ("    return y\n", "    return y; open('pwned')\n"),
    "blanks at the end": ("    return y\n", "    return y \n"),
    "tabs": ("    return y\n", "\treturn y\n"),
}


@pytest.mark.parametrize("name", NAMED)
def test_code_in_a_hidden_place_is_refused(trap: Path, name: str) -> None:
    old, new = NAMED[name]
    assert any(old in text for text in (UNSEEN, MOTOR))
    for text in TEXTS:
        changed = seal(text.replace(old, new, 1))
        if old in text:
            path = trap / "model.py"
            path.write_bytes(changed.encode())
            with pytest.raises(
                DataError, match=r"model\.py: line \d+: .+; generate the module again \(modelgen"
            ):
                load_model(path)


# Sizes --------------------------------------------------------------------------------------------


HUGE = {
    "bytes": lambda: "#" * (MODULE.largest + 1),
    "lines": lambda: TEXT + "x\n" * 2_000_000,
    "empty lines": lambda: TEXT + "\n" * 4_000_000,
    "minus signs": lambda: TEXT.replace("ABSENT = {}", f"ABSENT = {'-' * 1_000_000}1"),
    "brackets": lambda: TEXT.replace("ABSENT = {}", f"ABSENT = {'(' * 1_000_000}"),
    "closed brackets": lambda: TEXT.replace("ABSENT = {}", f"ABSENT = {'(' * 5000}{')' * 5000}"),
    "braces": lambda: TEXT.replace("ABSENT = {}", f"ABSENT = {'{1:' * 1_000_000}"),
    "numbers": lambda: TEXT.replace("ABSENT = {}", f"ABSENT = ({'1,' * 2_000_000})"),
    "texts": lambda: TEXT.replace("ABSENT = {}", f"ABSENT = ({chr(39) * 4_000_000})"),
    "digits": lambda: TEXT.replace("ABSENT = {}", f"ABSENT = {'9' * 4_000_000}"),
    "quotes": lambda: TEXT.replace("ABSENT = {}", f"ABSENT = {chr(39) * 4_000_001}"),
    "blanks": lambda: TEXT.replace("ABSENT = {}", f"ABSENT = {' ' * 4_000_000}"),
    "title": lambda: TEXT.replace("TITLE = ", f"TITLE = {'(' * 4_000_000}"),
    "docstring": lambda: TEXT + '"' * 4_000_000,
    "sum": lambda: TEXT.replace("return y", f"y[:, 0] = 1.0{' + 1.0' * 700_000}\n    return y"),
    "product": lambda: TEXT.replace("1.0 / p", f"{'1.0 * ' * 700_000} / p"),
    "powers": lambda: TEXT.replace('p["M"],', f'p["M"]{" * p[" + chr(34) + "M" + chr(34) + "]"} ' * 300_000),
    "arrays": lambda: sized(200_000, 200_000),
    "formulas": lambda: TEXT.replace("    return y", '    y[:, 0] = s["x"]\n' * 200_000 + "    return y"),
    "lines of code": lambda: TEXT.replace(
        "    return y", '    y[:, 0] = s["F"]\n' * 190_000 + "    return y"
    ),
    "header": lambda: "# Generated by modelgen from " * 150_000,
    "digests": lambda: SEAL_LINE * 40_000,
}
SEAL_LINE = next(line for line in TEXT.splitlines(keepends=True) if "of this file" in line)
LOAD = (
    "import re, sys, time\n"
    "from modelgen.errors import DataError\n"
    "from modelgen.runtime.model.model import load_model\n"
    "for path in sys.argv[1:]:\n"
    "    began = time.process_time()\n"
    "    try: load_model(path)\n"
    "    except DataError as error: assert time.process_time() - began < 5.0, path; print(str(error)[:300])\n"
    # not ru_maxrss, which begins with that of the process that started this one
    "print(int(re.search(r'VmHWM:\\s+(\\d+)', open('/proc/self/status').read())[1]) // 1024)\n"
)


@pytest.mark.slow
def test_huge_texts_end_with_a_message_in_little_time_and_memory(processes: Path) -> None:
    for name, make in HUGE.items():  # not named like a module that is imported
        (processes / f"huge {name}.py").write_text(seal(make()), encoding="utf-8")
    command = [sys.executable, "-c", LOAD, *(f"huge {name}.py" for name in HUGE)]
    done = subprocess.run(
        command,
        capture_output=True,
        text=True,
        check=True,
        timeout=5 * len(HUGE),
        env={"PYTHONPATH": str(ROOT)},
    )
    *messages, megabytes = done.stdout.splitlines()
    assert done.stderr == ""
    assert [message.partition(".py: ")[0] for message in messages] == [f"huge {name}" for name in HUGE]
    assert int(megabytes) < 500


# Literals of any form -----------------------------------------------------------------------------

ODD = (
    "()",
    "{}",
    "None",
    "True",
    "5",
    "-1.5",
    "'x'",
    "(5,)",
    "((),)",
    "({},)",
    "{'x': 5}",
    "{'x': {}}",
    "{5: 'x'}",
)
ODD = (
    *ODD,
    "({'key': 5},)",
    "{'x': {'role': 'inertia'}}",
    "{'x': {'role': 'inertia', 'bodies': 5}}",
    "({5: 5},)",
)


@pytest.mark.parametrize("name", LITERALS)
def test_a_literal_of_any_other_form_is_told_as_well(name: str) -> None:
    for text in (MOTOR, CARRIAGE, SEEN):
        start = text.index(f"\n{name} = ") + 1
        end = re.compile(r"\n(?! )").search(text, start).start()  # type: ignore[union-attr]
        for odd in ODD:
            changed = seal(f"{text[:start]}{name} = {odd}{text[end:]}")
            try:
                model_from_text(changed)
            except DataError as error:
                assert all(problem.what and problem.remedy for problem in error.problems)


# The header and the seal --------------------------------------------------------------------------

WHOLE = {
    "empty": (b"", "does not say that modelgen generated this file"),
    "script": (PWN.encode(), "does not say that modelgen generated this file"),
    "header in a string": (f"'''{TEXT}'''; {PWN}".encode(), "another digest"),
    "header in a docstring": (
        b'"""\n# Generated by modelgen from a.toml (SHA-256 0).\n"""\n',
        "does not say",
    ),
    "no digest": (TEXT.replace("# SHA-256 of this file", "# SHA-1").encode(), "has no digest of the file"),
    "two digests": ((TEXT + "\n" + SEAL_LINE).encode(), "no digest"),
    "changed number": (TEXT.replace("1.0", "2.0", 1).encode(), "was changed after it was generated"),
    "one line more": (TEXT.encode() + b"\n# more\n", "was changed after it was generated"),
    "cut short": (TEXT.encode()[:-100], "was changed after it was generated"),
    "broken syntax": (seal(TEXT + "\nx = (\n").encode(), "line 1[0-9]+: has an empty line where"),
    "null byte": (seal(TEXT + "\x00").encode(), "holds null bytes"),
    "written anew": (seal(TEXT.replace("'", '"')).encode(), "where modelgen writes"),
    "utf-16": (codecs.BOM_UTF16 + TEXT.encode("utf-16-le"), "not UTF-8 text"),
    "latin-1": (b"# -*- coding: latin-1 -*-\n# \xe9\n" + TEXT.encode(), "not UTF-8 text"),
    "coding cookie": (
        seal("# -*- coding: utf-7 -*-\n+AG8AcABlAG4-('pwned','w')\n" + TEXT).encode(),
        "line 1: holds '# -\\*- coding: utf-7 -\\*-' where modelgen writes",
    ),
    "pickle": (b"\x80\x04cos\nsystem\n(S'touch pwned'\ntR.", "not UTF-8 text"),
    "bytecode": (b"\xa7\r\r\n" + bytes(100), "not UTF-8 text"),
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


def test_a_file_that_is_too_large_is_not_executed_in_part(trap: Path) -> None:
    path = trap / "model.py"
    path.write_text(TEXT + "#" * MODULE.largest)
    for trust in (False, True):
        with pytest.raises(DataError, match=r"model\.py: is larger than 5 MB"):
            load_model(path, trust=trust)


def test_text_in_memory_is_checked_as_well() -> None:
    with pytest.raises(DataError, match="where modelgen writes nothing more"):
        model_from_text(seal(f"{TEXT}{PWN}\n"))


# What follows ------------------------------------------------------------------------------------

HOLLOW = {  # accepted, and then told: functions that raise, or that do not do what the module says
    "line left out": ('    D[:, 0, 1] = s["d1_q_m"]\n', "", "column 1: differs from columns"),
    "other formula": ('= s["d2_q_m"]', '= -s["d2_q_m"]', "column 0: differs from columns"),
    "no features": ("    f = features(signals)\n    D", "    D", "raise NameError"),
    "division by zero": (
        '            p["J"],',
        '            (p["J"]) / (p["J"] - p["J"]),',
        "raise ZeroDivisionError",
    ),
    "huge numbers": ('            p["J"],', '            1e+300 * p["J"] * p["J"] ** 99,', ""),
    "infinite signals": ('= s["d2_q_m"]', '= 1e+308 * s["d2_q_m"] + 1.0 * s["T"]', "differs from columns"),
    "base parameter left out": ('            p["J"],\n', "", "functions: raise IndexError"),
    "parameter left out": ('        "J": float(base[0]),\n', "", "physical_from_base(): does not return"),
    "derivative": ("'derivative': 2", "'derivative': 100", "not an integer from 0 to 99"),
    "huge derivative": ("'order': 2", "'order': 999999", "not an integer from 0 to 99"),
    "state": ("'state': 1", "'state': 2", "FRICTION[0]['state']: is no velocity of the 1 bodies"),
    "position": ("'state': 1", "'state': 0", "FRICTION[0]['state']: is no velocity of the 1 bodies"),
}


@pytest.mark.parametrize("name", HOLLOW)
def test_an_accepted_module_that_is_no_model_is_told(name: str) -> None:
    old, new, message = HOLLOW[name]
    assert old in MOTOR
    text = seal(MOTOR.replace(old, new))
    assert module_problems(text) == []
    if message:
        with pytest.raises(DataError, match=re.escape(message)):
            model_from_text(text)
    else:
        model_from_text(text)
