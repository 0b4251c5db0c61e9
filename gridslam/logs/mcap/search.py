"""Finds where the records of a damaged MCAP file go on."""

from __future__ import annotations

from typing import IO

from gridslam.logs.mcap.chunks import is_chunk_body
from gridslam.logs.mcap.records import CHUNK, DATA_END, FOOTER, KNOWN_OPCODES, RECORD

_FIRST_BLOCK, _MAX_BLOCK = 1 << 12, 1 << 20
_RECORDS_IN_A_ROW = 3  # this many places in a row that look like records are not there by chance


def next_record(stream: IO[bytes], start: int, size: int, opcodes: tuple[int, ...]) -> int | None:
    """The first offset from `start` on at which a chunk whose lengths agree, or several records in a row, can be.

    The record there has one of the opcodes; the file has `size` bytes. None: there is no such place.
    """
    block_start, block_size = start, _FIRST_BLOCK
    while block_start < size:
        stream.seek(block_start)
        block = stream.read(block_size)
        for opcode in opcodes:
            found = block.find(opcode)
            while found >= 0:
                if _are_records_at(stream, block_start + found, size):
                    return block_start + found
                found = block.find(opcode, found + 1)
        block_start += block_size
        block_size = min(block_size * 4, _MAX_BLOCK)
    return None


def _are_records_at(stream: IO[bytes], at: int, size: int) -> bool:
    for _ in range(_RECORDS_IN_A_ROW):
        stream.seek(at)
        head = stream.read(RECORD.size)
        if len(head) < RECORD.size:
            return False
        opcode, length = head[0], int.from_bytes(head[1:], "little")
        at += RECORD.size + length
        if opcode not in KNOWN_OPCODES or at > size or length == 0:
            return False
        if opcode == CHUNK:
            return is_chunk_body(stream, length)
        if opcode in (DATA_END, FOOTER):
            return length <= 20
    return True
