"""The records of an MCAP file, inside and outside of chunks: messages, and the schemas and channels that they refer to."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from gridslam.logs.mcap.damage import Damage
from gridslam.logs.mcap.definitions import Definitions, channel_in, schema_in
from gridslam.logs.mcap.records import CHANNEL, MESSAGE, MESSAGE_HEAD_BYTES, MESSAGE_RECORD, RECORD, SCHEMA
from gridslam.logs.ros.container import Channel, Schema

# Largest number of records of other kinds in a chunk, which should have schemas, channels and messages only
_MAX_OTHER_RECORDS = 1000


@dataclass(slots=True)
class RecordReader:
    """Reads records in order, and keeps the schemas and channels defined so far."""

    damage: Damage
    channels: Definitions[Channel] = field(default_factory=lambda: Definitions())
    schemas: Definitions[Schema] = field(default_factory=lambda: Definitions())
    # The data with the last message, and where the body of its record begins
    _last: tuple[bytes, int] = b"", 0

    @property
    def arrival_ns(self) -> int | None:
        """The log time (ns) of the last message; None before the first."""
        data, start = self._last
        return int.from_bytes(data[start + 6 : start + 14], "little", signed=True) if data else None

    def restart(self) -> None:
        """Begin another pass over the file: ids have their first definitions again."""
        self.channels.present.clear()
        self.schemas.present.clear()

    def messages(self, data: bytes, at: int, is_cut: bool = False) -> Iterator[tuple[int, bytes]]:
        """(channel number, data) of the messages among the records in `data`, which are at byte `at` of the file.

        `is_cut`: the last record may be incomplete, which is not damage.
        """
        position, end, others = 0, len(data), 0
        numbers = self.channels.present
        unpack_from = MESSAGE_RECORD.unpack_from
        while position + MESSAGE_RECORD.size <= end:
            opcode, length, channel = unpack_from(data, position)
            start = position + RECORD.size
            position = start + length
            if position > end:
                if not is_cut:
                    self.damage.lose("rest_of_damaged_chunk", at)
                return
            if opcode == MESSAGE:
                if length < MESSAGE_HEAD_BYTES:
                    self.damage.lose("rest_of_damaged_chunk", at)
                    return
                self._last = data, start
                yield (
                    numbers.get(channel, channel) if numbers else channel,
                    data[start + MESSAGE_HEAD_BYTES : position],
                )
            elif opcode in (SCHEMA, CHANNEL):
                self.define(opcode, data[start:position], at)
            else:
                others += 1
                if opcode == 0 or others > _MAX_OTHER_RECORDS:
                    self.damage.lose("rest_of_damaged_chunk", at)
                    return

    def define(self, opcode: int, body: bytes, at: int) -> None:
        """Keep the definition in a record at byte `at` of the file, if it is a schema or a channel."""
        if opcode == SCHEMA:
            self._define_schema(body, at)
        elif opcode == CHANNEL:
            self._define_channel(body, at)

    def _define_schema(self, body: bytes, at: int) -> None:
        try:
            identifier, schema = schema_in(body)
        except ValueError:
            self.damage.lose("damaged_schema", at)
            return
        self.schemas.enter(identifier, schema)

    def _define_channel(self, body: bytes, at: int) -> None:
        try:
            identifier, channel = channel_in(body, self.schemas)
        except ValueError:
            self.damage.lose("damaged_channel", at)
            return
        if self.channels.enter(identifier, channel):
            self.damage.note(
                f"channel {identifier} is defined again as {channel.topic}: its messages from there on count as another stream"
            )
