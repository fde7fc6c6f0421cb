"""Calls of a reading process (`reader_child`) about bags of ROS 1 (.bag) and of ROS 2 (.db3, SQLite).

Both are read by hand: the library for bags executes code that it makes of the definitions in them.
http://wiki.ros.org/Bags/Format/2.0; messages become columns as in `message_columns`. rosbag2 packs single
messages by zstd, or the whole file (.db3.zstd).
"""

from __future__ import annotations

import bz2
import sqlite3
import struct
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, BinaryIO

from modelgen.read_file import DATA, open_file
from modelgen.runtime.files.child_process.message_columns import (
    Decoder,
    Message,
    columns_of,
    listing_of,
)
from modelgen.runtime.files.child_process.ros_messages import decoder

MAGIC = b"#ROSBAG V2.0\n"
MESSAGE, CHUNK, CONNECTION = 0x02, 0x05, 0x07
LARGEST_CHUNK = 1 << 30  # bytes, unpacked
LARGEST_BASE = 1 << 32
PIECE = 1 << 20
ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"  # no message begins so: CDR has a zero first


def listing(path: Path) -> Iterator[Any]:
    """Yield the topics and those that are left out, see `message_columns`."""
    return listing_of(_messages(path, None), "a type without its definition in the bag")


def columns(path: Path, wanted: Sequence[Sequence[str]], clocks: Sequence[str]) -> Iterator[Any]:
    """Yield the samples of fields and the times of topics, see `message_columns`."""
    return columns_of(partial(_messages, path), wanted, clocks)


def _messages(path: Path, topics: Sequence[str] | None) -> Iterator[Message]:
    found = _of_ros1(path) if path.suffix.lower() == ".bag" else _of_ros2(path)
    return (message for message in found if topics is None or message[0] in topics)


def _of_ros1(path: Path) -> Iterator[Message]:
    connections: dict[bytes, tuple[str, Decoder | None]] = {}
    with open_file(path, DATA) as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise ValueError("it is no bag of version 2.0")
        for header, data in _records(file):
            if header.get("op", b"\0")[0] == CHUNK:
                for inner, held in _chunk_records(_unpacked(header, data)):
                    yield from _told(connections, inner, held)
            else:
                yield from _told(connections, header, data)


def _told(
    connections: dict[bytes, tuple[str, Decoder | None]], header: Mapping[str, bytes], data: bytes
) -> Iterator[Message]:
    """Yield the message of a record, if it is one; a connection is remembered."""
    kind = header.get("op", b"\0")[0]
    if kind == CONNECTION and header["conn"] not in connections:
        own = _header(data)
        text = own["message_definition"].decode(errors="replace")
        connections[header["conn"]] = (
            header["topic"].decode(errors="replace"),
            decoder(own["type"].decode(errors="replace"), text, aligned=False),
        )
    elif kind == MESSAGE:
        topic, decode = connections[header["conn"]]
        seconds, nanoseconds = struct.unpack("<II", header["time"])
        yield topic, decode, data, seconds * 10**9 + nanoseconds


def _records(file: BinaryIO) -> Iterator[tuple[dict[str, bytes], bytes]]:
    while begin := file.read(4):
        header = _header(_exactly(file, _size(begin)))
        yield header, _exactly(file, _size(_exactly(file, 4)))


def _chunk_records(data: bytes) -> Iterator[tuple[dict[str, bytes], bytes]]:
    at = 0
    while at < len(data):
        parts = []
        for _ in range(2):
            size = _size(data[at : at + 4])
            parts.append(data[at + 4 : at + 4 + size])
            if len(parts[-1]) < size:
                raise ValueError("a chunk ends within a record")
            at += 4 + size
        yield _header(parts[0]), parts[1]


def _header(data: bytes) -> dict[str, bytes]:
    found, at = {}, 0
    while at < len(data):
        size = _size(data[at : at + 4])
        name, equals, value = data[at + 4 : at + 4 + size].partition(b"=")
        if not equals:
            raise ValueError("the header of a record is damaged")
        found[name.decode(errors="replace")] = value
        at += 4 + size
    return found


def _unpacked(header: Mapping[str, bytes], data: bytes) -> bytes:
    size, how = _size(header["size"]), header["compression"]
    if size > LARGEST_CHUNK:
        raise ValueError(f"a chunk of {size} bytes is larger than any that ROS writes")
    if how == b"bz2":
        data = bz2.BZ2Decompressor().decompress(data, size + 1)
    elif how == b"lz4":
        data = _lz4(data, size + 1)
    elif how != b"none":
        raise ValueError(f"its chunks are packed by {how.decode(errors='replace')!r}")
    if len(data) != size:
        raise ValueError("a chunk has not the size that it states")
    return data


def _lz4(data: bytes, most: int) -> bytes:
    try:
        frame = import_module("lz4.frame")  # comes with mcap
    except ImportError as error:
        raise ValueError("its chunks are packed by lz4, which needs pip install 'modelgen[io]'") from error
    return bytes(frame.LZ4FrameDecompressor().decompress(data, most))


def _zstd(data: bytes, most: int) -> bytes:
    try:
        library = import_module("zstandard")  # comes with mcap
    except ImportError as error:
        raise ValueError("it is packed by zstd, which needs pip install 'modelgen[io]'") from error
    found = bytearray()
    try:
        with library.ZstdDecompressor().stream_reader(data) as stream:
            while piece := stream.read(PIECE):
                found += piece
                if len(found) > most:
                    raise MemoryError
    except MemoryError as error:
        raise ValueError(f"it unpacks to more than {len(found)} bytes") from error
    return bytes(found)


def _size(data: bytes) -> int:
    if len(data) < 4:
        raise ValueError("it ends within a record")
    return int(struct.unpack("<I", data[:4])[0])


def _exactly(file: BinaryIO, size: int) -> bytes:
    data = file.read(size)
    if len(data) < size:
        raise ValueError("it ends within a record")
    return data


def _of_ros2(path: Path) -> Iterator[Message]:
    with closing(_base(path)) as base:
        base.execute("PRAGMA trusted_schema = OFF")
        tables = dict(base.execute("SELECT name, sql FROM sqlite_master WHERE type = 'table'"))
        plain = [name for name, sql in tables.items() if "virtual" not in str(sql).lower()[:40]]
        if "topics" not in plain or "messages" not in plain:
            raise ValueError("it is no bag of ROS 2: it has no tables topics and messages")
        texts: dict[str, str] = {}
        if "message_definitions" in plain:
            rows = base.execute(
                "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
            )
            texts = {kind: text for kind, encoding, text in rows if encoding == "ros2msg"}
        topics: dict[int, tuple[str, Decoder | None]] = {}
        for number, name, kind, form in base.execute(
            "SELECT id, name, type, serialization_format FROM topics"
        ):
            topics[number] = (
                str(name),
                decoder(kind, texts.get(kind), aligned=True) if form == "cdr" else None,
            )
        for number, stamp, data in base.execute(
            "SELECT topic_id, timestamp, data FROM messages ORDER BY timestamp, id"
        ):
            if number in topics:
                raw = bytes(data)
                held = _zstd(raw, LARGEST_CHUNK) if raw.startswith(ZSTD_MAGIC) else raw
                yield (*topics[number], held, int(stamp))


def _base(path: Path) -> sqlite3.Connection:
    if path.suffix.lower() == ".db3":
        return sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro&immutable=1", uri=True)
    base = sqlite3.connect(":memory:")
    with open_file(path, DATA) as file:
        base.deserialize(_zstd(file.read(), LARGEST_BASE))
    return base
