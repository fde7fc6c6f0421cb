"""Fleet: records of many machines on dask workers; an estimate a machine, and what suits all of them.

A worker does with the records of a machine what `identify` does: the same rows, guards, units, warnings and
intervals. What cannot be read, and what no worker survives, costs its record and is named.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from modelgen.errors import DataError
from modelgen.runtime.fleet.checkpoint import Checkpoint
from modelgen.runtime.fleet.dask_cluster import gathered, lost_alone
from modelgen.runtime.fleet.pooled import PooledParameter, pooled_parameters
from modelgen.runtime.fleet.worker import (
    FleetRecord,
    MachineReport,
    fleet_model,
    identify_machine,
    probe,
    same_records,
)
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.same_data import alike, refuse_pairs


@dataclass(frozen=True)
class FleetEstimate:
    """Estimates of a fleet.

    Attributes
    ----------
    machines : mapping of str to mapping
        The estimate of each machine, in the order of the records, as `Estimate.to_dict` gives it.
    pooled : tuple of PooledParameter
        What all machines say of each parameter, and whether they differ.
    failed : mapping of str to str
        Record to the reason why it is in no estimate.
    refused : mapping of str to str
        Machine to the reason why it has no estimate.
    unkept : mapping of str to str
        Machine to the reason why the checkpoint could not keep it (a full disk); its estimate is here.
    """

    machines: Mapping[str, Mapping[str, Any]]
    pooled: tuple[PooledParameter, ...]
    failed: Mapping[str, str]
    refused: Mapping[str, str]
    unkept: Mapping[str, str] = field(default_factory=dict)


def identify_fleet(
    client: Any,
    module_text: str,
    records: Sequence[FleetRecord],
    options: Mapping[str, Any] | None = None,
    checkpoint: str | Path | None = None,
    trust: bool = False,
    known: Mapping[str, float] | None = None,
) -> FleetEstimate:
    """Identify the parameters of every machine, and what suits all.

    Parameters
    ----------
    client : distributed.Client
        See `modelgen.runtime.fleet.dask_cluster.fleet_client`.
    module_text : str
        Text of the generated module; the workers execute it.
    records : sequence of FleetRecord
        Their files must be readable where the workers are.
    options : mapping, optional
        Options of `modelgen.identify`, the same for all machines.
    checkpoint : path, optional
        A folder that keeps what came of each machine. A machine that is in it, with the same data, model and
        options, is not identified again, nor are its records read, as long as they have stamps.
    trust : bool
        Execute a text that modelgen did not write, see `modelgen.load_model`.
    known : mapping of str to float, optional
        Parameters that are not estimated on any machine, with their values (SI), see `modelgen.with_known`.

    Raises
    ------
    DataError
        When records share a name or data, no machine could be identified, or no worker is left.
    """
    names = [record.name for record in records]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise DataError.at(twice, "names two records", "give every record a name of its own")
    chosen = dict(options or {})
    values = tuple((known or {}).items())
    model, fleet = fleet_model(module_text, trust, values), _machines(records)
    told = {**chosen, "known": values} if values else chosen
    kept = Checkpoint(Path(checkpoint), module_text, told) if checkpoint is not None else None
    reports = {
        machine: report
        for machine, members in fleet.items()
        if kept is not None and (report := kept.load(machine, members)) is not None
    }
    left = {machine: members for machine, members in fleet.items() if machine not in reports}
    submit = partial(_submit, client, module_text, chosen, trust, values)

    unkept: dict[str, str] = {}

    def finish(machine: str, report: MachineReport) -> None:
        reports[machine] = report
        if kept is None:
            return
        try:
            kept.save(machine, left[machine], report)
        except DataError as error:  # hours of the other machines are not lost with the disk
            unkept[machine] = str(error)

    futures = {machine: submit(members) for machine, members in left.items()}
    _, lost = gathered(futures, "machines identified", finish)
    without, why = _without_deadly(client, model, {machine: left[machine] for machine in lost})

    def finish_without(machine: str, report: MachineReport) -> None:
        finish(machine, replace(report, failed={**why[machine], **report.failed}))

    futures = {machine: submit(members) for machine, members in without.items()}
    _, still = gathered(futures, "again", finish_without)
    for machine, reason in still.items():  # of what is not known: another run may do better
        reports[machine] = MachineReport(None, reason, why[machine], {})
    for machine in (machine for machine in lost if machine not in without):
        finish(machine, MachineReport(None, "none of its records can be read", why[machine], {}))
    ordered = {machine: reports[machine] for machine in fleet}
    _refuse_same(client, model, records, ordered)
    return replace(_estimate(ordered), unkept=unkept)


def _machines(records: Sequence[FleetRecord]) -> dict[str, list[FleetRecord]]:
    """Return the records of each machine."""
    found: dict[str, list[FleetRecord]] = {}
    for record in records:
        found.setdefault(record.machine, []).append(record)
    return found


def _submit(
    client: Any,
    module_text: str,
    options: Mapping[str, Any],
    trust: bool,
    known: tuple[tuple[str, float], ...],
    members: Sequence[FleetRecord],
) -> Any:
    return client.submit(identify_machine, module_text, members, options, trust, known, pure=False)


def _without_deadly(
    client: Any, model: Model, fleet: Mapping[str, Sequence[FleetRecord]]
) -> tuple[dict[str, list[FleetRecord]], dict[str, dict[str, str]]]:
    """Return machines whose worker died, without the records that no worker survives, and these."""
    probes = {
        record.name: partial(client.submit, probe, record, model.channels, pure=False)
        for records in fleet.values()
        for record in records
    }
    deadly = lost_alone(probes, "records read")
    without = {
        machine: [record for record in records if record.name not in deadly]
        for machine, records in fleet.items()
    }
    why = {
        machine: {record.name: deadly[record.name] for record in records if record.name in deadly}
        for machine, records in fleet.items()
    }
    return {machine: records for machine, records in without.items() if records}, why


def _refuse_same(
    client: Any, model: Model, records: Sequence[FleetRecord], reports: Mapping[str, MachineReport]
) -> None:
    """Refuse records of different machines with the same data; the workers look at them.

    Raises
    ------
    DataError
    """
    looks = {name: samples for report in reports.values() for name, samples in report.looks.items()}
    seen = [record for record in records if record.name in looks]
    pairs = alike([looks[record.name] for record in seen])
    compared = {
        f"{i} {k}": client.submit(same_records, seen[i], seen[k], model.channels, pure=False)
        for i, k in pairs
    }
    same, _ = gathered(compared, "records compared")
    sizes = [(record.name, int(looks[record.name][0])) for record in seen]
    refuse_pairs(sizes, {(i, k): sizes[i][1] for i, k in pairs if same.get(f"{i} {k}")})


def _estimate(reports: Mapping[str, MachineReport]) -> FleetEstimate:
    """Return the estimates of the machines, and the pooled one.

    Raises
    ------
    DataError
        When there is none.
    """
    machines = {name: report.document for name, report in reports.items() if report.document is not None}
    refused = {name: report.reason for name, report in reports.items() if report.document is None}
    failed = {name: why for report in reports.values() for name, why in report.failed.items()}
    if not machines:
        reasons = "; ".join([*failed.values(), *refused.values()])
        raise DataError.at("records", f"none could be used: {reasons}", "see the reasons")
    return FleetEstimate(machines, pooled_parameters(list(machines.values())), failed, refused)
