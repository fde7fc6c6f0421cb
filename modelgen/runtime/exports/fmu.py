"""A chain as an FMU: FMI 2.0 for co-simulation, in C, with its source and a binary for this computer.

Every parameter can be set; inputs may be given with their slopes. The same model gives the same bytes, the
binary as far as the compiler does.
"""

from __future__ import annotations

import hashlib
import io
import json
import platform
import shutil
import subprocess
import tempfile
import zipfile
from collections.abc import Iterator, Sequence
from importlib import resources
from pathlib import Path

from modelgen.atomic_write import write_whole
from modelgen.runtime.exports.case import Case, Written
from modelgen.runtime.exports.plain_text import free_name, xml_attribute

SOURCE, DATA = "chain_fmu.c", "chain_data.h"
COMPILERS = ("cc", "gcc", "clang")
COMPILER_SECONDS = 120
FLAGS = ("-std=c99", "-O2", "-fPIC", "-shared", "-fvisibility=hidden", "-ffp-contract=off")
# by system: the platform's name in an FMU, the suffix of its binaries, what its linker takes besides
PLATFORMS = {
    "Linux": ("linux64", ".so", ("-Wl,--build-id=none",)),
    "Darwin": ("darwin64", ".dylib", ()),
    "Windows": ("win64", ".dll", ("-static-libgcc",)),
}
DATE = (1980, 1, 1, 0, 0, 0)  # the first one a zip archive can hold
NO_COMPILER = (
    "no C compiler found (cc, gcc, clang): only source is in it; `fmpy compile FILE.fmu` adds a binary"
)


def write(case: Case) -> Written:
    """Return the FMU; samples are in its resources, as sets of start values."""
    source = resources.files("modelgen.runtime.exports").joinpath(SOURCE).read_text(encoding="utf-8")
    data = "\n".join(_data(case)) + "\n"
    document = "\n".join(_description(case)) + "\n"
    digest = hashlib.sha256("\0".join((source, data, document)).encode()).hexdigest()
    guid = f"{{{digest[:8]}-{digest[8:12]}-{digest[12:16]}-{digest[16:20]}-{digest[20:32]}}}"
    data = f'#define GUID "{guid}"\n{data}'
    files = {
        "modelDescription.xml": document.replace("@GUID@", guid).encode(),
        f"sources/{DATA}": data.encode(),
        f"sources/{SOURCE}": source.encode(),
    }
    if case.values.samples:
        sets = json.dumps([dict(sample) for sample in case.values.samples], indent=2) + "\n"
        files["resources/samples.json"] = sets.encode()
    binary = _compiled(source, data)
    notes: tuple[str, ...] = (NO_COMPILER,)
    if binary is not None:
        folder, suffix, _ = PLATFORMS[platform.system()]
        files[f"binaries/{folder}/{case.name}{suffix}"] = binary
        notes = (f"the FMU has a binary for {folder}; elsewhere `fmpy compile FILE.fmu` adds one",)
    return Written({"": _archive(files)}, notes)


def _archive(files: dict[str, bytes]) -> bytes:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            entry = zipfile.ZipInfo(name, DATE)
            entry.create_system, entry.external_attr = 3, 0o644 << 16
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, content)
    return packed.getvalue()


def _compiled(source: str, data: str) -> bytes | None:
    """Return the shared library of the source; None without a compiler that makes one."""
    compiler = next((found for name in COMPILERS if (found := shutil.which(name))), None)
    if compiler is None or platform.system() not in PLATFORMS:
        return None
    _, suffix, more = PLATFORMS[platform.system()]
    with tempfile.TemporaryDirectory() as folder:
        for name, text in ((SOURCE, source), (DATA, data)):
            write_whole(Path(folder) / name, text.encode(), overwrite=False)
        library = Path(folder) / f"chain{suffix}"
        command = [compiler, *FLAGS, *more, SOURCE, "-o", library.name, "-lm"]
        try:
            subprocess.run(command, cwd=folder, check=True, capture_output=True, timeout=COMPILER_SECONDS)
            return library.read_bytes()
        except (OSError, subprocess.SubprocessError):
            return None


