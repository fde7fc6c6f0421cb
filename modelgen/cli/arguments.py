"""Texts of the command line -> values for the commands; every mistake is explained."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from modelgen.errors import DataError, Problem, SpecError
from modelgen.magnitudes import REMEDY, is_usable, shown_number

if TYPE_CHECKING:
    from modelgen.runtime.simulation.excitation import Excitation
    from modelgen.spec.arms.arm import ArmSpec
    from modelgen.spec.chain import ChainSpec
    from modelgen.symbolic.equations.newton import MotionEquations
    from modelgen.symbolic.sensor_set_overview import SetSummary


def given_options(context: typer.Context) -> dict[str, str]:
    """Return what was typed after the command's name, by option, as text."""
    given = {}
    for parameter in context.command.params:
        source = context.get_parameter_source(parameter.name or "")
        if source is None or source.name != "COMMANDLINE":
            continue
        value = context.params[str(parameter.name)]
        listed = value if isinstance(value, (list, tuple)) else (value,)
        given[parameter.opts[0]] = ", ".join(str(item) for item in listed)
    return given


def load_chain(spec: str) -> ChainSpec:
    """Read a chain from a path, or from the catalogue if it looks like no path."""
    from modelgen.spec.load import load_spec

    return load_spec(_spec_path(spec))


def load_chain_or_arm(spec: str) -> ChainSpec | ArmSpec:
    """Read a chain or an arm from a path, or from the catalogue if it looks like no path."""
    from modelgen.spec.description import load_description

    return load_description(_spec_path(spec))


def _spec_path(spec: str) -> str | Path:
    from modelgen.spec.load import catalog_path

    looks_like_path = os.path.isfile(spec) or Path(spec).suffix or Path(spec).name != spec
    return spec if looks_like_path else catalog_path(spec)


def sensor_sets(chain: ChainSpec, chosen: str | None) -> list[str]:
    """Return the chosen sensor set, or all of the chain's; `build` refuses a name that is none of them."""
    if chosen is None and not chain.sensor_sets:
        raise SpecError.at(f"{chain.source}: sensors", "is missing", "write a table [sensors.NAME]")
    return list(chain.sensor_sets) if chosen is None else [chosen]


def modules_of(spec: ChainSpec | ArmSpec, chosen: str | None) -> list[str]:
    """Return the sensor sets that modules are generated for; "" for an arm that has none."""
    from modelgen.spec.chain import ChainSpec
    from modelgen.spec.words import shown, suggest

    if isinstance(spec, ChainSpec):
        return sensor_sets(spec, chosen)
    if chosen is None:
        return list(spec.sensor_sets) or [""]
    if not spec.sensor_sets:
        what = (
            f"{spec.source} describes an arm without sensor sets: the coordinates of its joints are measured"
        )
        raise SpecError.at("--sensors", what, "leave it out, or write a table [sensors.NAME]")
    if chosen not in spec.sensor_sets:
        remedy = suggest(chosen, spec.sensor_sets, "sensor sets")
        raise SpecError.at("--sensors", f"{shown(chosen)} is no sensor set of {spec.source}", remedy)
    return [chosen]


def compared_sensor_sets(chain: ChainSpec, chosen: str | None) -> tuple[SetSummary, ...]:
    """Return the sensor sets to show: the chosen one, all of the spec's, or ("all") every subset."""
    from modelgen.symbolic.sensor_set_overview import every_subset, overview, single

    if chosen == "all" and "all" not in chain.sensor_sets:
        chain, chosen = every_subset(chain), None
    names = sensor_sets(chain, None) if chosen is None else [chosen]
    # shown in detail, of which there is none where it cannot be built
    return (single(chain, names[0]),) if len(names) == 1 else overview(chain, names)


def proof_of(motion: MotionEquations) -> bool:
    """Return whether the Newton-Euler equations equal Lagrange's, by computer algebra."""
    from modelgen.symbolic.equations.lagrange import newton_minus_lagrange

    return not any(newton_minus_lagrange(motion))


