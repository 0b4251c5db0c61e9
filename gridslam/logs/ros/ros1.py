"""Messages of ROS 1, converted to CDR and then decoded as those of ROS 2."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from typing import Any

from gridslam.logs.ros.container import Channel, Container, Schema
from gridslam.logs.ros.definitions import is_valid
from gridslam.logs.ros.types import MAX_SCHEMA_BYTES, full_name, ros2_types

ENCODING = "ros1"  # of messages, as MCAP names it
_UNREADABLE = (("", (0, "")),)  # fields that are no valid ones
_DAMAGE = (ValueError, KeyError, IndexError, AssertionError, struct.error, RuntimeError, EOFError)
_PRESENT_NAMES = {"tf/msg/tfMessage": "tf2_msgs/msg/TFMessage"}  # of types with the same fields


def present_name(name: str) -> str:
    """The name of a type in ROS 2."""
    return _PRESENT_NAMES.get(full_name(name), full_name(name))


class Ros1Types:
    """The types that ROS 1 messages of one file have, given `(type name, definition)` pairs.

    In CDR the header has no `seq`. A type whose definition is wrong is missing: its messages cannot be converted.
    """

    def __init__(self, definitions: Iterable[tuple[str, str]]) -> None:
        from rosbags.typesys import Stores, get_typestore

        types = dict(get_typestore(Stores.ROS1_NOETIC).fielddefs)
        wrong: set[str] = set()
        valid: dict[str, Any] = {}
        for name, text in definitions:
            for found, (_, fields) in _types_in(full_name(name), text).items():
                if is_valid(found, fields):
                    valid[found] = ([], fields)
                else:
                    wrong.add(found)
        types = {name: definition for name, definition in types.items() if name not in wrong} | valid
        types["std_msgs/msg/Header"] = ros2_types().fielddefs["std_msgs/msg/Header"]
        self._store = get_typestore(Stores.EMPTY)
        self._store.register(types)

    def schema_of(self, name: str) -> Schema:
        """The schema of a type's messages in CDR: by its name where ROS 2 has it, else by the definition in the file."""
        from rosbags.typesys import TypesysError

        present = present_name(name)
        if present in ros2_types().fielddefs:
            return Schema(present, "", b"")
        try:
            text, _ = self._store.generate_msgdef(present, ros_version=2)
        except (TypesysError, *_DAMAGE):
            return Schema(present, "", b"")
        return Schema(present, "ros2msg", text.encode())

    def to_cdr(self, raw: bytes, name: str) -> bytes:
        """The message in CDR; empty, which counts as undecodable, where it cannot be converted."""
        from rosbags.serde import SerdeError
        from rosbags.typesys import TypesysError

        try:
            return bytes(self._store.ros1_to_cdr(raw, full_name(name)))
        except (SerdeError, TypesysError, MemoryError, *_DAMAGE):
            return b""


def _types_in(name: str, text: str) -> dict[str, Any]:
    """The types in a definition; `name` alone, without fields, where it cannot be parsed."""
    from rosbags.typesys import TypesysError, get_types_from_msg

    if len(text) <= MAX_SCHEMA_BYTES:
        with suppress(TypesysError, KeyError, ValueError, RecursionError):
            return dict(get_types_from_msg(text, name))
    return {name: ([], _UNREADABLE)}


class Ros1Messages:
    """A container whose channels of ROS 1 messages appear as channels of CDR; the others stay as they are."""

    def __init__(self, container: Container) -> None:
        self._container = container
        self._types: dict[int, tuple[Ros1Types, str] | None] = {}
        self.schemas: dict[int, Schema] = {}

    @property
    def channels(self) -> Mapping[int, Channel]:
        """Channels by number."""
        return {
            number: Channel(c.topic, "cdr", number) if self._types.get(number) else c
            for number, c in self._container.channels.items()
        }

    @property
    def arrival_ns(self) -> int | None:
        """Time of arrival (ns) of the last message that was yielded; None if unknown."""
        return self._container.arrival_ns

    def messages(self) -> Iterator[tuple[int, bytes]]:
        """(channel, data); messages of ROS 1 in CDR."""
        for channel, data in self._container.messages():
            if channel not in self._types:
                self._types[channel] = self._types_of(channel)
            types = self._types[channel]
            yield channel, data if types is None else types[0].to_cdr(data, types[1])

    def _types_of(self, number: int) -> tuple[Ros1Types, str] | None:
        """Types and type name of a channel of ROS 1 messages; None for others."""
        channel = self._container.channels.get(number)
        schema = None if channel is None else self._container.schemas.get(channel.schema_id)
        if channel is None or schema is None:
            return None
        if channel.encoding != ENCODING:
            self.schemas[channel.schema_id] = schema
            return None
        types = Ros1Types([(schema.name, schema.data.decode("utf-8", "replace"))])
        self.schemas[number] = types.schema_of(schema.name)
        return types, schema.name
