"""`modelgen fleet`: records of many machines on dask workers; estimates of records, machines and all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from modelgen.cli.options import Trust
from modelgen.cli.output import note, report, say
from modelgen.errors import DataError, ModelgenError
from modelgen.progress import shown
from modelgen.read_file import MODULE, read_text

if TYPE_CHECKING:
    from modelgen.runtime.fleet.dask_cluster import Certificates
    from modelgen.runtime.fleet.identify_fleet import FleetEstimate, FleetRecord
    from modelgen.runtime.identification.identify_stream import StreamEstimate
    from modelgen.runtime.records.channels import Channels


def fleet(
    data: Annotated[
        list[Path],
        typer.Argument(
            metavar="DATA", help="A file, or a folder of .npy files, a record; its folder names the machine."
        ),
    ],
    module: Annotated[Path, typer.Option("--model", metavar="MODULE.py", help="A generated module.")],
    cutoff_hz: Annotated[float, typer.Option(help="Cut-off in Hz of the low-pass, one for all records.")],
    mapping: Annotated[
        list[str] | None,
        typer.Option("--map", metavar="KEY=COLUMN", help="Column of a channel; -COLUMN negates; repeatable."),
    ] = None,
    scale: Annotated[
        list[str] | None, typer.Option(metavar="KEY=FACTOR", help="Factor to SI units; repeatable.")
    ] = None,
    fs: Annotated[float | None, typer.Option(metavar="HZ", help="Sampling frequency in Hz.")] = None,
    filter_order: Annotated[int | None, typer.Option(help="Order of the low-pass.")] = None,
    decimation: Annotated[int | None, typer.Option(help="Keep every N-th sample.")] = None,
    direction_cutoff_hz: Annotated[
        float | None, typer.Option(help="Cut-off in Hz of directions of motion; that of the low-pass.")
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="tls://HOST:PORT", help="A scheduler that runs; a local cluster.")
    ] = None,
    tls_ca_file: Annotated[
        str | None, typer.Option(metavar="FILE", help="Authority that signed the scheduler's certificate.")
    ] = None,
    tls_cert: Annotated[
        str | None, typer.Option(metavar="FILE", help="Own certificate, signed by it.")
    ] = None,
    tls_key: Annotated[str | None, typer.Option(metavar="FILE", help="Its private key.")] = None,
    workers: Annotated[int | None, typer.Option(help="Processes of the local cluster; one a core.")] = None,
    trust: Trust = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print JSON for programs instead of tables.")
    ] = False,
) -> None:
    """Identify every record and machine of a fleet, and what suits all; workers read the files in stretches.

    A file that cannot be read, or a worker that is lost, costs its record only, and is named. Standard
    deviations are those of the noise; `identify` adds how the estimate drifts with its settings. Estimates
    of single records are in --json.
    """
    from modelgen.runtime.fleet.dask_cluster import check_cluster, fleet_client
    from modelgen.runtime.fleet.identify_fleet import identify_fleet
    from modelgen.runtime.model.model import load_model
    from modelgen.runtime.records.mapping_options import parse_mapping, parse_scales

    certificates = _certificates(tls_ca_file, tls_cert, tls_key)
    check_cluster(scheduler, workers, certificates)
    if scheduler is not None and not scheduler.startswith("tls://"):
        note([f"warning: {scheduler} is not encrypted: whoever reaches it can run code on its workers"])
    model = load_model(module, trust)
    columns = _columns(model.channels, parse_mapping(mapping or ()), parse_scales(scale or ()))
    records, unread = _opened(data, columns, fs)
    say("starting the workers" if scheduler is None else f"asking {scheduler}")
    with shown(), fleet_client(scheduler, workers, certificates=certificates) as client:
        found = identify_fleet(
            client,
            read_text(module, MODULE),
            records,
            cutoff_hz,
            filter_order,
            decimation,
            direction_cutoff_hz,
            progress=say,
        )
    facts = _facts(found, unread)
    report(facts, _lines(facts), as_json)


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


def _columns(
    channels: Sequence[str], mapping: Mapping[str, str], scales: Mapping[str, float | str]
) -> dict[str, tuple[str, float]]:
    """Return the column of every channel and the factor that brings it to SI units."""
    found = {}
    for channel in channels:
        column, factor = mapping.get(channel, channel), scales.get(channel, 1.0)
        if isinstance(factor, str):
            raise DataError.at(f"--scale {channel}={factor}", "is no number", "give the factor itself")
        sign = -1.0 if column.startswith("-") else 1.0
        found[channel] = (column.removeprefix("-"), sign * factor)
    return found


def _opened(
    data: Sequence[Path], columns: Mapping[str, tuple[str, float]], fs: float | None
) -> tuple[list[FleetRecord], dict[str, str]]:
    """Return the records that can be opened, and the reasons of those that cannot."""
    from modelgen.runtime.fleet.identify_fleet import FleetRecord

    records, unread = [], {}
    given: dict[tuple[int, int], Path] = {}
    for path in data:
        with suppress(OSError):  # what cannot be found is told by who reads it
            _refuse_again(path, given)
        try:
            records.append(FleetRecord(path.resolve().parent.name, _source(path, columns, fs)))
        except ModelgenError as error:
            unread[str(path)] = str(error)
    if not records:
        raise DataError.at("DATA", "no record can be read: " + "; ".join(unread.values()), "see the reasons")
    return records, unread


def _refuse_again(path: Path, given: dict[tuple[int, int], Path]) -> None:
    """Refuse a file or folder that was given before, by whatever path.

    Raises
    ------
    DataError, OSError
    """
    found = path.stat()
    first = given.setdefault((found.st_dev, found.st_ino), path)
    if first is not path:
        raise DataError.at(str(path), f"is the same file as {first}", "give it once")


def _source(path: Path, columns: Mapping[str, tuple[str, float]], fs: float | None) -> Channels:
    """Return a record that is read in stretches; of a format that cannot be, the record itself."""
    from modelgen.runtime.files.npy_channels import open_npy
    from modelgen.runtime.files.open_channels import FORMATS, open_channels
    from modelgen.runtime.records.channels import RecordChannels
    from modelgen.runtime.records.read_record import read_record

    stretches = path.is_dir() or path.suffix.lower() in FORMATS
    if stretches and fs is None:
        raise DataError.at(str(path), "is read in stretches, which need --fs", "give --fs HZ")
    if path.is_dir():
        files = {channel: path / f"{column}.npy" for channel, (column, _) in columns.items()}
        factors = {channel: factor for channel, (_, factor) in columns.items() if factor != 1.0}
        return open_npy(files, float(fs or 0.0), str(path), factors)
    if stretches:
        return open_channels(path, columns, float(fs or 0.0), str(path))
    names = {channel: column for channel, (column, _) in columns.items()}
    scales: dict[str, float | str] = {channel: factor for channel, (_, factor) in columns.items()}
    return RecordChannels(read_record(path, names, scales, fs, name=str(path), needed=tuple(columns)))


def _facts(found: FleetEstimate, unread: Mapping[str, str]) -> dict[str, Any]:
    return {
        "machines": {machine: _estimate(estimate) for machine, estimate in found.machines.items()},
        "pooled": _estimate(found.pooled),
        "records": {name: _estimate(estimate) for name, estimate in found.records.items()},
        "failed": {**unread, **found.failed},
        "refused": dict(found.refused),
        "refused_records": dict(found.refused_records),
        "lost": dict(found.lost),
    }


def _estimate(estimate: StreamEstimate) -> dict[str, Any]:
    return {
        "records": list(estimate.records),
        "params": dict(estimate.params),
        "bse": dict(estimate.bse),
        "cov_params": None if estimate.covariance is None else estimate.covariance.tolist(),
        "not_identifiable": list(estimate.not_identifiable),
        "nobs": estimate.nobs,
        "relative_error": estimate.relative_error,
        "condition_number": estimate.condition_number,
    }


def _lines(facts: Mapping[str, Any]) -> list[str]:
    lines = []
    for title, estimate in (*facts["machines"].items(), ("pooled", facts["pooled"])):
        lines.append(f"{title}: {len(estimate['records'])} record(s), {estimate['nobs']} rows")
        lines += [
            f"    {name:12s} {value:12.6g}  std {estimate['bse'][name]:9.3g}"
            for name, value in estimate["params"].items()
        ]
        if estimate["not_identifiable"]:
            lines.append(f"    not identifiable: {', '.join(estimate['not_identifiable'])}")
    lines += [f"{machine}: no estimate of its own ({why})" for machine, why in facts["refused"].items()]
    lines += [f"{name}: no estimate of its own ({why})" for name, why in facts["refused_records"].items()]
    lines += [f"left out: {why}" for why in facts["failed"].values()]
    lines += [f"lost before its covariance: {why}" for why in facts["lost"].values()]
    return lines
