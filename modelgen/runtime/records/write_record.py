"""Record -> file, whole or not at all; `read.read_record` gives back the same record, to the last bit."""

from __future__ import annotations

import csv
import io
import json
import re
import zipfile
from pathlib import Path

import numpy as np

from modelgen.atomic_write import write_whole
from modelgen.errors import DataError, Problem
from modelgen.runtime.files.text import RECORD_MARK
from modelgen.runtime.records.record import Record

RESERVED = {".csv": ("t", "time", "Time"), ".npz": ("fs", "Fs", "name", "tag", "t", "time", "Time")}
# what a spreadsheet would take for a formula (= + - @) is no beginning of a key
SAFE_KEY = r"[^\s,;\"#/\\=+@-][^,;\"/\\\t\r\n]*(?<!\s)"

# In the header: what follows a separator within a name would be a cell, and a formula, in a spreadsheet.
NO_SEPARATORS = str.maketrans({",": "\\u002c", ";": "\\u003b"})


def write_record(path: str | Path, record: Record, overwrite: bool = False) -> None:
    """Write a record to a ``.csv`` or ``.npz`` file.

    The csv file has one comment line (fs, name and tag as JSON), a header line, the times t in s and the
    channels with every digit they have. The archive holds fs in Hz, name, tag and one array per channel.

    Raises
    ------
    DataError
        When the suffix is neither, or a channel's key cannot be a column's name there.
    ModelgenError
        When the file exists and `overwrite` is false, or cannot be written.
    """
    target = Path(path)
    suffix = target.suffix.lower()
    if suffix not in RESERVED:
        raise DataError.at(str(target), f"has the suffix {target.suffix!r}", "write to a .csv or .npz file")
    problems = [
        Problem(f"{target}: channel {key}", "cannot name a column of this file", "rename the channel")
        for key in record.signals
        if key in RESERVED[suffix] or not re.fullmatch(SAFE_KEY, key)
    ]
    DataError.raise_any(problems)
    write_whole(target, _csv(record) if suffix == ".csv" else _npz(record), overwrite=overwrite)


def _csv(record: Record) -> bytes:
    text = io.StringIO()
    stated = {"fs": record.fs, "name": record.name, "tag": record.tag}
    parts = (f'"{key}": {json.dumps(value).translate(NO_SEPARATORS)}' for key, value in stated.items())
    text.write(f"{RECORD_MARK}{{{', '.join(parts)}}}\n")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["t", *record.signals])
    columns = [np.arange(record.n) / record.fs, *record.signals.values()]
    writer.writerows(zip(*(column.tolist() for column in columns), strict=True))
    return text.getvalue().encode()


def _npz(record: Record) -> bytes:
    """Return the archive; not by numpy.savez, whose own argument names could not be channels."""
    arrays = {"fs": np.array(record.fs), "name": np.array(record.name)}
    if record.tag is not None:
        arrays["tag"] = np.array(record.tag)
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_STORED) as archive:
        for key, array in {**arrays, **record.signals}.items():
            member = io.BytesIO()
            np.lib.format.write_array(member, array, allow_pickle=False)
            # an entry without a time of its own: the same record is the same bytes
            archive.writestr(zipfile.ZipInfo(f"{key}.npy"), member.getvalue())
    return data.getvalue()
