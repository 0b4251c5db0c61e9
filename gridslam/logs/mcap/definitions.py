"""Channels and schemas of an MCAP file, also where an id is defined more than once."""

from __future__ import annotations

from typing import Generic, TypeVar

from gridslam.logs.ros.container import Channel, Schema

_FIRST_NEW_NUMBER = 1 << 16  # ids of a file have 16 bits
Definition = TypeVar("Definition", Channel, Schema)


class Definitions(Generic[Definition]):
    """Channels or schemas of a file. One that is defined again with another content gets a number of its own."""

    def __init__(self) -> None:
        self.by_number: dict[int, Definition] = {}
        self.present: dict[int, int] = {}  # number of each id whose present definition is not its first
        self._redefined: dict[tuple[int, Definition], int] = {}

    def enter(self, identifier: int, definition: Definition) -> bool:
        """Make this the present definition of an id; whether it contradicts all earlier ones of the id."""
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
