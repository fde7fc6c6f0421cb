"""A checkpoint of a fleet: what came of each machine, a file each; a run that was stopped goes on."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from modelgen.atomic_write import write_whole
from modelgen.documents import json_document
from modelgen.errors import DataError, ModelgenError
from modelgen.read_file import CHECKPOINT, read_text
from modelgen.runtime.fleet.worker import FleetRecord, MachineReport
from modelgen.runtime.results.estimate_file import checked_estimate

FORMAT = "modelgen fleet machine"


class Checkpoint:
    """Reports of machines in a folder; what does not fit data, model or options any more is made anew."""

    def __init__(self, folder: Path, module_text: str, options: Mapping[str, Any]) -> None:
        self._folder = folder
        self._common = f"{module_text}\0{sorted((key, repr(value)) for key, value in options.items())!r}"
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            remedy = "give a folder that can be written"
            raise DataError.at(str(folder), f"cannot be used ({error.strerror})", remedy) from error

    def load(self, machine: str, records: Sequence[FleetRecord]) -> MachineReport | None:
        """Return the report of a machine that was finished with just these records; None otherwise."""
        path = self._path(machine, records)
        if path is None or not path.exists():
            return None
        try:
            saved = json_document(read_text(path, CHECKPOINT), str(path), CHECKPOINT.remedy)
            if saved["format"] != FORMAT or saved["machine"] != machine:
                return None
            looks = {name: np.array(samples, dtype=float) for name, samples in saved["looks"].items()}
            if not all(one.ndim == 1 and one.size and np.isfinite(one).all() for one in looks.values()):
                return None
            estimate = saved["estimate"]
            document = None if estimate is None else checked_estimate(estimate, str(path))
            failed = {str(name): str(reason) for name, reason in saved["failed"].items()}
            return MachineReport(document, str(saved["reason"]), failed, looks)
        except (ModelgenError, KeyError, TypeError, AttributeError, ValueError):
            return None  # damaged, or of another version: the machine is done again

    def save(self, machine: str, records: Sequence[FleetRecord], report: MachineReport) -> None:
        """Keep the report of a machine, unless the data of a record has no stamp to know it by."""
        path = self._path(machine, records)
        if path is None:
            return
        entries = {
            "format": FORMAT,
            "machine": machine,
            "estimate": report.document,
            "reason": report.reason,
            "failed": dict(report.failed),
            "looks": {name: samples.tolist() for name, samples in report.looks.items()},
        }
        write_whole(path, (json.dumps(entries) + "\n").encode(), overwrite=True)

    def _path(self, machine: str, records: Sequence[FleetRecord]) -> Path | None:
        if not all(record.stamp for record in records):
            return None
        told = repr((self._common, machine, [(record.name, record.stamp) for record in records]))
        return self._folder / f"{sha256(told.encode()).hexdigest()[:32]}.json"
