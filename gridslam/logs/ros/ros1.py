"""Converts ROS 1 messages to CDR, so that they can be decoded as ROS 2 messages."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from typing import Any

from gridslam.logs.kind_lookup import kind_of_ros_type
from gridslam.logs.ros.container import Channel, Container, Schema
from gridslam.logs.ros.definitions import BadDefinitionError, is_valid, refuse_unbounded, types_within
from gridslam.logs.ros.types import MAX_DEFINITIONS, MAX_SCHEMA_BYTES, full_name, ros2_types

ENCODING = "ros1"  # of messages, as MCAP names it
_UNREADABLE = (("", (0, "")),)  # fields that are not valid
_DAMAGE = (ValueError, KeyError, IndexError, AssertionError, struct.error, RuntimeError, EOFError)
_PRESENT_NAMES = {"tf/msg/tfMessage": "tf2_msgs/msg/TFMessage"}  # of types with the same fields


def present_name(name: str) -> str:
    """The name of a type in ROS 2."""
    return _PRESENT_NAMES.get(full_name(name), full_name(name))


def is_used(name: str) -> bool:
    """Whether any kind of stream has messages of this type."""
    return kind_of_ros_type(present_name(name)) != "other"


class Ros1Types:
    """The types that ROS 1 messages of one file have, given `(type name, definition)` pairs.

    In CDR the header has no `seq`. A type whose definition is wrong is missing: its messages cannot be converted.
    """

    def __init__(self, definitions: Iterable[tuple[str, str]]) -> None:
        from rosbags.typesys import Stores, get_typestore

        from gridslam.logs.ros.type_store import BoundedTypestore

        types = dict(get_typestore(Stores.ROS1_NOETIC).fielddefs)
        wrong: set[str] = set()
        valid: dict[str, Any] = {}
        names = []
        for name, text in definitions:
            names.append(full_name(name))
            for found, (_, fields) in _types_in(full_name(name), text).items():
                if is_valid(found, fields):
                    valid[found] = ([], fields)
                else:
                    wrong.add(found)
        types = {name: definition for name, definition in types.items() if name not in wrong} | valid
        types["std_msgs/msg/Header"] = ros2_types().fielddefs["std_msgs/msg/Header"]
        self._store = BoundedTypestore()
        needed = {found for name in names for found in types_within(types, name)}
        self._store.register({found: types[found] for found in sorted(needed)})
        self._bounded: dict[str, bool] = {}

    def schema_of(self, name: str) -> Schema:
        """The schema of a type's messages in CDR: that of ROS 2 if it has this type, else the definition in the file."""
        from rosbags.typesys import TypesysError

        present = present_name(name)
        if present in ros2_types().fielddefs or not self._is_bounded(present):
            return Schema(present, "", b"")
        try:
            text, _ = self._store.generate_msgdef(present, ros_version=2)
        except (TypesysError, *_DAMAGE):
            return Schema(present, "", b"")
        return Schema(present, "ros2msg", text.encode())

    def to_cdr(self, raw: bytes, name: str) -> bytes:
        """The message in CDR; empty, and so undecodable, if it cannot be converted."""
        from rosbags.serde import SerdeError
        from rosbags.typesys import TypesysError

        if not self._is_bounded(full_name(name)):
            return b""
        try:
            return bytes(self._store.ros1_to_cdr(raw, full_name(name)))
        except (SerdeError, TypesysError, MemoryError, *_DAMAGE):
            return b""

    def _is_bounded(self, name: str) -> bool:
        """Whether the cost of a type's messages is bounded by their size."""
        if name not in self._bounded:
            with suppress(BadDefinitionError):
                refuse_unbounded(self._store.fielddefs, name)
                self._bounded[name] = True
        return self._bounded.setdefault(name, False)


def _types_in(name: str, text: str) -> dict[str, Any]:
    """The types in a definition; only `name`, without fields, if it cannot be parsed."""
    from rosbags.typesys import TypesysError, get_types_from_msg

    if len(text) <= MAX_SCHEMA_BYTES:
        with suppress(TypesysError, KeyError, ValueError, RecursionError):
            return dict(get_types_from_msg(text, name))
    return {name: ([], _UNREADABLE)}


class Ros1Messages:
    """A container whose channels with ROS 1 messages appear as channels with CDR; other channels are unchanged.

    Messages of unused types are not converted, because they are not decoded.
    """

    def __init__(self, container: Container) -> None:
        self._container = container
        self._of_definition: dict[Schema, Ros1Types] = {}
        self._types: dict[int, tuple[Ros1Types, str] | None] = {}
        self.channels: dict[int, Channel] = {}
        self.schemas: dict[int, Schema] = {}

    @property
    def arrival_ns(self) -> int | None:
        """Time of arrival (ns) of the last message that was yielded; None if unknown."""
        return self._container.arrival_ns

    def messages(self) -> Iterator[tuple[int, bytes]]:
        """(channel, data); messages of ROS 1 in CDR."""
        for number, data in self._container.messages():
            channel = self._container.channels.get(number)
            if number not in self._types and channel is not None:
                self._types[number] = self._enter(number, channel)
            types = self._types.get(number)
            yield number, data if types is None else types[0].to_cdr(data, types[1])

    def _enter(self, number: int, channel: Channel) -> tuple[Ros1Types, str] | None:
        """Enter a channel, and its schema under the channel's number; types and type name of messages to be converted."""
        schema = self._container.schemas.get(channel.schema_id)
        if schema is None or channel.encoding != ENCODING:
            self.channels[number] = replace(channel, schema_id=number)
            if schema is not None:
                self.schemas[number] = schema
            return None
        self.channels[number] = Channel(channel.topic, "cdr", number)
        self.schemas[number] = Schema(present_name(schema.name), "", b"")
        if not is_used(schema.name):
            return None
        if schema not in self._of_definition:
            text = schema.data.decode("utf-8", "replace")
            definitions = [(schema.name, text)] if len(self._of_definition) < MAX_DEFINITIONS else []
            self._of_definition[schema] = Ros1Types(definitions)
        types = self._of_definition[schema]
        self.schemas[number] = types.schema_of(schema.name)
        return types, schema.name
