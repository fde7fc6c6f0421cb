"""`modelgen fleet`: records of many machines on dask workers; an estimate each, and whether they differ."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from modelgen.cli.arguments import amounts
from modelgen.cli.data_arguments import DataOptions, reading_options
from modelgen.cli.estimation_options import EstimationOptions, FullOptions, settings_typed
from modelgen.cli.options import Module, ResultOptions, Trust, Values
from modelgen.cli.output import deliver, note, report
from modelgen.cli.output_files import check_result
from modelgen.cli.result_pages.write_page import ReportFile, check_report, write_result_page
from modelgen.errors import DataError
from modelgen.progress import step

if TYPE_CHECKING:
    from modelgen.runtime.fleet.dask_cluster import Certificates
    from modelgen.runtime.fleet.identify_fleet import FleetEstimate
    from modelgen.runtime.fleet.pooled import PooledParameter
    from modelgen.runtime.fleet.worker import FleetRecord
    from modelgen.runtime.model.model import Model
    from modelgen.runtime.records.record import Record

FleetData = Annotated[
    list[Path],
    typer.Argument(
        metavar="DATA", help="A file, or a folder of .npy files, a record; its folder names the machine."
    ),
]
Scheduler = Annotated[
    str | None, typer.Option(metavar="tls://HOST:PORT", help="A scheduler that runs; a local cluster.")
]
TlsCaFile = Annotated[
    str | None, typer.Option(metavar="FILE", help="Authority that signed the scheduler's certificate.")
]
TlsCert = Annotated[str | None, typer.Option(metavar="FILE", help="Own certificate, signed by it.")]
TlsKey = Annotated[str | None, typer.Option(metavar="FILE", help="Its private key.")]
Workers = Annotated[int | None, typer.Option(help="Processes of the local cluster; one a core.")]
CheckpointFolder = Annotated[
    Path | None,
    typer.Option("--checkpoint", metavar="DIR", help="Keep finished machines there, and go on from them."),
]

# columns of parameters that a table of 80 characters holds
PARAMETERS_A_TABLE = 3


def fleet(
    context: typer.Context,
    data: FleetData,
    module: Module,
    given: DataOptions,
    estimation: EstimationOptions,
    full: FullOptions,
    value: Values = None,
    scheduler: Scheduler = None,
    tls_ca_file: TlsCaFile = None,
    tls_cert: TlsCert = None,
    tls_key: TlsKey = None,
    workers: Workers = None,
    checkpoint: CheckpointFolder = None,
    report_file: ReportFile = None,
    trust: Trust = False,
    *,
    result: ResultOptions,
) -> None:
    """Identify every machine of a fleet as `identify` does, and test whether the machines differ.

    A file that cannot be read, or a worker that is lost, costs its record only, and is named. --json holds
    everything that `identify --json` says of each machine.
    """
    from modelgen.runtime.fleet.dask_cluster import check_cluster, fleet_client
    from modelgen.runtime.fleet.identify_fleet import identify_fleet
    from modelgen.runtime.model.known_parameters import with_known
    from modelgen.runtime.model.model import model_from_text
    from modelgen.runtime.model.module_file import read_module

    check_result(result)
    check_report(report_file, result.overwrite)
    certificates = _certificates(tls_ca_file, tls_cert, tls_key)
    check_cluster(scheduler, workers, certificates)
    if scheduler is not None and not scheduler.startswith("tls://"):
        note([f"warning: {scheduler} is not encrypted: whoever reaches it can run code on its workers"])
    text = read_module(module)  # once: what was checked is what the workers get
    known = amounts("--set", value or ())
    model = with_known(model_from_text(text, str(module), trust), known, "--set")
    records = _records(data, model, given)
    settings = settings_typed(context.params)
    step("starting the workers" if scheduler is None else f"asking {scheduler}")
    with fleet_client(scheduler, workers, certificates=certificates) as client:
        found = identify_fleet(client, text, records, settings, checkpoint, trust, known)
    if found.unkept:
        why = next(iter(found.unkept.values()))
        note([f"warning: {len(found.unkept)} machine(s) are not in the checkpoint: {why}"])
    facts = _facts(found)
    deliver(facts, lambda: report(facts, _lines(found), as_json=False), result)
    title = f"{model.chain}, sensors {model.sensor_set}: {len(found.machines)} machines"
    write_result_page(report_file, result.overwrite, title, _printed(found), context, _intervals(found))


def _facts(found: FleetEstimate) -> dict[str, Any]:
    return {
        "machines": dict(found.machines),
        "pooled": [asdict(one) for one in found.pooled],
        "failed": dict(found.failed),
        "refused": dict(found.refused),
        "unkept": dict(found.unkept),
    }


def _certificates(ca_file: str | None, cert: str | None, key: str | None) -> Certificates | None:
    """Return the files for tls://; all three or none.

    Raises
    ------
    DataError
    """
    from modelgen.runtime.fleet.dask_cluster import Certificates

    given = {"--tls-ca-file": ca_file, "--tls-cert": cert, "--tls-key": key}
    if ca_file is not None and cert is not None and key is not None:
        return Certificates(ca_file, cert, key)
    absent = [option for option, value in given.items() if value is None]
    if len(absent) < len(given):
        raise DataError.at(", ".join(absent), "is missing", "give all of " + ", ".join(given))
    return None


def _records(data: Sequence[Path], model: Model, options: DataOptions) -> list[FleetRecord]:
    """Return the records of a fleet; each is read where its machine is identified."""
    from modelgen.runtime.fleet.worker import FleetRecord
    from modelgen.runtime.records.read_record import read_record

    how = reading_options([model], options)
    if not any(path.exists() for path in data):  # before workers are started for nothing
        listed = ", ".join(str(path) for path in data[:3]) + (", ..." if len(data) > 3 else "")
        raise DataError.at("DATA", f"there is no {listed}", "check the paths")
    records = []
    given: dict[tuple[int, int], Path] = {}
    for path in data:
        where = path.resolve()
        stamp = _stamp(path, given)
        if path.is_dir() and any(path.glob("*.npy")):
            if how["fs"] is None:
                raise DataError.at(str(path), "is a folder of arrays, which need --fs", "give --fs HZ")
            source = partial(_folder, where, how, str(path))
        else:
            source = partial(read_record, where, name=str(path), **how)
        records.append(FleetRecord(where.parent.name, source, str(path), stamp))
    return records


def _stamp(path: Path, given: dict[tuple[int, int], Path]) -> str:
    """Return what changes with a file or folder; refuse one that was given before, by whatever path.

    Raises
    ------
    DataError
    """
    try:
        found = path.stat()
        files = sorted(path.glob("*.npy")) if path.is_dir() else [path]
        sizes = [(str(file), file.stat().st_size, file.stat().st_mtime_ns) for file in files]
    except OSError:  # told by who reads it
        return ""
    first = given.setdefault((found.st_dev, found.st_ino), path)
    if first is not path:
        raise DataError.at(str(path), f"is the same file as {first}", "give it once")
    return repr(sizes)


def _folder(path: Path, how: Mapping[str, Any], name: str) -> Any:
    """Return a record of .npy files, one a channel, that is read in stretches."""
    from modelgen.runtime.files.npy_channels import open_npy
    from modelgen.runtime.records.record import Record

    files, factors = {}, {}
    for channel in how["needed"]:
        column, factor = how["mapping"].get(channel, channel), how["scales"].get(channel, 1.0)
        if isinstance(factor, str):
            raise DataError.at(f"--scale {channel}={factor}", "is no number", "give the factor itself")
        files[channel] = path / f"{column.removeprefix('-')}.npy"
        factors[channel] = -factor if column.startswith("-") else factor
    changed = {channel: factor for channel, factor in factors.items() if factor != 1.0}
    record = Record.over(open_npy(files, float(how["fs"]), name, changed))
    return _mended(record, how["units"], how["mend"]) if how["mend"] else record


def _mended(record: Record, units: Mapping[str, str], mends: Sequence[str]) -> Record:
    """Return a folder's record with its readings mended: in memory, as files are."""
    from modelgen.runtime.records.record import Record
    from modelgen.runtime.records.repair import (
        check_mends,
        mend_offsets,
        mend_readings,
        mend_repeats,
        mend_turns,
    )

    check_mends(mends, record.signals, timed=False)
    signals = {key: record.read(key, 0, record.n) for key in record.signals}
    there = mend_readings(mend_turns(signals, mends).signals, mends)
    track = mend_offsets(mend_repeats(there, mends), units, mends)
    return Record(track.signals, record.fs, record.name, record.tag)


