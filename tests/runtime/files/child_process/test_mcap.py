"""MCAP files as ROS 2 and others write them: every number a column, times of headers, damage explained."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from modelgen.errors import DataError
from modelgen.runtime.files.formats import open_source
from modelgen.runtime.records.read_record import read_record

pytest.importorskip("mcap_ros2")
from mcap.writer import CompressionType, Writer
from mcap_ros2.writer import Writer as RosWriter

N, STEP_NS = 80, 2_000_000
START_NS = 1_714_658_184_000_000_000
Q, F = np.sin(0.3 * np.arange(N)), np.cos(0.2 * np.arange(N))
JOINT_STATE = """\
std_msgs/Header header
string[] name
float64[] position
float64[] effort
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""


def stamp(k: int, late_ns: int = 0) -> dict[str, int]:
    seconds, rest = divmod(START_NS + k * STEP_NS + late_ns, 10**9)
    return {"sec": seconds, "nanosec": rest}


def ros(path: Path) -> None:
    """Joint states with times of measurement in their headers, logged late and unevenly; and a text."""
    with path.open("wb") as file:
        writer = RosWriter(file)
        joints = writer.register_msgdef("sensor_msgs/msg/JointState", JOINT_STATE)
        text = writer.register_msgdef("std_msgs/msg/String", "string data")
        for k in range(N):
            header = {"stamp": stamp(k), "frame_id": ""}
            message = {"header": header, "name": ["m", "c"], "position": [Q[k], -Q[k]], "effort": [F[k], 0.0]}
            logged = START_NS + k * STEP_NS + 10**7 + 1000 * (k % 7)
            writer.write_message("/joint_states", joints, message, logged, logged)
            writer.write_message("/rosout", text, {"data": "x"}, logged, logged)
        writer.finish()


def foxglove(path: Path, compression: CompressionType = CompressionType.ZSTD) -> None:
    """Two topics of JSON, the second started later, and one of another encoding."""
    with path.open("wb") as file:
        writer = Writer(file, compression=compression)
        writer.start()
        schema = writer.register_schema("any", "jsonschema", b"{}")
        drive = writer.register_channel("/drive", "json", schema)
        sensor = writer.register_channel("/sensor", "json", schema)
        other = writer.register_channel("/other", "protobuf", schema)
        for k in range(N):
            at = START_NS + k * STEP_NS
            writer.add_message(drive, at, json.dumps({"theta": Q[k], "axis": {"torque": F[k]}}).encode(), at)
            if k >= 10:
                writer.add_message(sensor, at, json.dumps({"acc": Q[k]}).encode(), at)
            writer.add_message(other, at, b"\x08\x01", at)
        writer.finish()


def test_joint_states_are_read_with_the_times_of_their_headers(tmp_path: Path) -> None:
    ros(tmp_path / "run.mcap")
    source = open_source(tmp_path / "run.mcap")
    assert source.names == (
        "time",
        *(f"/joint_states.{f}[{k}]" for f in ("position", "effort") for k in ("m", "c")),
    )
    assert any("/rosout (without numbers)" in text for text in source.took)
    mapping = {"q_m": "/joint_states.position[m]", "F": "-/joint_states.effort[m]"}
    record = read_record(tmp_path / "run.mcap", mapping)
    assert record.fs == pytest.approx(500.0, rel=1e-9)
    np.testing.assert_array_equal(record.signals["q_m"], Q)
    np.testing.assert_array_equal(record.signals["F"], -F)


