"""Calls of a reading process (`reader_child`) about an MCAP file; only there are its libraries imported.

Messages of ROS 2 (with the definition that the file carries) and JSON are read; every number in a message is
a column, named by topic and field: /joint_states.position[0].
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from modelgen.read_file import DATA, open_file
from modelgen.runtime.files.size_limits import MOST_COLUMNS

DEEPEST = 12  # messages within messages
MOST_ENTRIES = 100  # of an array in a message: what has more is a scan or a picture
Decoder = Callable[[bytes], Any]


def listing(path: Path) -> Iterator[Any]:
    """Yield the topics, {"topic", "fields", "messages"}, and those that are left out with the reason."""
    topics: dict[str, dict[str, Any]] = {}
    left_out: dict[str, str] = {}
    columns = 0
    for topic, decode, message in _messages(path, None):
        if topic in left_out:
            continue
        if topic in topics:
            topics[topic]["messages"] += 1
        elif decode is None:
            left_out[topic] = "neither ROS 2 nor JSON"
        elif not (fields := [name for name, _ in _numbers(decode(message.data))]):
            left_out[topic] = "without numbers"
        else:
            columns += len(fields)
            topics[topic] = {"topic": topic, "fields": fields, "messages": 1}
        if columns + len(left_out) > MOST_COLUMNS:
            break
    yield list(topics.values())
    yield left_out


def columns(path: Path, wanted: Sequence[Sequence[str]], clocks: Sequence[str]) -> Iterator[Any]:
    """Yield the samples of fields, (topic, field) each, then the times of topics in s.

    A message without a field gives NaN. Times are those of the message's header, else of its logging, since
    the first time of all topics that are asked for.
    """
    topics = {topic for topic, _ in wanted} | set(clocks)
    samples: dict[tuple[str, str], list[float]] = {(topic, field): [] for topic, field in wanted}
    of = {topic: [key for key in samples if key[0] == topic] for topic in topics}
    times: dict[str, list[int]] = {topic: [] for topic in topics}
    for topic, decode, message in _messages(path, sorted(topics)):
        if decode is None:
            continue
        decoded = decode(message.data)
        numbers = dict(_numbers(decoded)) if of[topic] else {}
        for key in of[topic]:
            samples[key].append(numbers.get(key[1], np.nan))
        times[topic].append(_stamp_ns(decoded) or message.log_time)
    for topic, field in wanted:
        yield np.array(samples[topic, field], dtype=float)
    start = min((stamps[0] for stamps in times.values() if stamps), default=0)
    for topic in clocks:
        yield 1e-9 * (np.array(times[topic], dtype=np.int64) - start).astype(float)


def _messages(path: Path, topics: Sequence[str] | None) -> Iterator[tuple[str, Decoder | None, Any]]:
    """Yield topic, decoder (None where there is none) and message, in the order of their times."""
    ros, decoders = DecoderFactory(), dict[int, Decoder | None]()
    with open_file(path, DATA) as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages(topics=topics):
            if channel.id not in decoders:
                as_json = channel.message_encoding == "json"
                decoders[channel.id] = (
                    json.loads if as_json else ros.decoder_for(channel.message_encoding, schema)
                )
            yield channel.topic, decoders[channel.id], message


def _numbers(value: Any, name: str = "", depth: int = 0) -> Iterator[tuple[str, float]]:
    """Yield (field, number) of everything in a message but its header's stamp."""
    if depth > DEEPEST or isinstance(value, (str, bytes)):
        return
    if isinstance(value, (bool, int, float, np.number)):
        yield name, float(value)
        return
    if isinstance(value, (list, tuple, np.ndarray)):
        if len(value) <= MOST_ENTRIES:
            for k, entry in enumerate(value):
                yield from _numbers(entry, f"{name}[{k}]", depth + 1)
        return
    for key, entry in _fields(value).items():
        inner = f"{name}.{key}" if name else str(key)
        if inner != "header":
            yield from _numbers(entry, inner, depth + 1)


def _fields(message: Any) -> dict[str, Any]:
    """Return the fields of a message by name; none of what is no message."""
    if isinstance(message, dict):
        return message
    names: Any = getattr(message, "__slots__", None) or getattr(message, "__dict__", ())
    return {name: getattr(message, name) for name in names if hasattr(message, name)}


def _stamp_ns(message: Any) -> int:
    """Return header.stamp in ns since 1970, 0 where a message has none."""
    parts = _fields(_fields(_fields(message).get("header")).get("stamp"))
    seconds, nanoseconds = parts.get("sec"), parts.get("nanosec", parts.get("nsec"))
    if not (isinstance(seconds, int) and isinstance(nanoseconds, int)):
        return 0
    return seconds * 10**9 + nanoseconds
