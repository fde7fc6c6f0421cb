"""Bags of ROS 1 and ROS 2 by a generator of their bytes: numbers as columns, damage explained."""

from __future__ import annotations

import bz2
import sqlite3
import struct
from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path

import numpy as np
import pytest

from modelgen.errors import DataError
from modelgen.runtime.files.child_process.ros_messages import decoder
from modelgen.runtime.files.formats import open_source
from modelgen.runtime.records.read_record import read_record

N, STEP_NS = 80, 2_000_000
START_NS = 1_714_658_184_000_000_000
Q, F = np.sin(0.3 * np.arange(N)), np.cos(0.2 * np.arange(N))
LINE = "=" * 80
ROS1 = f"""\
# joints
uint8 NONE=0
Header header
string[] name
float64[] position
float64[] effort
Pair[2] pairs
{LINE}
MSG: std_msgs/Header
uint32 seq
time stamp
string frame_id
{LINE}
MSG: drive/Pair
int16 a
float32 b
"""
ROS2 = f"""\
std_msgs/Header header
string<=10[] name
float64[] position
float64[<=8] effort
drive/Pair[2] pairs
{LINE}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{LINE}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
{LINE}
MSG: drive/Pair
int16 a
float32 b
"""


class Packed:
    """Bytes of a message; aligned as CDR is, behind its four bytes, or without gaps."""

    def __init__(self, aligned: bool) -> None:
        self.data, self.aligned = bytearray(b"\x00\x01\x00\x00" if aligned else b""), aligned

    def put(self, code: str, *values: float) -> Packed:
        if self.aligned and values:
            self.data += bytes(-(len(self.data) - 4) % struct.calcsize(code))
        self.data += struct.pack(f"<{len(values)}{code}", *values)
        return self

    def text(self, text: str) -> Packed:
        raw = text.encode() + (b"\0" if self.aligned else b"")
        self.put("I", len(raw)).data.extend(raw)
        return self


def message(k: int, aligned: bool) -> bytes:
    seconds, rest = divmod(START_NS + k * STEP_NS, 10**9)
    made = Packed(aligned)
    if not aligned:
        made.put("I", k)
    made.put("I", seconds, rest).text("base").put("I", 2).text("m").text("carriage")
    made.put("I", 2).put("d", Q[k], -Q[k]).put("I", 1).put("d", F[k])
    for a in (k, -k):
        made.put("h", a).put("f", 0.5 * a)
    return bytes(made.data)


def record(header: dict[str, bytes], data: bytes) -> bytes:
    fields = b"".join(
        struct.pack("<I", len(name) + 1 + len(value)) + name.encode() + b"=" + value
        for name, value in header.items()
    )
    return struct.pack("<I", len(fields)) + fields + struct.pack("<I", len(data)) + data


def bag(path: Path, how: str = "none", definition: str = ROS1) -> None:
    """A bag of ROS 1: its header, one chunk of a connection and messages, logged late and unevenly."""
    own = {"type": b"drive/Joints", "md5sum": b"0" * 32, "message_definition": definition.encode()}
    fields = record(own, b"")
    inner = fields[4 : 4 + struct.unpack("<I", fields[:4])[0]]
    held = record({"op": b"\x07", "conn": struct.pack("<I", 0), "topic": b"/joints"}, inner)
    for k in range(N):
        seconds, rest = divmod(START_NS + k * STEP_NS + 10**7 + 1000 * (k % 7), 10**9)
        header = {"op": b"\x02", "conn": struct.pack("<I", 0), "time": struct.pack("<II", seconds, rest)}
        held += record(header, message(k, aligned=False))
    packed = held
    if how == "bz2":
        packed = bz2.compress(held)
    elif how == "lz4":
        packed = pytest.importorskip("lz4.frame").compress(held)
    top = {"op": b"\x03", "index_pos": struct.pack("<Q", 0), "conn_count": bytes(4), "chunk_count": bytes(4)}
    chunk = {"op": b"\x05", "compression": how.encode(), "size": struct.pack("<I", len(held))}
    path.write_bytes(b"#ROSBAG V2.0\n" + record(top, b" " * 50) + record(chunk, packed))


def db3(path: Path, definition: str | None = ROS2, kind: str = "drive/msg/Joints") -> None:
    """A bag of ROS 2: tables of topics and messages, and, since Iron, of definitions."""
    with closing(sqlite3.connect(path)) as base:
        base.execute(
            "CREATE TABLE topics (id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT)"
        )
        base.execute(
            "CREATE TABLE messages (id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)"
        )
        base.execute("INSERT INTO topics VALUES (1, '/joints', ?, 'cdr')", (kind,))
        base.execute("INSERT INTO topics VALUES (2, '/other', 'own/msg/Thing', 'cdr')")
        if definition is not None:
            base.execute(
                "CREATE TABLE message_definitions (id INTEGER PRIMARY KEY, topic_type TEXT, "
                "encoding TEXT, encoded_message_definition TEXT)"
            )
            base.execute("INSERT INTO message_definitions VALUES (1, ?, 'ros2msg', ?)", (kind, definition))
        rows = [(1, START_NS + k * STEP_NS + 10**7, message(k, aligned=True)) for k in range(N)]
        base.executemany("INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)", rows)
        base.execute(
            "INSERT INTO messages (topic_id, timestamp, data) VALUES (2, ?, ?)", (START_NS, b"\0\1\0\0")
        )
        base.commit()


