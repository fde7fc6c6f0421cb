"""The linear model with friction inputs as JSON: A, B, C, D, E, F with names and units."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from modelgen.runtime.exports.case import Case, Written

EQUATIONS = "x' = A x + B u + E f, z = C x + D u + F f"
FRICTION = (
    "f of a body: coulomb_plus while it moves forwards, -coulomb_minus while backwards, between them where "
    "it rests; plus offset"
)


def write(case: Case) -> Written:
    """Return the JSON of a case, its samples within."""
    model, bodies = case.model, case.mechanics.bodies
    document: dict[str, Any] = {
        "format": "modelgen state space",
        "version": 1,
        "chain": model.chain,
        "sensor_set": model.sensor_set,
        "title": model.title,
        "spec_sha256": model.spec_sha256,
        "equations": EQUATIONS,
        "friction": FRICTION,
        "states": [{"name": f"q_{b.name}", "unit": b.units["position"]} for b in bodies]
        + [{"name": f"v_{b.name}", "unit": b.units["velocity"]} for b in bodies],
        "inputs": [{"name": p.key, "unit": p.unit} for p in case.mechanics.pushes],
        "friction_inputs": [
            {
                "name": f"friction_{entry.body}",
                "unit": next(b.units["force"] for b in bodies if b.name == entry.body),
                "coulomb_plus": entry.coulomb_plus,
                "coulomb_minus": entry.coulomb_minus,
                "offset": entry.offset,
            }
            for entry in model.friction
        ],
        "outputs": [{"name": r.key, "unit": r.unit} for r in case.mechanics.readings],
        "parameters": {
            name: {
                "value": value,
                "unit": model.units.get(name, ""),
                "std": case.values.std.get(name),
                "origin": case.values.origin[name],
            }
            for name, value in case.values.nominal.items()
        },
        **matrices(case, case.values.nominal),
    }
    if model.cubic_springs:
        document["cubic_springs"] = [
            {
                "parameter": spring.parameter,
                "deflection": {bodies[place].name: factor for place, factor in spring.deflection},
            }
            for spring in model.cubic_springs
        ]
    if case.values.samples:
        document["samples"] = [
            {"parameters": dict(sample), **matrices(case, sample)} for sample in case.values.samples
        ]
    text = json.dumps(document, indent=2, allow_nan=False) + "\n"
    return Written({"": text.encode()}, linear_notes(case))


def matrices(case: Case, parameters: Mapping[str, float]) -> dict[str, Any]:
    """Return A to F as lists; with friction that differs by direction also those of a backward motion."""
    full = {**dict.fromkeys(case.model.every_parameter, 0.0), **parameters}
    found: dict[str, Any] = {}
    directed = any(body.asymmetric and body.viscous[0] for body in case.mechanics.bodies)
    for key, way in (("", 1), ("backward", -1)) if directed else (("", 1),):
        space = case.model.state_space(full, {body.name: way for body in case.mechanics.bodies})
        group = {name: (getattr(space, name) + 0.0).tolist() for name in "ABCDEF"}
        found |= {key: group} if key else group
    return found


def linear_notes(case: Case) -> tuple[str, ...]:
    """Return what the matrices do not hold."""
    notes = []
    absent = [
        name
        for entry in case.model.friction
        for name in (entry.coulomb_plus, entry.coulomb_minus, entry.offset)
        if name is not None and name not in case.values.nominal
    ]
    if absent:
        notes.append(f"{', '.join(dict.fromkeys(absent))}: no value; the matrices do not need it")
    if case.model.cubic_springs:
        names = ", ".join(spring.parameter for spring in case.model.cubic_springs)
        notes.append(f"the matrices are linear: {names} are listed separately")
    if any(body.asymmetric and body.viscous[0] for body in case.mechanics.bodies):
        notes.append('viscous friction differs by direction: matrices of forward motion, "backward" all back')
    return tuple(notes)
