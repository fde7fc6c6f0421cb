"""Hostile specs: as a name every text is refused with its message, as a title it stays a text."""

from __future__ import annotations

import json
import re

import pytest

from modelgen.errors import SpecError
from modelgen.generated_module.module_check import module_problems
from modelgen.render.writer import generate
from modelgen.runtime.model.model import model_from_text
from modelgen.spec.load import load_spec, parse_spec
from tests.security.hostile_texts import CODE, NAMES

SPEC = """
[chain]
name = {chain}
title = {title}
motion = "rotation"

[[bodies]]
name = {body}
inertia = {inertia}
viscous = "F_v"
actuator = {actuator}

[known]
{known} = 1.0

[parameters.{set}]
J_m = 1.0

[sensors.{sensors}]
{sensor} = {{ body = {body}, measures = "position" }}
"""
GOOD = {
    "chain": "axis",
    "title": "Axis",
    "body": "m",
    "inertia": "J_m",
    "actuator": "Gamma_m",
    "known": "F_v",
    "set": "nominal",
    "sensors": "qm",
    "sensor": "q_m",
}
NAMED = [key for key in GOOD if key != "title"]


def spec_text(**changes: str) -> str:
    """Return the spec with these values."""
    return SPEC.format(**{key: quoted(value) for key, value in {**GOOD, **changes}.items()})


def quoted(text: str) -> str:
    """Write a text as TOML does: like JSON, but without pairs of surrogates."""
    return "".join(f"\\U{ord(c):08X}" if ord(c) > 0xFFFF else json.dumps(c)[1:-1] for c in text).join('""')


def refusal(place: str, name: str) -> str:
    """Return what is wrong with the refusal of a name at a place; nothing where it is as it should be."""
    try:
        parse_spec(spec_text(**{place: name}), "axis.toml")
    except SpecError as error:
        message = str(error)
        if not re.search(r"is not a name|is a word of the Python language|is not a parameter", message):
            return message
        lines = [message, *message.splitlines()]
        if not (lines[0].isprintable() or all(line.isprintable() for line in lines[1:])):
            return "not printable"
        return "" if all(one.where.startswith("axis.toml: ") for one in error.problems) else "elsewhere"
    return "was taken"


@pytest.mark.parametrize("place", NAMED)
def test_a_hostile_name_is_refused(place: str) -> None:
    found = {name: refusal(place, text) for name, text in {**CODE, **NAMES}.items()}
    assert {name: wrong for name, wrong in found.items() if wrong} == {}


def test_a_good_name_is_no_hostile_one() -> None:
    assert refusal("body", "m") == "was taken"


UNPRINTED = ("newline", "carriage return", "form feed", "null byte", "triple quote", "single quotes")
HIDDEN = ("right to left", "zero width", "byte order mark")
VISIBLE = [name for name in (*CODE, *NAMES) if name not in (*UNPRINTED, *HIDDEN, "empty")]


@pytest.mark.parametrize("name", [*UNPRINTED, *HIDDEN])
def test_a_title_of_invisible_characters_is_refused(name: str) -> None:
    with pytest.raises(SpecError, match=r"title: holds the control character U\+[0-9A-F]{4}; write one"):
        parse_spec(spec_text(title={**CODE, **NAMES}[name]), "axis.toml")


@pytest.mark.parametrize(
    "name", [name for name in (*CODE, *NAMES) if name not in (*UNPRINTED, *HIDDEN, "empty")]
)
def test_a_hostile_title_stays_a_text(name: str) -> None:
    title = {**CODE, **NAMES}[name]
    text = generate(parse_spec(spec_text(title=title), "axis.toml"), "qm")
    assert module_problems(text) == []
    assert model_from_text(text).title == title


