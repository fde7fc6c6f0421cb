"""The linear model as a MATLAB or Octave script: ss objects with names, for Simulink's State-Space block."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from modelgen.runtime.exports.case import Case, Written
from modelgen.runtime.exports.plain_text import one_line
from modelgen.runtime.exports.state_space_json import linear_notes, matrices

# words of the language that are names in a spec: no fields of a structure
WORDS = frozenset(
    (
        "case",
        "catch",
        "classdef",
        "elseif",
        "end",
        "function",
        "otherwise",
        "parfor",
        "persistent",
        "spmd",
        "switch",
    )
)


def write(case: Case) -> Written:
    """Return the script; parameters of samples stand in the array `samples`, their models in `sampled`."""
    return Written({"": "\n".join(_lines(case)).encode() + b"\n"}, linear_notes(case))


def _lines(case: Case) -> Iterator[str]:
    bodies, nominal = case.mechanics.bodies, case.values.nominal
    yield f"% {one_line(case.model.title)} ({case.name}): x' = A*x + B*u + E*f, z = C*x + D*u + F*f, SI units"
    yield "% f: Coulomb friction against the motion, and offsets, of each body in friction_inputs"
    yield f"p = {_structure(nominal)};"
    for name, value in matrices(case, nominal).items():
        if name == "backward":
            yield "% backward: where bodies of asymmetric friction move backwards"
            yield from (f"backward.{key} = {_matrix(matrix)};" for key, matrix in value.items())
        else:
            yield f"{name} = {_matrix(value)};"
    states = [f"q_{body.name}" for body in bodies] + [f"v_{body.name}" for body in bodies]
    yield f"state_names = {_texts(states)};"
    yield f"input_names = {_texts([push.key for push in case.mechanics.pushes])};"
    yield f"output_names = {_texts([reading.key for reading in case.mechanics.readings])};"
    yield f"friction_inputs = {_texts([entry.body for entry in case.model.friction])};"
    names = "'StateName', state_names, 'InputName', input_names, 'OutputName', output_names"
    yield "if exist('ss', 'file') || exist('ss', 'builtin')"
    yield f"  system = ss(A, B, C, D, {names});"
    yield "end"
    if case.values.samples:
        yield f"samples = [{', ...'.join(f'{chr(10)}  {_structure(s)}' for s in case.values.samples)}];"
        yield f"sampled = cell(1, {len(case.values.samples)});"
    for number, sample in enumerate(case.values.samples, 1):
        fields = [
            f"'{name}', {{{_matrix(value)}}}"
            for name, value in matrices(case, sample).items()
            if name != "backward"
        ]
        yield f"sampled{{{number}}} = struct({', '.join(fields)});"


def _structure(values: Mapping[str, float]) -> str:
    fields = (f"'{f'{name}_' if name in WORDS else name}', {value!r}" for name, value in values.items())
    return f"struct({', '.join(fields)})"


def _matrix(rows: list[list[Any]]) -> str:
    if not rows or not rows[0]:
        return f"zeros({len(rows)}, 0)"
    return "[" + "; ".join(", ".join(map(repr, row)) for row in rows) + "]"


def _texts(texts: list[str]) -> str:
    return "{" + ", ".join(f"'{text}'" for text in texts) + "}"