def packed_messages(path: Path) -> None:
    """A bag whose messages are packed one by one, as rosbag2 does in its mode MESSAGE."""
    zstandard = pytest.importorskip("zstandard")
    db3(path)
    with closing(sqlite3.connect(path)) as base:
        for key, data in list(base.execute("SELECT id, data FROM messages")):
            packed = zstandard.ZstdCompressor().compress(data)
            base.execute("UPDATE messages SET data = ? WHERE id = ?", (packed, key))
        base.commit()


def packed_file(path: Path) -> None:
    """A bag that is packed as a whole, as rosbag2 does in its mode FILE."""
    zstandard = pytest.importorskip("zstandard")
    plain = path.with_name("unpacked.db3")
    db3(plain)
    path.write_bytes(zstandard.ZstdCompressor().compress(plain.read_bytes()))
    plain.unlink()


MADE: dict[str, Callable[[Path], None]] = {
    "plain.bag": bag,
    "bz2.bag": lambda path: bag(path, "bz2"),
    "lz4.bag": lambda path: bag(path, "lz4"),
    "iron.db3": db3,
    "messages.db3": packed_messages,
    "file.db3.zstd": packed_file,
}


@pytest.mark.parametrize("name", MADE)
def test_numbers_are_read_with_the_times_of_their_headers(tmp_path: Path, name: str) -> None:
    MADE[name](tmp_path / name)
    source = open_source(tmp_path / name)
    fields = (
        "position[m]",
        "position[carriage]",
        "effort[0]",
        "pairs[0].a",
        "pairs[0].b",
        "pairs[1].a",
        "pairs[1].b",
    )
    assert source.names == ("time", *(f"/joints.{field}" for field in fields))
    mapping = {"q": "/joints.position[m]", "F": "-/joints.effort[0]", "b": "/joints.pairs[1].b"}
    found = read_record(tmp_path / name, mapping)
    assert found.fs == pytest.approx(500.0, rel=1e-9)
    np.testing.assert_array_equal(found.signals["q"], Q)
    np.testing.assert_array_equal(found.signals["F"], -F)
    np.testing.assert_array_equal(found.signals["b"], -0.5 * np.arange(N))


def test_an_older_bag_of_ros_2_has_standard_messages_only(tmp_path: Path) -> None:
    db3(tmp_path / "humble.db3", None)
    with pytest.raises(DataError):
        read_record(tmp_path / "humble.db3", {"q": "/joints.position[0]"})
    made = (
        Packed(True).put("I", 7, 9).text("x").put("I", 1).text("m").put("I", 1).put("d", 0.25).put("I", 0, 0)
    )
    told = decoder("sensor_msgs/msg/JointState", None, aligned=True)
    assert told is not None and decoder("own/msg/Thing", None, aligned=True) is None
    read = told(bytes(made.data))
    assert (read["header"]["stamp"], list(read["position"]), list(read["effort"])) == (
        {"sec": 7, "nanosec": 9}, [0.25], [])  # fmt: skip


@pytest.mark.parametrize("seed", range(6))
def test_damage_is_explained(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    for name, make in MADE.items():
        make(tmp_path / name)
        data = bytearray((tmp_path / name).read_bytes())
        if seed % 2:
            del data[int(rng.integers(5, len(data))) :]
        for place in rng.integers(0, len(data), 12):
            data[place] = int(rng.integers(256))
        (tmp_path / f"{seed}{name}").write_bytes(data)
        with suppress(DataError):
            read_record(tmp_path / f"{seed}{name}", {"q": "/joints.position[0]"})


@pytest.mark.parametrize(
    "definition",
    [
        "float64 position\n__import__('os').system('touch owned')\nfloat64 x; import os",
        "Own own\n" + LINE + "\nMSG: drive/Own\nOwn own",
        "float64[4000000000] position",
        "string[] name\nNowhere position",
        "float64 " + "x" * (1 << 20),
    ],
)
def test_a_hostile_definition_is_data(tmp_path: Path, definition: str) -> None:
    for name, make in (("a.bag", bag), ("a.db3", db3)):
        if make is bag:
            bag(tmp_path / name, definition=definition)
        else:
            db3(tmp_path / name, definition)
        with suppress(DataError):
            open_source(tmp_path / name)
    assert not (tmp_path / "owned").exists() and not Path("owned").exists()


def test_views_in_place_of_tables_are_refused(tmp_path: Path) -> None:
    with closing(sqlite3.connect(tmp_path / "view.db3")) as base:
        base.execute(
            "CREATE VIEW topics AS SELECT 1 AS id, 'a' AS name, 'b' AS type, 'cdr' AS serialization_format"
        )
        base.execute("CREATE VIEW messages AS SELECT 1 AS id, 1 AS topic_id, 1 AS timestamp, x'00' AS data")
        base.commit()
    with pytest.raises(DataError, match="has no tables topics and messages"):
        open_source(tmp_path / "view.db3")


def test_what_unpacks_without_end_is_refused(tmp_path: Path) -> None:
    zstandard = pytest.importorskip("zstandard")
    packer = zstandard.ZstdCompressor().compressobj()
    pieces = [packer.compress(bytes(1 << 24)) for _ in range(20)]
    (tmp_path / "large.db3.zstd").write_bytes(b"".join([*pieces, packer.flush()]))
    with pytest.raises(DataError, match=r"unpacks to more than \d+ bytes"):
        open_source(tmp_path / "large.db3.zstd")


@pytest.mark.parametrize("name", ["a.csv.gz", "a.mcap.zstd"])
def test_other_packed_files_are_to_be_unpacked(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(b"x")
    with pytest.raises(DataError, match=r"has the suffix '\.\w+\.\w+'; unpack it, and give"):
        open_source(tmp_path / name)
