"""Payloads: what the arm carries in some records, on the link of a joint; contradictions are reported."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from modelgen.documents import Document
from modelgen.errors import Problem
from modelgen.spec.arms.arm import ArmSpec, Joint, Payload
from modelgen.spec.arms.parameters import link_names
from modelgen.spec.arms.tables import joint_problem
from modelgen.spec.words import path, shown, suggest


def draft_payloads(document: Document, spec: ArmSpec) -> tuple[Payload, ...]:
    """Return the payloads of a file; one that says no joint is on the link of the last one."""
    names = [joint.name for joint in spec.joints]
    return tuple(
        Payload(name, (table or {}).get("joint") or (names[-1] if names else ""), link_names(name))
        for name, table in (document.get("payload") or {}).items()
        if joint_problem(name) is None and name not in names
    )


def weighed(document: Document) -> Document:
    """Return the masses that payloads are known to have as they are written, by the name of the parameter."""
    tables = (document.get("payload") or {}).items()
    return {link_names(name)[-1]: table["mass"] for name, table in tables if table and "mass" in table}


def check_payloads(
    document: Document, spec: ArmSpec, joints: Mapping[str, Joint] | None
) -> Iterator[Problem]:
    """Yield what is wrong with payloads; `joints` is None where names may be missing."""
    given = document.get("payload") or {}
    if document.get("payload", None) == {}:
        yield Problem("payload", "is empty", "write [payload.disc], with mass = 4.6 if it was weighed")
    for name, table in given.items():
        problem = joint_problem(name)
        if problem:
            yield Problem(path("payload", name), problem[0].replace("a joint", "a payload"), problem[1])
            continue
        if joints is not None and name in joints:
            what = f"{shown(name)} is the name of a joint, whose link has these parameters"
            yield Problem(path("payload", name), what, "choose another name")
        joint, mass = (table or {}).get("joint"), (table or {}).get("mass")
        if joint is not None and joints is not None and joint not in joints:
            where = path("payload", name, "joint")
            yield Problem(where, f"{shown(joint)} is not a joint", suggest(joint, joints, "joints"))
        if mass is None:
            continue
        own = link_names(name)[-1]
        if own in (document.get("known") or {}):
            yield Problem(path("payload", name, "mass"), f"is {own} of [known] as well", "give it once")
        elif not spec.known[own] > 0.0:
            what = f"is {shown(mass)}, and a payload that was weighed has more than 0 kg"
            yield Problem(
                path("payload", name, "mass"), what, "correct it, or leave it out to have it estimated"
            )
