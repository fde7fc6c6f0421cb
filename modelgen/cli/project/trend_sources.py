"""Histories, projects and saved estimates -> the estimates of each machine, in their order."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date as Date
from pathlib import Path

from modelgen.errors import DataError, Problem
from modelgen.project.history import HistoryEntry, load_history
from modelgen.project.project_file import load_project
from modelgen.runtime.results.estimate import Estimate

SAVED = "estimates"  # what files of single estimates are called together
REMEDY = "give a project (.toml), its history (.jsonl), or two or more saved estimates (.json)"


@dataclass(frozen=True, eq=False)
class Machine:
    """The estimates of one machine, what each is called, and what is to be said of them."""

    name: str
    labels: tuple[str, ...]
    estimates: tuple[Estimate, ...]
    notes: tuple[str, ...] = ()


def machines_of(sources: Sequence[Path]) -> tuple[Machine, ...]:
    """Return the machines that the sources are of, in the order in which they appear.

    Raises
    ------
    DataError
        For what is none of these, and for a machine of one estimate only.
    """
    problems = [
        Problem(str(source), "is given twice", "give it once")
        for k, source in enumerate(sources)
        if os.path.abspath(source) in map(os.path.abspath, sources[:k])
    ]
    DataError.raise_any(problems)
    entries: dict[str, list[HistoryEntry]] = {}
    saved: list[Path] = []
    for source in sources:
        if source.suffix == ".json":
            saved.append(source)
            continue
        for entry in load_history(_history_of(source)):
            entries.setdefault(entry.project, []).append(entry)
    machines = [_machine(name, found) for name, found in entries.items()]
    if saved:
        names = _distinct([path.stem for path in saved])
        machines.append(Machine(SAVED, names, tuple(Estimate.load(path) for path in saved)))
    problems = [
        Problem(one.name, f"has {len(one.estimates)} estimate, and nothing to compare it with", REMEDY)
        for one in machines
        if len(one.estimates) < 2
    ]
    DataError.raise_any(problems)
    return tuple(machines)


def _history_of(source: Path) -> Path:
    if source.suffix == ".toml":
        project = load_project(source, with_records=False)
        if not project.history.exists():
            remedy = f"make it: modelgen run {source}"
            raise DataError.at(str(project.history), "is not there yet", remedy)
        return project.history
    if source.suffix != ".jsonl":
        raise DataError.at(str(source), "is no history", REMEDY)
    return source


def _machine(name: str, entries: Sequence[HistoryEntry]) -> Machine:
    """Return a machine's estimates by date; of several estimates from the same records the last one made."""
    latest: dict[frozenset[str], HistoryEntry] = {}
    for entry in entries:
        latest[frozenset(entry.records.values())] = entry
    kept = list(latest.values())
    if all(entry.date is not None for entry in kept):
        kept.sort(key=lambda entry: entry.date or Date.min)
    labels = _distinct([entry.label for entry in kept])
    notes = []
    dropped = len(entries) - len(kept)
    if dropped:
        notes.append(f"{dropped} earlier estimates of the same records are left out")
    for k, one in enumerate(kept):
        for label, other in zip(labels[:k], kept[:k], strict=True):
            if set(one.records.values()) & set(other.records.values()):
                notes.append(f"{labels[k]} and {label} share a record: their errors are alike")
    return Machine(name, labels, tuple(entry.estimate for entry in kept), tuple(notes))


def _distinct(labels: Sequence[str]) -> tuple[str, ...]:
    """Return the labels, numbered where several are alike."""
    return tuple(
        label if labels.count(label) == 1 else f"{label} #{labels[: k + 1].count(label)}"
        for k, label in enumerate(labels)
    )
