"""Calls of a reading process (`reader_child`) about an MCAP file; only there are its libraries imported.

Messages of ROS 2 (with the definition that the file carries) and JSON are read, see `message_columns`.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from modelgen.read_file import DATA, open_file
from modelgen.runtime.files.child_process.message_columns import (
    Decoder,
    Message,
    columns_of,
    listing_of,
)


def listing(path: Path) -> Iterator[Any]:
    """Yield the topics and those that are left out, see `message_columns`."""
    return listing_of(_messages(path, None), "neither ROS 2 nor JSON")


def columns(path: Path, wanted: Sequence[Sequence[str]], clocks: Sequence[str]) -> Iterator[Any]:
    """Yield the samples of fields and the times of topics, see `message_columns`."""
    return columns_of(partial(_messages, path), wanted, clocks)


def _messages(path: Path, topics: Sequence[str] | None) -> Iterator[Message]:
    """Yield the messages in the order of their times."""
    ros, decoders = DecoderFactory(), dict[int, Decoder | None]()
    with open_file(path, DATA) as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages(topics=topics):
            if channel.id not in decoders:
                as_json = channel.message_encoding == "json"
                decoders[channel.id] = (
                    json.loads if as_json else ros.decoder_for(channel.message_encoding, schema)
                )
            yield channel.topic, decoders[channel.id], message.data, message.log_time
