"""Decodes protobuf messages by the descriptors that a log has as the schema of their channel.

Wire format: https://protobuf.dev/programming-guides/encoding; descriptors: google/protobuf/descriptor.proto. A message becomes an
object with the same fields as Foxglove's JSON: bytes in base64, times and durations with `sec` and `nsec`.
"""

from __future__ import annotations

import base64
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

from numpy import frombuffer

_VARINT, _FIXED64, _BYTES, _FIXED32 = 0, 1, 2, 5  # wire types
_DOUBLE, _FLOAT, _BOOL, _STRING, _MESSAGE, _BYTES_TYPE = 1, 2, 8, 9, 11, 12  # types of fields
_ZIGZAG, _SIGNED = (17, 18), (3, 5, 14)
_FIXED = {1: "<f8", 2: "<f4", 6: "<u8", 7: "<u4", 15: "<i4", 16: "<i8"}
_REPEATED = 3
_MAX_DEPTH = 30
_MAX_MESSAGES = 1000  # largest number of messages of one schema
_MAX_SCHEMA_BYTES = 1 << 20  # a schema with all that it imports has some 100 kB
_MAX_NAME = 1000  # longest full name of a message: those within others have the others' in theirs
# Largest number of values of one message, those that have their default too; numbers of fixed size that are packed count as one
_MAX_VALUES = 1_000_000
_WELL_KNOWN = ("google.protobuf.Timestamp", "google.protobuf.Duration")


@dataclass(slots=True)
class _Field:
    name: str
    kind: int
    is_repeated: bool
    message: str  # its type, of a field that holds messages


@dataclass(slots=True)
class _Message:
    name: str
    fields: dict[int, _Field] = field(default_factory=dict)


def decoder_of(schema: bytes, name: str) -> Callable[[bytes], Any]:
    """The decoder of a message type, given the bytes of a FileDescriptorSet.

    Raises ValueError: the schema does not define the type.
    """
    if len(schema) > _MAX_SCHEMA_BYTES:
        raise ValueError(f"{name}: its definition is larger than any real one")
    types: dict[str, _Message] = {}
    for number, _, file in _fields(schema):
        if number == 1:
            _enter_file(bytes(file), types)
    if name not in types:
        raise ValueError(f"{name}: the log has no definition of this type")
    decoder = _Decoder(types)
    return lambda data: decoder.message(data, name)


def _enter_file(data: bytes, types: dict[str, _Message]) -> None:
    """Enter the message types of one FileDescriptorProto."""
    package, messages = "", []
    for number, _, value in _fields(data):
        if number == 2:
            package = value.decode()
        elif number == 4:
            messages.append(value)
    for message in messages:
        _enter_message(message, package, types, 0)


def _enter_message(data: bytes, scope: str, types: dict[str, _Message], depth: int) -> None:
    """Enter one DescriptorProto and the types within it."""
    if depth > _MAX_DEPTH or len(types) > _MAX_MESSAGES:
        raise ValueError("a definition larger than any real one")
    found, nested = _Message(""), []
    for number, _, value in _fields(data):
        if number == 1:
            found.name = f"{scope}.{value.decode()}" if scope else value.decode()
        elif number == 2:
            place, described = _field_of(value)
            found.fields[place] = described
        elif number == 3:
            nested.append(value)
    if len(found.name) > _MAX_NAME:
        raise ValueError("a name longer than any real one")
    types[found.name] = found
    for message in nested:
        _enter_message(message, found.name, types, depth + 1)


def _field_of(data: bytes) -> tuple[int, _Field]:
    """Number and description of a FieldDescriptorProto."""
    values = {number: value for number, _, value in _fields(data)}
    name = values[1].decode()
    message = values.get(6, b"").decode().lstrip(".")
    return values[3], _Field(name, values[5], values.get(4) == _REPEATED, message)


