"""Fleet: records of many machines on the workers of dask.distributed; one estimate a machine, one pooled.

A worker turns a stretch of a record into small triangles; those of a record are joined in a tree, and only
triangles travel. What cannot be read, and what no worker survives, costs its record and is named.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache
from importlib import import_module
from typing import Any

import numpy as np
import numpy.typing as npt

from modelgen.errors import DataError, ModelgenError
from modelgen.runtime.channels import Channels
from modelgen.runtime.choose import FilterChoice
from modelgen.runtime.chunk import CHUNK_SAMPLES
from modelgen.runtime.contract import Model, model_from_text
from modelgen.runtime.factor_fit import FactorFit, fit_factors
from modelgen.runtime.record_factors import RecordFactors, Task, matched_task, record_factors
from modelgen.runtime.stream import StreamEstimate, stream_choice, stream_estimate
from modelgen.runtime.stream_covariance import (
    BartlettSums,
    Moments,
    MomentSums,
    bandwidth_of,
    inflation,
    influence_chunks,
)

FloatArray = npt.NDArray[np.float64]
Progress = Callable[[str], None]

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
    """

    machines: Mapping[str, StreamEstimate]
    pooled: StreamEstimate
    failed: Mapping[str, str]
    refused: Mapping[str, str]


@contextmanager
def fleet_client(scheduler: str | None = None, workers: int | None = None) -> Iterator[Any]:
    """Yield a client of the scheduler at an address, or of a local cluster with one process a core.

    Raises
    ------
    DataError
        When dask.distributed is not installed, or no scheduler answers.
    """
    try:
        distributed: Any = import_module("distributed")
    except ImportError as error:
        remedy = "get it with: pip install 'modelgen[fleet]'"
        raise DataError.at("fleet", "needs dask.distributed, which is not installed", remedy) from error
    if scheduler is not None:
        try:
            with distributed.Client(scheduler, timeout=10) as client:
                yield client
        except (OSError, TimeoutError) as error:
            remedy = "start one with: dask scheduler"
            raise DataError.at(f"--scheduler {scheduler}", f"does not answer ({error})", remedy) from error
        return
    # one BLAS thread a worker: the workers are the threads
    environment = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
    with (
        distributed.LocalCluster(
            n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None, env=environment
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


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
    """Identify the parameters of every machine, and those that suit all.

    Parameters
    ----------
    client : distributed.Client
        See `fleet_client`.
    module_text : str
        Text of the generated module; the workers execute it.
    records : sequence of FleetRecord
        Their files must be readable where the workers are.
    cutoff_hz, filter_order, decimation, direction_cutoff_hz :
        As for `modelgen.runtime.stream.identify_stream`.
    task_samples : int
        Samples to one task; changes the speed only.
    progress : callable, optional
        Called with a few words as records are done.

    Raises
    ------
    DataError
        When records share a name, or none could be used.
    IdentifiabilityError
        When all records together answer none of the parameters.
    """
    names = [record.source.name for record in records]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise DataError.at(twice, "names two records", "give every record a name of its own")
    say = progress or (lambda _: None)
    model = _model(module_text)
    sources = [record.source for record in records]
    choice = stream_choice(model, sources, cutoff_hz, filter_order, decimation, direction_cutoff_hz)
    jobs = [
        _Job(module_text, source, replace(choice, decimation=(factor,)), task_samples)
        for source, factor in zip(sources, choice.decimation, strict=True)
    ]
    tasks = {name: client.submit(_prepared, job, pure=False) for name, job in zip(names, jobs, strict=True)}
    roots = {
        name: _tree(client, [client.submit(_part, tasks[name], part, pure=False) for part in job.parts()])
        for name, job in zip(names, jobs, strict=True)
    }
    factors, failed = _gathered(roots, say, "filtering")
    if not factors:
        raise DataError.at("records", "none could be used: " + "; ".join(failed.values()), "see the reasons")
    groups: dict[str, list[str]] = {}
    for record in records:
        if record.source.name in factors:
            groups.setdefault(record.machine, []).append(record.source.name)
    fits: dict[str, FactorFit] = {}
    refused: dict[str, str] = {}
    for machine, members in groups.items():
        try:
            fits[machine] = fit_factors(model, [factors[name] for name in members])
        except ModelgenError as error:
            refused[machine] = str(error)
    pooled_members = list(factors)
    pooled = fit_factors(model, list(factors.values()))
    pairs = [(machine, fit, groups[machine]) for machine, fit in fits.items()]
    pairs.append(("", pooled, pooled_members))
    spread = _covariances(client, pairs, tasks, say)
    machines = {
        machine: stream_estimate(model, [factors[name] for name in members], fit, spread[machine])
        for machine, fit, members in pairs[:-1]
    }
    all_records = [factors[name] for name in pooled_members]
    return FleetEstimate(machines, stream_estimate(model, all_records, pooled, spread[""]), failed, refused)


@dataclass(frozen=True, eq=False)
class _Job:
    """What a worker needs to know of a record."""

    module_text: str
    source: Channels
    choice: FilterChoice
    task_samples: int

    def parts(self) -> range:
        return range(max(1, -(-self.source.n // self.task_samples)))


@lru_cache(maxsize=8)
def _model(text: str) -> Model:
    return model_from_text(text, "fleet")


@dataclass(frozen=True, eq=False)
class _Prepared:
    """A job and the grid and survey of its record: what is found once for all its parts."""

    job: _Job
    task: Task

    def __reduce__(self) -> tuple[Any, ...]:
        # a module does not travel, its text does
        return _again, (self.job, self.task.grid, self.task.survey)


def _again(job: _Job, grid: range, survey: Any) -> _Prepared:
    task = _task(job, survey)
    return _Prepared(job, replace(task, grid=grid))


def _prepared(job: _Job) -> _Prepared:
    return _Prepared(job, _task(job, None))


def _task(job: _Job, survey: Any) -> Task:
    return matched_task(
        _model(job.module_text), job.source, job.choice, job.choice.decimation[0], survey=survey
    )


def _part(prepared: _Prepared, index: int) -> RecordFactors:
    """Return the factors of one part of a record's grid, cut at whole blocks."""
    task = prepared.task
    parts = len(prepared.job.parts())
    step = -(-len(task.grid) // parts)
    block = task.plan.feature_operator.block
    step = -(-step // block) * block
    mine = task.grid[index * step : (index + 1) * step]
    return record_factors(replace(task, grid=mine))


def _tree(client: Any, parts: list[Any]) -> Any:
    """Return the future of all parts joined, two by two."""
    while len(parts) > 1:
        joined = [
            client.submit(RecordFactors.joined, a, b, pure=False)
            for a, b in zip(parts[::2], parts[1::2], strict=False)
        ]
        parts = joined + parts[2 * len(joined) :]
    return parts[0]


def _gathered(futures: Mapping[str, Any], say: Progress, what: str) -> tuple[dict[str, Any], dict[str, str]]:
    """Return the results in the order of the records, and the reasons of those that have none."""
    results, failed = {}, {}
    for done, (name, future) in enumerate(futures.items(), start=1):
        try:
            results[name] = future.result()
        except ModelgenError as error:
            failed[name] = str(error)
        except Exception as error:  # whatever a worker died of
            failed[name] = f"{name}: was lost ({type(error).__name__}: {error}); run it again by itself"
        say(f"{what}: {done} of {len(futures)} records")
    return results, failed


def _covariances(
    client: Any,
    fits: Sequence[tuple[str, FactorFit, list[str]]],
    tasks: Mapping[str, Any],
    say: Progress,
) -> dict[str, FloatArray | None]:
    """Return the HAC covariance of each fit; None without a whole inverse, or where a record was lost."""
    wanted = [(machine, fit, members) for machine, fit, members in fits if fit.inverse is not None]
    uses: dict[str, list[tuple[str, FactorFit, int]]] = {}
    for machine, fit, members in wanted:
        for index, name in enumerate(members):
            uses.setdefault(name, []).append((machine, fit, index))
    pairs = {name: [(fit, index) for _, fit, index in own] for name, own in uses.items()}
    first = {name: client.submit(_moments, tasks[name], own, pure=False) for name, own in pairs.items()}
    found, _ = _gathered(first, say, "covariances, first pass")
    moments_of = {
        machine: [_of(machine, uses[name], found[name]) for name in members if name in found]
        for machine, _, members in wanted
    }
    widths = {machine: bandwidth_of(own) if own else 1.0 for machine, own in moments_of.items()}
    second = {
        name: client.submit(
            _sums, tasks[name], pairs[name], [widths[machine] for machine, _, _ in own], pure=False
        )
        for name, own in uses.items()
    }
    sums, _ = _gathered(second, say, "covariances, second pass")
    result: dict[str, FloatArray | None] = {machine: None for machine, _, _ in fits}
    for machine, fit, members in wanted:
        own_sums = [_of(machine, uses[name], sums[name]) for name in members if name in sums]
        if len(own_sums) == len(moments_of[machine]) == len(members):
            result[machine] = np.sum(own_sums, axis=0) * inflation(fit, moments_of[machine])
    return result


def _of(machine: str, uses: list[tuple[str, FactorFit, int]], values: list[Any]) -> Any:
    return next(value for (name, _, _), value in zip(uses, values, strict=True) if name == machine)


def _moments(prepared: _Prepared, fits: list[tuple[FactorFit, int]]) -> list[Moments]:
    sums = [MomentSums(len(fit.columns)) for fit, _ in fits]
    for found in influence_chunks(fits, prepared.task):
        for one, psi in zip(sums, found, strict=True):
            one.add(psi)
    return [one.result() for one in sums]


def _sums(prepared: _Prepared, fits: list[tuple[FactorFit, int]], widths: list[float]) -> list[FloatArray]:
    sums = [BartlettSums(len(fit.columns), width) for (fit, _), width in zip(fits, widths, strict=True)]
    for found in influence_chunks(fits, prepared.task):
        for one, psi in zip(sums, found, strict=True):
            one.add(psi)
    return [one.result() for one in sums]