def _data(case: Case) -> Iterator[str]:
    """Yield the header of numbers: names stay out of it."""
    chain, names = case.mechanics, list(case.values.nominal)
    bodies = chain.bodies

    def place(name: str | None) -> int:
        return names.index(name) if name is not None else -1

    frictions = [body.friction for body in bodies]
    for name, count in (
        ("BODIES", len(bodies)),
        ("PARAMETERS", len(names)),
        ("ACTUATORS", len(chain.pushes)),
        ("SPRINGS", len(chain.springs)),
        ("READINGS", len(chain.readings)),
    ):
        yield f"#define {name} {count}"
    yield _array("double", "parameter_start", list(case.values.nominal.values()))
    yield _array("int", "inertia", [place(body.inertia) for body in bodies])
    yield _array("int", "viscous_plus", [place(body.viscous[0]) for body in bodies])
    yield _array("int", "viscous_minus", [place(body.viscous[1]) for body in bodies])
    yield _array("int", "coulomb_plus", [place(f.coulomb_plus if f else None) for f in frictions])
    yield _array("int", "coulomb_minus", [place(f.coulomb_minus if f else None) for f in frictions])
    yield _array("int", "offset", [place(f.offset if f else None) for f in frictions])
    yield _array("int", "rubs", [int(bool(f and (f.coulomb_plus or f.asymmetric))) for f in frictions])
    yield _array("int", "actuator_body", [push.body for push in chain.pushes])
    for role in ("stiffness", "damping", "stiffness3"):
        yield _array("int", role, [place(getattr(spring, role)) for spring in chain.springs])
    yield _table("spring_lever", [dict(spring.lever) for spring in chain.springs])
    yield _array("int", "reading_order", [reading.order for reading in chain.readings])
    yield _table("reading_lever", [dict(reading.lever) for reading in chain.readings])


def _array(kind: str, name: str, values: Sequence[float]) -> str:
    # C has no arrays without elements
    return f"static const {kind} {name}[] = {{{', '.join(map(repr, values or [0]))}}};"


def _table(name: str, rows: Sequence[dict[int, float]]) -> str:
    lines = [
        "{" + ", ".join(f"[{place}] = {factor!r}" for place, factor in row.items()) + "}" for row in rows
    ]
    return f"static const double {name}[][BODIES] = {{{', '.join(lines or ['{0.0}'])}}};"


def _description(case: Case) -> Iterator[str]:
    name = case.name
    variables = list(_variables(case))
    units = dict.fromkeys(unit for _, unit, _ in variables)
    outputs = [i for i, (_, _, kind) in enumerate(variables, 1) if 'causality="output"' in kind]
    yield '<?xml version="1.0" encoding="UTF-8"?>'
    yield (
        f'<fmiModelDescription fmiVersion="2.0" modelName="{name}" guid="@GUID@" '
        f"description={xml_attribute(case.model.title)} "
        'generationTool="modelgen" variableNamingConvention="flat">'
    )
    yield (
        f'  <CoSimulation modelIdentifier="{name}" canHandleVariableCommunicationStepSize="true" '
        'canInterpolateInputs="true" canNotUseMemoryManagementFunctions="true">'
    )
    yield f'    <SourceFiles><File name="{SOURCE}"/></SourceFiles>'
    yield "  </CoSimulation>"
    yield f"  <UnitDefinitions>{''.join(f'<Unit name={xml_attribute(unit)}/>' for unit in units)}"
    yield "  </UnitDefinitions>"
    yield '  <DefaultExperiment startTime="0" stopTime="1" stepSize="0.001"/>'
    yield "  <ModelVariables>"
    for reference, (variable, unit, kind) in enumerate(variables):
        attributes, start = kind.partition("|")[::2]
        begins = f' start="{start}"' if start else ""
        yield f'    <ScalarVariable name="{variable}" valueReference="{reference}" {attributes}>'
        yield f"      <Real unit={xml_attribute(unit)}{begins}/>"
        yield "    </ScalarVariable>"
    yield "  </ModelVariables>"
    yield "  <ModelStructure>"
    unknowns = "".join(f'<Unknown index="{index}"/>' for index in outputs)
    yield f"    <Outputs>{unknowns}</Outputs>"
    yield f"    <InitialUnknowns>{unknowns}</InitialUnknowns>"
    yield "  </ModelStructure>"
    yield "</fmiModelDescription>"


def _variables(case: Case) -> Iterator[tuple[str, str, str]]:
    """Yield name, unit, and attributes with the start value behind a bar, in the order of the references."""
    taken = set()
    for name, value in case.values.nominal.items():
        taken.add(name)
        yield name, case.model.units.get(name, ""), f'causality="parameter" variability="tunable"|{value!r}'
    for push in case.mechanics.pushes:
        taken.add(push.key)
        yield push.key, push.unit, 'causality="input" variability="continuous"|0.0'
    for reading in case.mechanics.readings:
        taken.add(reading.key)
        yield reading.key, reading.unit, 'causality="output" variability="continuous"'
    for kind, measure in (("position", "position"), ("speed", "velocity")):
        for body in case.mechanics.bodies:
            state = free_name(f"{kind}_{body.name}", taken)
            taken.add(state)
            attributes = 'causality="local" variability="continuous" initial="exact"|0.0'
            yield state, body.units[measure], attributes
