"""The check of a module's text: what it accepts, and what it calls a deviation, to the word."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest

from modelgen.errors import Problem
from modelgen.generated_module.allow_list import (
    LARGEST_ARRAY,
    LONGEST_SUM,
    REMEDY,
    SMALLER,
    _pattern,
    _places,
    first_deviation,
)
from modelgen.generated_module.literals import LONGEST_LITERAL, declared_by, hidden_character, literal_value
from modelgen.generated_module.module_check import (
    ZEROS,
    has_header,
    module_problems,
    module_text,
    seal,
)
from modelgen.generated_module.skeleton import BODY, HEAD, IDENTIFY
from modelgen.read_file import MODULE
from modelgen.render.writer import generate
from modelgen.spec.load import catalog_path, load_spec
from tests.security.module_mutants import LITERALS, TEXTS, sized

ROOT = Path(__file__).resolve().parents[2]
TEXT = generate(load_spec(catalog_path("emps_rigid")), "qm")
SEAL_LINE = next(line for line in TEXT.splitlines(keepends=True) if "of this file" in line)
GOLDEN = [path for path in sorted((ROOT / "generated").glob("*.py")) if path.stat().st_size]
MOTOR, CARRIAGE, UNSEEN, CUBIC, SEEN = TEXTS


@pytest.mark.parametrize("path", GOLDEN, ids=lambda path: path.stem)
def test_every_module_of_the_catalogue_is_good(path: Path) -> None:
    assert module_problems(path.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize("text", TEXTS)
def test_modules_of_every_kind_are_good(text: str) -> None:
    assert module_problems(text) == []


def test_identify_reaches_the_program_in_one_way() -> None:
    source = "\n".join(line[2:] for line in IDENTIFY.splitlines()).replace("<text>", "Identify.")
    start = TEXT.index("def identify")
    assert first_deviation(TEXT[:start] + source + "\n") is None
    assert first_deviation(TEXT[:start] + source.replace("sys.modules", "modules") + "\n") is not None


@pytest.fixture(autouse=True)
def skeleton() -> None:
    """Read the skeleton anew in every test."""
    _places.cache_clear()
    _pattern.cache_clear()


TOLD = {  # of the module of a motor: the text, what stands in its place, and what is said
    "row": ("y[:, 0]", "y[:, 1]", "uses row 1 of 1, from 0"),
    "column": ("D[:, 0, 2]", "D[:, 0, 3]", "uses column 3 of 3, from 0"),
    "state": ("A[1, 1]", "A[2, 1]", "uses state 2 of 2, from 0"),
    "force": ("B[1, 0]", "B[1, 1]", "uses force 1 of 1, from 0"),
    "friction": ("E[1, 0]", "E[1, 1]", "uses friction 1 of 1, from 0"),
    "reading": ("C[0, 0]", "C[1, 0]", "uses reading 1 of 1, from 0"),
    "base parameter": ("base[2]", "base[3]", "uses column 3 of 3, from 0"),
    "rows": ('len(s["d1_q_m"]), 1))', 'len(s["d1_q_m"]), 2))', "has 2 rows, not 1"),
    "columns": ("1, 3))", "1, 4))", "has 4 columns, not 3"),
    "states": ("A = np.zeros((2, 2))", "A = np.zeros((2, 4))", "has 4 states, not 2"),
    "forces": ("B = np.zeros((2, 1))", "B = np.zeros((2, 0))", "has 0 forces, not 1"),
    "frictions": ("E = np.zeros((2, 1))", "E = np.zeros((2, 2))", "has 2 frictions, not 1"),
    "readings": ("C = np.zeros((1, 2))", "C = np.zeros((2, 2))", "has 2 readings, not 1"),
    "signal": ('s["T"] +', 's["U"] +', "names the signal 'U', which the module does not declare"),
    "length": ('(len(s["d1_q_m"]), 1, 3)', '(len(s["x"]), 1, 3)', "names the signal 'x', which the module"),
    "feature": ('= f["sign(d1_q_m)"]', '= f["sign(x)"]', "names the feature 'sign(x)', which the module"),
    "own feature": ('"sign(d1_q_m)": np', '"sign(x)": np', "names the feature 'sign(x)', which the module"),
    "parameter": (
        '1.0 / p["J"]',
        '1.0 / p["K"]',
        "names the parameter 'K', which the module does not declare",
    ),
    "estimated": ('"F_s": float', '"O": float', "names the estimated 'O', which the module does not declare"),
    "no literal": ("ABSENT = {}", "ABSENT = {}({})", "holds no literal (ValueError)"),
    "unhashable": ("ABSENT = {}", "ABSENT = {{}: 1}", "holds no literal (TypeError)"),
    "open bracket": ("ABSENT = {}", "ABSENT = (((", "holds no literal (SyntaxError)"),
    "control": ("TITLE = 'Motor ☃'", r"TITLE = 'a\x1b[2J'", "holds a text with control characters"),
    "direction": ("TITLE = 'Motor ☃'", "TITLE = 'a\u202eb'", "holds a text with control characters"),
    "two forms": (
        "    p = {**KNOWN, **parameters}\n    A",
        "    A",
        "holds 'A = np.zeros((2, 2))' where modelgen writes 'p = {**KNOWN, **parameters}'",
    ),
    "optional line": (
        "    A = np.zeros((2, 2))\n",
        "",
        "holds 'B = np.zeros((2, 1))' where modelgen writes "
        "'d = {**<directions>, **(directions or {})}' or 'A = np.zeros((<states>, <states>))'",
    ),
    "formula": (
        'y[:, 0] = s["T"] +',
        'y[:, 0] = s["T"] ^',
        """holds 'y[:, 0] = s["T"] ^ 0.25 * 1.0' where modelgen writes """
        "'y[:, <row>] = <sum of signals>' or 'return y'",
    ),
    "empty line": (
        "import numpy as np\n",
        "\n",
        "has an empty line where modelgen writes 'import numpy as np'",
    ),
    "no empty line": (
        "import numpy as np\n\n",
        "import numpy as np\n",
        "holds 'CONTRACT_VERSION = 1' where modelgen writes an empty line",
    ),
    "chain": (
        "CHAIN = 'motor'",
        "CHAIN = '../motor'",
        """holds "CHAIN = '../motor'" where modelgen writes 'CHAIN = ...'""",
    ),
    "literal": ("ABSENT = {}", "ABSENT = x", "holds 'ABSENT = x' where modelgen writes 'ABSENT = ...'"),
    "long line": (
        "    return y\n",
        f"    return {'y' * 300}\n",
        f"holds 'return {'y' * 49}' where modelgen writes 'y[:, <row>] = <sum of signals>' or 'return y'",
    ),
}


@pytest.mark.parametrize("name", TOLD)
def test_a_deviation_is_told(name: str) -> None:
    old, new, message = TOLD[name]
    assert old in MOTOR
    start = MOTOR.index(old)
    problem = first_deviation(MOTOR[:start] + new + MOTOR[start + len(old) :])
    assert problem is not None
    assert problem.what.startswith(message)
    assert problem.what == message or message.endswith("which the module")
    assert problem.where == f"line {MOTOR.count(chr(10), 0, start) + 1 + (name == 'no empty line')}"
    assert problem.remedy == REMEDY == "generate the module again (modelgen generate)"


def test_the_end_of_a_text_is_told() -> None:
    last = MOTOR.count("\n")
    assert first_deviation(MOTOR + "x = 1\n") == Problem(
        f"line {last + 1}", "holds 'x = 1' where modelgen writes nothing more", REMEDY
    )
    cut = MOTOR[: MOTOR.rindex("    return modelgen.identify")]
    problem = first_deviation(cut)
    assert problem is not None
    assert problem.what == (
        "ends where modelgen writes "
        "'return modelgen.identify(modelgen.model_from_module(sys.modules[__name__]), records, **options)'"
    )
    assert problem.where == f"line {last}"


def test_a_docstring_may_speak_of_any_name() -> None:
    assert (
        first_deviation(MOTOR.replace('"""Return the regressor', '"""Return s["x"] - f["y"], the regressor'))
        is None
    )


def test_of_two_forms_of_a_function_the_nearer_one_is_told() -> None:
    problem = first_deviation(SEEN.replace("for attempt in range(24):", "for attempt in range(25):"))
    assert problem is not None
    assert "where modelgen writes 'for attempt in range(24):'" in problem.what
    problem = first_deviation(MOTOR.replace('    return {\n        "J"', '    return {{\n        "J"'))
    assert problem is not None
    assert problem.what == "holds 'return {{' where modelgen writes 'return {'"


def test_directions_are_those_of_the_friction() -> None:
    assert first_deviation(CARRIAGE.replace('if d["m"]', 'if d["c"]', 1)) is not None
    problem = first_deviation(CARRIAGE.replace("'asymmetric': True", "'asymmetric': False"))
    assert problem is not None
    assert problem.what == "names the moved 'm', which the module does not declare"


def test_an_array_is_as_large_as_ten_million_numbers() -> None:
    assert LARGEST_ARRAY == 2500 * 4000
    assert first_deviation(sized(2500, 4000)) is None
    problem = first_deviation(sized(2501, 4000))
    assert problem is not None
    assert problem.what == "makes an array of more than 10000000 numbers"
    assert problem.remedy == SMALLER == "describe the machine with fewer bodies"
    assert problem.where == f"line {sized(2501, 4000).partition('    D = ')[0].count(chr(10)) + 1}"


@pytest.mark.parametrize("operator", ["+", "-"])
def test_a_sum_has_two_thousand_terms(operator: str) -> None:
    def text(terms: int) -> str:
        return MOTOR.replace('= s["T"] +', '= s["T"]' + f' {operator} s["T"]' * terms + " +")

    assert first_deviation(text(LONGEST_SUM - 1)) is None
    assert module_problems(seal(text(LONGEST_SUM - 1))) == []
    compile(text(LONGEST_SUM - 1), "long", "exec")
    problem = first_deviation(text(LONGEST_SUM))
    assert problem is not None
    assert (problem.what, problem.remedy) == ("holds a sum of more than 2000 terms", SMALLER)
    assert problem.where == f"line {MOTOR.partition('    y[:, 0]')[0].count(chr(10)) + 1}"


def test_a_literal_has_so_many_entries(monkeypatch: pytest.MonkeyPatch) -> None:
    assert LONGEST_LITERAL == 300_000
    monkeypatch.setattr("modelgen.generated_module.allow_list.LONGEST_LITERAL", 300)

    def text(entries: int) -> str:
        return MOTOR.replace("ABSENT = {}", f"ABSENT = ({'0,' * entries})")

    assert first_deviation(text(300)) is None
    problem = first_deviation(text(301))
    assert problem is not None
    assert (problem.what, problem.remedy) == ("holds a literal of more than 300 entries", SMALLER)
    assert problem.where == f"line {MOTOR.partition('ABSENT = ')[0].count(chr(10)) + 1}"


def test_what_literals_declare() -> None:
    empty = dict.fromkeys((*LITERALS, "FRICTION"), None)
    nothing = declared_by(empty)
    assert set(nothing.counts.values()) == {0}
    assert set(nothing.names.values()) == {frozenset()}
    body = {"role": "inertia", "bodies": ("m", "c")}
    declared = declared_by(
        {
            **empty,
            "ROWS": (1, 2),
            "BASE_PARAMETERS": ("a", "b", "c"),
            "ACTUATORS": (1,) * 4,
            "SENSORS": (1,) * 5,
            "FRICTION": ({"body": "m", "asymmetric": True}, {"body": "c", "asymmetric": 1}, 3),
            "ROLES": {"J": body, "K": {"role": "stiffness", "bodies": ("m",)}, "I": body, "L": 1},
            "SIGNALS": ({"key": "s"}, {"key": 1}, {}, 2),
            "FEATURES": ({"key": "f"},),
            "PARAMETERS": ("J", 5),
            "KNOWN": {"K": 1.0, 5: 2.0},
            "IDENTIFIABLE": ("J",),
        }
    )
    assert declared.counts == {"row": 2, "column": 3, "state": 8, "force": 4, "friction": 3, "reading": 5}
    assert declared.names == {
        "signal": {"s"},
        "feature": {"f"},
        "parameter": {"J", "K"},
        "estimated": {"J"},
        "moved": {"m"},
    }


@pytest.mark.parametrize(
    ("character", "hidden"),
    [
        *((character, True) for character in "\x00\n\x7f\x85\u200b\u202e\ud800\u2028\u2029"),
        *((character, False) for character in "a☃\u00a0"),
    ],
)
def test_characters_that_are_not_seen(character: str, hidden: bool) -> None:
    assert hidden_character(f"a{character}b\n") == (character if hidden else "\n")
    assert hidden_character(f"a{character}") == (character if hidden else None)


def test_literals_are_read_not_executed() -> None:
    assert literal_value("({'a': (1.5, None)},\n 'b' 'c')") == ({"a": (1.5, None)}, "bc")
    for source, kind in {"f()": "ValueError", "(": "SyntaxError", "{{}: 1}": "TypeError"}.items():
        with pytest.raises(ValueError, match=rf"^holds no literal .{kind}.$"):
            literal_value(source)
    with pytest.raises(ValueError, match=r"^holds a text with control characters$"):
        literal_value(r"'\x00'")


def test_lines_of_code_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    code = TEXT[TEXT.index("def features") :].count("\n")
    monkeypatch.setattr("modelgen.generated_module.allow_list.MOST_LINES", code)
    assert module_problems(TEXT) == []
    monkeypatch.setattr("modelgen.generated_module.allow_list.MOST_LINES", code - 1)
    (problem,) = module_problems(TEXT)
    where = TEXT[: TEXT.index("def features")].count("\n") + 1
    assert problem == Problem(f"line {where}", f"begins more than {code - 1} lines of code", SMALLER)


def test_what_is_wrong_with_a_header() -> None:
    assert module_problems("x") == [
        Problem("header", "does not say that modelgen generated this file", "check the path")
    ]
    assert module_problems(TEXT.replace(SEAL_LINE, "")) == [
        Problem("header", "has no digest of the file", REMEDY)
    ]
    assert module_problems(TEXT + "\n") == [
        Problem("header", "states another digest: the file was changed after it was generated", REMEDY)
    ]
    assert module_problems("x" * (MODULE.largest + 1)) == [Problem("file", "is larger than 5 MB", SMALLER)]
    assert module_problems("x" * MODULE.largest)[0].where == "header"
    assert module_problems("\ud800" + TEXT)[0].where == "header"
    assert module_problems(seal("\ud800" + TEXT))[0].where == "line 1"


def test_a_seal_is_the_digest_of_the_text_with_zeros() -> None:
    digest = SEAL_LINE.rpartition(" ")[2].strip()
    blank = TEXT.replace(digest, ZEROS)
    assert ZEROS == "0" * 64
    assert hashlib.sha256(blank.encode()).hexdigest() == digest
    assert seal(blank) == seal(TEXT) == TEXT
    twice = f"{blank}{SEAL_LINE.replace(digest, ZEROS)}"
    assert seal(twice).count(ZEROS) == 1
    assert seal(twice).startswith(blank.partition(ZEROS)[0])
    assert seal(TEXT + SEAL_LINE) == seal(blank + SEAL_LINE) != TEXT + SEAL_LINE
    assert seal(TEXT + SEAL_LINE).endswith(SEAL_LINE)
    assert seal("x") == "x"
    assert has_header(TEXT)
    assert has_header(TEXT + "x")
    assert not has_header(TEXT.replace("# Generated", "# Made"))
    assert module_text("a\r\nb☃\r") == "a\nb☃\r"


@pytest.mark.parametrize("block", [HEAD, *(block for variants in BODY for block in variants)])
def test_the_skeleton_has_its_marks_in_two_columns(block: str) -> None:
    assert all(line == "" or line[:2] in ("  ", "? ", "* ", "+ ") for line in block.splitlines())