LINK = '[[links]]\nbodies = ["m", "ground"]\nstiffness = "K"\n'
TABLES = {
    "empty file": ("", "chain: is missing"),
    "only a comment": ("# pwned", "chain: is missing"),
    "binary": ("\x00\x01\x02", "is not valid TOML"),
    "python": ("import os\nos.system('touch pwned')", "is not valid TOML"),
    "yaml tag": ("!!python/object/apply:os.system ['touch pwned']", "is not valid TOML"),
    "json": ('{"chain": {"name": "m"}}', "is not valid TOML"),
    "xml entity": ('<!DOCTYPE x [<!ENTITY e SYSTEM "file:///etc/passwd">]>', "is XML, no TOML"),
    "unclosed text": ('chain = "', "is not valid TOML"),
    "half a table": ("[chain", "is not valid TOML"),
    "key twice": ("chain = 1\nchain = 2", "is not valid TOML"),
    "deep lists": ("chain = " + "[" * 5000, "nests lists or tables too deeply"),
    "deep tables": ("chain = " + "{a=" * 5000, "nests lists or tables too deeply"),
    "huge integer": ("chain = " + "9" * 5000, "thousands of digits"),
    "table as a list": ("chain = []\nbodies = {}", "must be a table"),
    "number as a name": ("[chain]\nname = 1\nmotion = 2", "must be text in quotes, not 1"),
    "infinite ratio": (
        spec_text() + '[[links]]\nbodies = ["m", "ground"]\nstiffness = "K"\nratio = inf\n',
        "ratio",
    ),
    "ratio not a number": (
        spec_text() + '[[links]]\nbodies = ["m", "ground"]\nstiffness = "K"\nratio = nan\n',
        "rat",
    ),
    "ratio zero": (
        spec_text() + '[[links]]\nbodies = ["m", "ground"]\nstiffness = "K"\nratio = 0.0\n',
        "other than 0",
    ),
    "infinite value": (
        spec_text().replace('J_m"] = 1.0', "J_m = inf").replace("J_m = 1.0", "J_m = inf"),
        "finite",
    ),
    "foreign key": (spec_text() + "[__builtins__]\neval = 1\n", "is not a key of this table"),
    "template key": (spec_text() + '["{{ 7 * 7 }}"]\n', "is not a key of this table"),
    "prototype": (spec_text() + "[__proto__]\nx = 1\n", "is not a key of this table"),
    "megabytes": ("#" + "x" * 1_100_000, "larger than 1 MB"),
}


@pytest.mark.parametrize("name", TABLES)
def test_a_hostile_file_gets_its_message(name: str) -> None:
    text, message = TABLES[name]
    with pytest.raises(SpecError, match=message):
        parse_spec(text, "axis.toml")


FILE_NAMES = {
    "newline": "a\nimport os\n.toml",
    "escape sequence": "a\x1b[2J.toml",
    "right to left": "a\u202etxt.toml",
    "null byte": "a\x00.toml",
}


@pytest.mark.parametrize("name", FILE_NAMES)
def test_an_unprintable_file_name_is_refused(name: str) -> None:
    with pytest.raises(SpecError, match="file name with control characters; rename the file") as caught:
        parse_spec(spec_text(), FILE_NAMES[name])
    assert str(caught.value).isprintable()


@pytest.mark.parametrize(
    "name", ["""x' + open('pwned','w') + '.toml""", "x) import os.toml", "a; rm.toml", "é.toml"]
)
def test_an_odd_file_name_does_not_reach_the_module(name: str) -> None:
    text = generate(parse_spec(spec_text(), name), "qm")
    assert name not in text
    assert "# Generated by modelgen from axis.toml (SHA-256 " in text


PLACES = {"absent": "absent.toml", "folder": ".", "null byte": "a\x00.toml", "too long": "a" * 5000 + ".toml"}


@pytest.mark.parametrize("name", PLACES)
def test_a_spec_that_is_no_file(name: str) -> None:
    with pytest.raises(
        SpecError,
        match=r"cannot be read \((it is a folder|No such file|embedded null byte|File name too long)",
    ):
        load_spec(PLACES[name])