def _lines(found: FleetEstimate) -> list[str]:
    """Return a row of results a machine, below them what all say together, and what was left out."""
    lines: list[str] = []
    for start in range(0, len(found.pooled), PARAMETERS_A_TABLE):
        shown_here = found.pooled[start : start + PARAMETERS_A_TABLE]
        rows = [["", *map(_heading, shown_here)], *_rows(found, shown_here)]
        lines += [f"{title[:13]:13s}" + "".join(f" {cell:>21s}" for cell in cells) for title, *cells in rows]
        lines.append("")
    return lines + _notes(found)


def _rows(found: FleetEstimate, pooled: Sequence[PooledParameter]) -> list[list[str]]:
    """Return a row a machine, then what all say of these parameters and whether the machines differ."""
    rows = [
        [machine, *(_cell(e["params"].get(one.name), e["bse"].get(one.name)) for one in pooled)]
        for machine, e in found.machines.items()
    ]
    if len(found.machines) > 1:
        rows.append(["all", *(_cell(one.value, one.std) for one in pooled)])
        rows.append(["machines", *map(_verdict, pooled)])
    return rows


def _notes(found: FleetEstimate) -> list[str]:
    """Return how to read the table, and what was left out."""
    lines = ["value +- half the 95 % interval; - where a machine does not give it"]
    for machine, estimate in found.machines.items():
        refused = estimate["not_identifiable"]
        if refused:
            lines.append(f"{machine}: not identifiable: {', '.join(refused)}")
        for one in estimate["checks"]["advice"]:
            lines.append(f"{machine}: {one['kind']}: {one['where']} {one['what']}; {one['remedy']}")
    lines += [f"{machine}: no estimate ({why})" for machine, why in found.refused.items()]
    lines += [f"left out: {why}" for why in found.failed.values()]
    return lines


