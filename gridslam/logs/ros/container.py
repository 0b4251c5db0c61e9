"""Interface of a file of ROS messages: channels, schemas and raw messages."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Protocol


@dataclass(frozen=True, slots=True)
class Schema:
    """The definition of a message type. `encoding`: ros2msg, ros2idl, jsonschema, ..."""

    name: str
    encoding: str
    data: bytes


@dataclass(frozen=True, slots=True)
class Channel:
    """A topic. `encoding` of its messages: cdr, json, ..."""

    topic: str
    encoding: str
    schema_id: int


class Container(Protocol):
    """A file of ROS messages: channels, their schemas, and raw messages in recorded order, read again on each pass."""

    @property
    def channels(self) -> Mapping[int, Channel]:
        """Channels by id; complete after one pass of `messages`."""

    @property
    def schemas(self) -> Mapping[int, Schema]:
        """Schemas by id; complete after one pass of `messages`."""

    @property
    def arrival_ns(self) -> int | None:
        """Time of arrival (ns) of the last message that `messages` has yielded; None if it was not recorded."""

    def messages(self) -> Iterator[tuple[int, bytes]]:
        """(channel id, data)."""