def test_publishers_of_other_joints_on_one_topic_are_streams(tmp_path: Path) -> None:
    """An arm at 500 Hz and a gripper at 100 Hz, which the driver publishes on the same topic."""
    path = tmp_path / "run.mcap"
    with path.open("wb") as file:
        writer = RosWriter(file)
        joints = writer.register_msgdef("sensor_msgs/msg/JointState", JOINT_STATE)
        for k in range(N):
            logged = START_NS + k * STEP_NS
            if k % 5 == 0:
                own = {"name": ["finger"], "position": [float(k)], "effort": [0.0]}
                writer.write_message(
                    "/joint_states",
                    joints,
                    {"header": {"stamp": stamp(k), "frame_id": ""}, **own},
                    logged,
                    logged,
                )
            arm = {"name": ["c", "m"], "position": [-Q[k], Q[k]], "effort": [0.0, F[k]]}
            arm = {"header": {"stamp": stamp(k, 1000), "frame_id": ""}, **arm}
            writer.write_message("/joint_states", joints, arm, logged, logged)
        writer.finish()
    source = open_source(path)
    assert "time (/joint_states.position[c])" in source.names
    assert source.took[0].startswith("an MCAP file of 1 topic(s)")
    mapping = {"q_m": "/joint_states.position[m]", "F": "/joint_states.effort[m]"}
    record = read_record(path, mapping)
    assert record.fs == pytest.approx(500.0, rel=1e-9)
    np.testing.assert_array_equal(record.signals["q_m"], Q)
    np.testing.assert_array_equal(record.signals["F"], F)
    finger = source.load(["time", "/joint_states.position[finger]"])
    np.testing.assert_allclose(finger["time"], 5e-9 * STEP_NS * np.arange(N // 5), atol=1e-12)
    np.testing.assert_array_equal(finger["/joint_states.position[finger]"], np.arange(0, N, 5))


@pytest.mark.parametrize("compression", [CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD])
def test_topics_have_times_of_their_own(tmp_path: Path, compression: CompressionType) -> None:
    path = tmp_path / "run.mcap"
    foxglove(path, compression)
    source = open_source(path)
    assert source.names == ("time", "/drive.theta", "/drive.axis.torque", "time (/sensor)", "/sensor.acc")
    assert any("/other (neither ROS 2 nor JSON)" in text for text in source.took)
    np.testing.assert_array_equal(read_record(path, {"F": "/drive.axis.torque"}).signals["F"], F)
    mapping = {"q_m": "/drive.theta", "a_c": "/sensor.acc"}
    with pytest.raises(DataError, match=r"starts 0\.02 s after"):
        read_record(path, mapping)
    record = read_record(path, mapping, mend=("clocks",))
    np.testing.assert_allclose(record.signals["a_c"], Q[10:], atol=1e-12)


def hostile(change: Callable[[bytearray], Any]) -> Callable[[Path], None]:
    def write(path: Path) -> None:
        foxglove(path)
        data = bytearray(path.read_bytes())
        change(data)
        path.write_bytes(bytes(data))

    return write


@pytest.mark.parametrize(
    "write",
    [
        hostile(lambda data: data.__delitem__(slice(len(data) // 2, None))),
        hostile(lambda data: data.__setitem__(slice(0, 8), b"\0" * 8)),
        hostile(lambda data: data.__setitem__(slice(60, 200), b"\xff" * 140)),
        lambda path: path.write_bytes(b"not one"),
    ],
)
def test_a_damaged_file_is_explained(tmp_path: Path, write: Callable[[Path], None]) -> None:
    write(tmp_path / "run.mcap")
    with pytest.raises(DataError, match=r"run\.mcap: .*MCAP"):
        read_record(tmp_path / "run.mcap")


@pytest.mark.parametrize("seed", range(30))
def test_changed_bytes_end_in_an_answer(tmp_path: Path, seed: int) -> None:
    ros(tmp_path / "run.mcap")
    data = bytearray((tmp_path / "run.mcap").read_bytes())
    random = np.random.default_rng(seed)
    for place in random.integers(0, len(data), 4):
        data[place] = int(random.integers(256))
    (tmp_path / "run.mcap").write_bytes(bytes(data))
    with suppress(DataError):
        read_record(tmp_path / "run.mcap", {"q": "/joint_states.position[0]"}, fs=500.0)


def deep(depth: int) -> Any:
    return {"a": deep(depth - 1)} if depth else 1.0


@pytest.mark.parametrize(
    "value", [deep(400), {"x": list(range(5000))}, {str(k): 1 for k in range(20_000)}, {"x": 1e400}]
)
def test_messages_beyond_all_measure(tmp_path: Path, value: Any) -> None:
    path = tmp_path / "run.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel("/t", "json", writer.register_schema("any", "jsonschema", b"{}"))
        for k in range(3):
            writer.add_message(channel, k, json.dumps(value).encode(), k)
        writer.finish()
    with pytest.raises(DataError):
        read_record(path, {"q": "/t.x"}, fs=1.0)


def test_joints_are_told_by_their_names_in_whatever_order(tmp_path: Path) -> None:
    turns = [({"name": ["m", "c"], "v": [1.0, 2.0]}), ({"name": ["c", "m"], "v": [2.0, 1.0]})]
    kinds: dict[str, Any] = {
        "/swapped": turns,
        "/doubled": [{"name": ["m", "m"], "v": [1.0, 2.0]}] * 2,
        "/odd": [{"name": ["m]", "c"], "v": [1.0, 2.0]}] * 2,
        "/more": [{"name": ["m"], "v": [1.0, 2.0]}] * 2,
    }
    with (tmp_path / "a.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("any", "jsonschema", b"{}")
        for topic, messages in kinds.items():
            channel = writer.register_channel(topic, "json", schema)
            for k, message in enumerate(messages):
                at = START_NS + k * STEP_NS
                writer.add_message(channel, at, json.dumps(message).encode(), at)
        writer.finish()
    source = open_source(tmp_path / "a.mcap")
    found = source.load(("/swapped.v[m]", "/swapped.v[c]"))
    np.testing.assert_array_equal(found["/swapped.v[m]"], [1.0, 1.0])
    np.testing.assert_array_equal(found["/swapped.v[c]"], [2.0, 2.0])
    assert {f"{topic}.v[{k}]" for topic in ("/doubled", "/odd", "/more") for k in (0, 1)} <= source.known