class _Decoder:
    """Decodes messages of the types of one schema."""

    def __init__(self, types: dict[str, _Message]) -> None:
        self._types = types
        self._left = 0  # number of values that the current message may still have

    def message(self, data: bytes, name: str) -> SimpleNamespace:
        """A message as an object. Raises ValueError and the like: it is damaged, or has too many values."""
        self._left = _MAX_VALUES
        return self._decode(data, self._types[name], 0)

    def _spend(self, values: int) -> None:
        self._left -= values
        if self._left < 0:
            raise ValueError(f"more than {_MAX_VALUES} values in a message")

    def _decode(self, data: bytes, of: _Message, depth: int) -> SimpleNamespace:
        """A field that is absent has its default."""
        if depth > _MAX_DEPTH:
            raise ValueError("messages nested deeper than any real one")
        self._spend(1 + len(of.fields))
        found: dict[str, Any] = {f.name: [] if f.is_repeated else _default(f) for f in of.fields.values()}
        for number, wire, value in _fields(data):
            self._spend(1)
            described = of.fields.get(number)
            if described is None:
                continue
            if described.kind == _MESSAGE:
                inner: Any = self._inner(value, described.message, depth)
            elif wire == _BYTES and described.kind not in (_STRING, _BYTES_TYPE):
                found[described.name].extend(self._packed(value, described.kind))
                continue
            else:
                inner = _scalar(value, described.kind)
            if described.is_repeated:
                found[described.name].append(inner)
            else:
                found[described.name] = inner
        return SimpleNamespace(**found)

    def _inner(self, data: bytes, name: str, depth: int) -> SimpleNamespace:
        if name in _WELL_KNOWN:
            values = {number: value for number, _, value in _fields(data)}
            return SimpleNamespace(sec=_scalar(values.get(1, 0), 3), nsec=_scalar(values.get(2, 0), 5))
        return self._decode(data, self._types[name], depth + 1)

    def _packed(self, data: bytes, kind: int) -> list[Any]:
        """The numbers of a packed repeated field."""
        if kind in _FIXED:
            return list(frombuffer(data, _FIXED[kind]).tolist())
        values, at = [], 0
        while at < len(data):
            value, at = _varint(data, at)
            self._spend(1)
            values.append(_scalar(value, kind))
        return values


def _default(described: _Field) -> Any:
    if described.kind == _MESSAGE:
        return None
    return "" if described.kind in (_STRING, _BYTES_TYPE) else _scalar(0, described.kind)


def _scalar(value: Any, kind: int) -> Any:
    """The value of a field by its type, given what the wire holds."""
    if kind == _STRING:
        return value.decode()
    if kind == _BYTES_TYPE:
        return base64.b64encode(value).decode()
    if kind in _FIXED and isinstance(value, bytes):
        (number,) = frombuffer(value, _FIXED[kind]).tolist()
        return number
    if kind in (_DOUBLE, _FLOAT):
        return float(value)
    if kind == _BOOL:
        return bool(value)
    if kind in _ZIGZAG:
        return (value >> 1) ^ -(value & 1)
    return value - (1 << 64) if kind in _SIGNED and value >> 63 else value


def _fields(data: bytes) -> Iterator[tuple[int, int, Any]]:
    """(field number, wire type, value) of a message: integers of varints, bytes of all others."""
    at = 0
    while at < len(data):
        key, at = _varint(data, at)
        number, wire = key >> 3, key & 7
        if wire == _VARINT:
            value, at = _varint(data, at)
            yield number, wire, value
            continue
        if wire == _BYTES:
            size, at = _varint(data, at)
        elif wire in (_FIXED64, _FIXED32):
            size = 8 if wire == _FIXED64 else 4
        else:
            raise ValueError("not a protobuf message")
        if at + size > len(data):
            raise ValueError("a field reaches beyond its message")
        yield number, wire, data[at : at + size]
        at += size


def _varint(data: bytes, at: int) -> tuple[int, int]:
    """An integer of up to ten bytes, and the offset behind it."""
    value = 0
    for shift in range(0, 70, 7):
        if at >= len(data):
            raise struct.error("an integer reaches beyond its message")
        byte = data[at]
        at += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value & 0xFFFFFFFFFFFFFFFF, at
    raise ValueError("an integer of more than ten bytes")
