"""Fleet: records of many machines on dask workers; an estimate a record, a machine and one of all.

A worker turns a stretch of a record into small triangles; those of a record are joined in a tree, and only
triangles travel. What cannot be read, and what no worker survives, costs its record and is named.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from modelgen.errors import DataError, ModelgenError
from modelgen.runtime.fleet.dask_cluster import gathered, joined_in_a_tree
from modelgen.runtime.fleet.worker import (
    Job,
    fit_records,
    fleet_model,
    kernel_sums,
    moments_of,
    own_fit,
    part_factors,
    prepare,
)
from modelgen.runtime.identification.identify_stream import StreamEstimate, stream_choice, stream_estimate
from modelgen.runtime.least_squares.hac_covariance import KernelSums
from modelgen.runtime.least_squares.hac_covariance_chunks import Moments, bandwidth_of, covariance_from_sums
from modelgen.runtime.least_squares.triangle_fit import FactorFit
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.channels import Channels, RecordChannels
from modelgen.runtime.records.same_data import alike, look, refuse_pairs, refuse_same_data, same_throughout
from modelgen.runtime.rows.chunk import CHUNK_SAMPLES

FloatArray = npt.NDArray[np.float64]
Progress = Callable[[str], None]
Group = tuple[str, str]  # kind of an estimate ("record", "machine", "fleet") and whose it is

ALL: Group = ("fleet", "")

# Samples to one task: tens of milliseconds, against which the scheduler's millisecond does not count.
TASK_SAMPLES = 4 * CHUNK_SAMPLES


@dataclass(frozen=True, eq=False)
class FleetRecord:
    """One record of a machine; records of a fleet need names of their own."""

    machine: str
    source: Channels


@dataclass(frozen=True)
class FleetEstimate:
    """Estimates of a fleet.

    Attributes
    ----------
    machines : mapping of str to StreamEstimate
        One of each machine, in the order of the records.
    pooled : StreamEstimate
        Of all records together, each row of each with a weight of its own.
    failed : mapping of str to str
        Record to the reason why it is in no estimate.
    refused : mapping of str to str
        Machine to the reason why it has no estimate of its own.
    records : mapping of str to StreamEstimate
        One of each record, in their order.
    refused_records : mapping of str to str
        Record to the reason why it has no estimate of its own.
    lost : mapping of str to str
        Record that is in the estimates, but was lost before their covariances, to the reason; these estimates
        have printed standard deviations only, and no covariance.
    """

    machines: Mapping[str, StreamEstimate]
    pooled: StreamEstimate
    failed: Mapping[str, str]
    refused: Mapping[str, str]
    records: Mapping[str, StreamEstimate]
    refused_records: Mapping[str, str]
    lost: Mapping[str, str]


def identify_fleet(
    client: Any,
    module_text: str,
    records: Sequence[FleetRecord],
    cutoff_hz: float,
    filter_order: int | None = None,
    decimation: int | None = None,
    direction_cutoff_hz: float | None = None,
    task_samples: int = TASK_SAMPLES,
    progress: Progress | None = None,
) -> FleetEstimate:
    """Identify the parameters of every record, of every machine, and those that suit all.

    Parameters
    ----------
    client : distributed.Client
        See `modelgen.runtime.fleet.dask_cluster.fleet_client`.
    module_text : str
        Text of the generated module; the workers execute it.
    records : sequence of FleetRecord
        Their files must be readable where the workers are.
    cutoff_hz, filter_order, decimation, direction_cutoff_hz :
        As for `modelgen.runtime.identification.identify_stream.identify_stream`.
    task_samples : int
        Samples to one task; changes the speed only.
    progress : callable, optional
        Called with a few words before each step.

    Raises
    ------
    DataError
        When records share a name or data, none could be used, or no worker is left.
    IdentifiabilityError
        When all records together answer none of the parameters.
    """
    names = [record.source.name for record in records]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise DataError.at(twice, "names two records", "give every record a name of its own")
    say = progress or (lambda _: None)
    model = fleet_model(module_text)
    sources = [record.source for record in records]
    refuse_same_data([one for one in sources if isinstance(one, RecordChannels)], model.channels)
    choice = stream_choice(model, sources, cutoff_hz, filter_order, decimation, direction_cutoff_hz)
    jobs = [
        Job(module_text, source, replace(choice, decimation=(factor,)), task_samples)
        for source, factor in zip(sources, choice.decimation, strict=True)
    ]
    tasks = {name: client.submit(prepare, job, pure=False) for name, job in zip(names, jobs, strict=True)}
    roots = {}
    for name, job in zip(names, jobs, strict=True):
        parts = [client.submit(part_factors, tasks[name], part, pure=False) for part in job.parts()]
        roots[name] = joined_in_a_tree(client, parts)
    say("filtering the records")
    factors, failed = gathered(roots, "records filtered")
    if not factors:
        raise DataError.at("records", "none could be used: " + "; ".join(failed.values()), "see the reasons")
    _refuse_same(client, model, [source for source in sources if source.name in factors])
    own = {name: client.submit(own_fit, module_text, roots[name], pure=False) for name in factors}
    own_fits, refused_records = gathered(own, "records solved")
    groups = _groups([record for record in records if record.source.name in factors])
    fits: dict[Group, FactorFit] = {("record", name): fit for name, fit in own_fits.items()}
    refused: dict[str, str] = {}
    for group, members in groups.items():
        try:
            fits[group] = fit_records(model, [factors[name] for name in members])
        except ModelgenError as error:
            if group == ALL:
                raise
            refused[group[1]] = str(error)
    groups |= {("record", name): [name] for name in own_fits}
    say("finding covariances")
    spread, lost = _covariances(client, {group: (fit, groups[group]) for group, fit in fits.items()}, tasks)
    estimates = {
        group: stream_estimate(model, [factors[name] for name in groups[group]], fit, spread[group])
        for group, fit in fits.items()
    }
    return FleetEstimate(
        {name: found for (kind, name), found in estimates.items() if kind == "machine"},
        estimates[ALL],
        failed,
        refused,
        {name: found for (kind, name), found in estimates.items() if kind == "record"},
        refused_records,
        lost,
    )


def _refuse_same(client: Any, model: Model, sources: Sequence[Channels]) -> None:
    """Refuse records with the same data; the workers look at them.

    Raises
    ------
    DataError
    """
    submitted = {one.name: client.submit(look, one, model.channels, pure=False) for one in sources}
    looks, _ = gathered(submitted, "records compared")
    seen = [source for source in sources if source.name in looks]
    pairs = alike([looks[source.name] for source in seen])
    whole = {
        f"{i} {k}": client.submit(same_throughout, seen[i], seen[k], model.channels, pure=False)
        for i, k in pairs
    }
    same, _ = gathered(whole, "records compared")
    refuse_pairs(seen, {(i, k): seen[i].n for i, k in pairs if same.get(f"{i} {k}")})


def _groups(records: Sequence[FleetRecord]) -> dict[Group, list[str]]:
    """Return the names of the records of each machine, and of all."""
    groups: dict[Group, list[str]] = {}
    for record in records:
        groups.setdefault(("machine", record.machine), []).append(record.source.name)
    groups[ALL] = [record.source.name for record in records]
    return groups


def _covariances(
    client: Any, fits: Mapping[Group, tuple[FactorFit, list[str]]], tasks: Mapping[str, Any]
) -> tuple[dict[Group, FloatArray | None], dict[str, str]]:
    """Return the HAC covariance of each fit, and the records that were lost on the way, with the reason.

    There is none without a whole inverse, nor where a record was lost.
    """
    # groups of the same records have the same fit: a machine with one record, a fleet of one machine
    chosen = {tuple(members): group for group, (_, members) in list(fits.items())[::-1]}
    uses: dict[str, dict[Group, tuple[FactorFit, int]]] = {}
    for same_members, group in chosen.items():
        if fits[group][0].inverse is not None:
            for index, name in enumerate(same_members):
                uses.setdefault(name, {})[group] = fits[group][0], index
    moments, lost = gathered(
        {n: client.submit(moments_of, tasks[n], list(own.values()), pure=False) for n, own in uses.items()},
        "covariances, first pass",
    )
    own_moments: dict[Group, list[Moments]] = {}
    for name, found in moments.items():
        for group, one in zip(uses[name], found, strict=True):
            own_moments.setdefault(group, []).append(one)
    widths = {group: bandwidth_of(own) for group, own in own_moments.items()}
    second = {}
    for name in moments:
        own_fits, own_widths = list(uses[name].values()), [widths[group] for group in uses[name]]
        second[name] = client.submit(kernel_sums, tasks[name], own_fits, own_widths, pure=False)
    sums, also_lost = gathered(second, "covariances, second pass")
    sums_of: dict[Group, list[KernelSums]] = {}
    for name, totals in sums.items():
        for group, total in zip(uses[name], totals, strict=True):
            sums_of.setdefault(group, []).append(total)
    result: dict[Group, FloatArray | None] = {}
    for group, (fit, members) in fits.items():
        same = chosen[tuple(members)]
        whole = len(sums_of.get(same, [])) == len(members)
        result[group] = covariance_from_sums(fit, own_moments[same], sums_of[same]) if whole else None
    return result, lost | also_lost
