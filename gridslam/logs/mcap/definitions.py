"""Channels and schemas of an MCAP file, whose ids may be defined more than once."""

from __future__ import annotations

from typing import Generic, TypeVar

from gridslam.logs.mcap.records import block, text
from gridslam.logs.ros.container import Channel, Schema

_FIRST_NEW_NUMBER = 1 << 16  # ids of a file have 16 bits
Definition = TypeVar("Definition", Channel, Schema)


class Definitions(Generic[Definition]):
    """Channels or schemas of a file, by number.

    The number of a definition is its id in the file. If the id is defined again with another content, the new definition gets a
    new number, so that the messages before and after it belong to different streams.
    """

    def __init__(self) -> None:
        self.by_number: dict[int, Definition] = {}
        self.present: dict[int, int] = {}  # number of each id whose present definition is not its first
        self._redefined: dict[tuple[int, Definition], int] = {}

    def enter(self, identifier: int, definition: Definition) -> bool:
        """Make this the present definition of an id. Returns whether it differs from all earlier definitions of the id."""
        if self.by_number.setdefault(identifier, definition) == definition:
            self.present.pop(identifier, None)
            return False
        key = (identifier, definition)
        is_new = key not in self._redefined
        number = self._redefined.setdefault(key, _FIRST_NEW_NUMBER + len(self._redefined))
        self.by_number[number] = definition
        self.present[identifier] = number
        return is_new

    def number_of(self, identifier: int) -> int:
        """The number of an id's present definition."""
        return self.present.get(identifier, identifier)


def schema_in(body: bytes) -> tuple[int, Schema]:
    """Id and content of a schema record. Raises ValueError: it is damaged."""
    name, after = text(body, 2)
    encoding, after = text(body, after)
    data, _ = block(body, after)
    return int.from_bytes(body[:2], "little"), Schema(name, encoding, data)


def channel_in(body: bytes, schemas: Definitions[Schema]) -> tuple[int, Channel]:
    """Id and content of a channel record; its schema is the present one of the id. Raises ValueError: it is damaged."""
    topic, after = text(body, 4)
    encoding, _ = text(body, after)
    schema = schemas.number_of(int.from_bytes(body[2:4], "little"))
    return int.from_bytes(body[:2], "little"), Channel(topic, encoding, schema)