def parameter_values(chain: ChainSpec | ArmSpec, chosen: str | None) -> Mapping[str, float]:
    """Return the values of the chosen parameter set, or of the only one."""
    names = list(chain.parameter_sets)
    chosen = names[0] if chosen is None and len(names) == 1 else chosen
    if chosen in names:
        return chain.parameter_sets[str(chosen)]
    what = "is not given" if chosen is None else f"{chosen!r} is no parameter set of {chain.source}"
    remedy = f"choose one of {', '.join(names)}" if names else "write a table [parameters.NAME] into the spec"
    raise SpecError.at("--parameters", what, remedy)


def excitation_from(text: str, forces: Sequence[str] = ()) -> tuple[str | Excitation, float | None]:
    """Return the kind of excitation, or that of a data file with the file's sampling frequency in Hz.

    `forces` are columns of the file that drive further actuators.
    """
    if text in ("chirp", "trapezoid"):
        return text, None
    if not Path(text).suffix:
        raise DataError.at("--excitation", f"{text!r} is unknown", "give chirp, trapezoid or a data file")
    from modelgen.runtime.records.read_record import read_record
    from modelgen.runtime.simulation.excitation import excitation_from_record

    record = read_record(text)
    return excitation_from_record(record, forces=forces), record.fs


def check_method(method: str | None) -> None:
    """Refuse an estimator that does not exist.

    Raises
    ------
    DataError
        With those that do.
    """
    from modelgen.runtime.identification.methods import METHODS

    if method is not None and method not in METHODS:
        raise DataError.at("--method", f"{method!r} is unknown", f"choose one of {', '.join(METHODS)}")


def delays_from(items: Sequence[str]) -> Mapping[str, float] | str | None:
    """Return what --delay says: a word for all forces, or seconds for each; None if it was not given."""
    if len(items) == 1 and "=" not in items[0]:
        return items[0]
    return amounts("--delay", items) if items else None


def period_from(
    items: Sequence[str], map_file: Path | None = None
) -> Mapping[str, float] | float | str | None:
    """Return what --period-s says: seconds for all records or for each, or the word none.

    Without it, what the mapping file declares; None if that declares nothing.
    """
    if not items and map_file is not None:
        from modelgen.runtime.records.mapping_file import load_mapping

        return load_mapping(map_file).period_s
    if len(items) == 1 and "=" not in items[0]:
        return _number_or(items[0])
    return amounts("--period-s", items) if items else None


def hold_out_from(items: Sequence[str]) -> Sequence[str] | float | None:
    """Return what --hold-out says: a share, or names of records; None if it was not given."""
    share = _number_or(items[0]) if len(items) == 1 else items
    return share if items and isinstance(share, float) else tuple(items) or None


def cutoffs_from(text: str | None) -> Sequence[float] | str | None:
    """Return what --scan-cutoffs says: frequencies in Hz, or the word auto; None if it was not given."""
    if text is None or text == "auto":
        return text
    numbers = [_number_or(part) for part in text.split(",")]
    found = tuple(number for number in numbers if isinstance(number, float))
    if len(found) < len(numbers):
        remedy = "write auto, or frequencies in Hz with commas, such as 100,200,300"
        raise DataError.at(f"--scan-cutoffs {text}", "cannot be read", remedy)
    return found


def _number_or(text: str) -> float | str:
    """Return a number if the text is one, else the text."""
    try:
        number = float(text)
    except ValueError:
        return text
    if not is_usable(number):
        raise DataError.at(shown_number(text), "cannot be calculated with", REMEDY)
    return number


def amounts(option: str, items: Iterable[str]) -> dict[str, float]:
    """Return what options such as q_m=2e-5 spell: a size in SI units for each channel."""
    amounts: dict[str, float] = {}
    problems = []
    for item in items:
        key, _, text = item.partition("=")
        try:
            number = float(text)
        except ValueError:
            problems.append(
                Problem(f"{option} {item}", "cannot be read", "write KEY=NUMBER, such as q_m=2e-5")
            )
            continue
        if key in amounts:
            problems.append(Problem(f"{option} {item}", f"gives {key} a second time", "give every key once"))
        elif not is_usable(number):
            problems.append(Problem(f"{option} {item}", "cannot be calculated with", REMEDY))
        amounts[key] = number
    DataError.raise_any(problems)
    return amounts


def directions_from(given: Sequence[str]) -> dict[str, str]:
    """Return what --direction says: direction of a body -> channel that moves with it."""
    from modelgen.runtime.records.mapping_options import parse_names

    return parse_names("--direction", given)