def _printed(found: FleetEstimate) -> list[Any]:
    """Return what the page shows: one table of all parameters, and the lines below it."""
    from modelgen.cli.tables import table

    heads = [f">{_heading(one)}" for one in found.pooled]
    return [table("Machines", ("machine", *heads), _rows(found, found.pooled)), *_notes(found)]


def _intervals(found: FleetEstimate) -> dict[str, list[tuple[str, float, float, float]]]:
    """Return the 95 % intervals of the machines and of all of them, by parameter and unit."""
    every: dict[str, list[tuple[str, float, float, float]]] = {}
    for one in found.pooled:
        told = [(m, e["params"].get(one.name), e["bse"].get(one.name)) for m, e in found.machines.items()]
        told += [("all", one.value, one.std)] if len(found.machines) > 1 else []
        every[f"{one.name} in {one.unit}" if one.unit else one.name] = [
            (title, value, value - 1.96 * std, value + 1.96 * std)
            for title, value, std in told
            if value is not None and std is not None
        ]
    return every


def _cell(value: float | None, std: float | None) -> str:
    if value is None:
        return "-"
    if std is None or not math.isfinite(std):
        return f"{value:.5g}"
    return f"{value:.5g} +- {1.96 * std:.2g}"


def _heading(one: Any) -> str:
    return f"{one.name} [{one.unit}]" if one.unit else str(one.name)


def _verdict(one: Any) -> str:
    if one.machines < 2:
        return "-"
    if one.differs:
        return f"differ by {one.between_std:.2g}"
    return f"agree (p = {one.p_value:.2g})"
