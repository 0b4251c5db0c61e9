from __future__ import annotations

import io
import struct
import zlib
from pathlib import Path
from typing import Any

import pytest
from mcap.writer import CompressionType, IndexType, Writer

from gridslam.core.errors import LogError
from gridslam.logs import LogConfig, open_log
from gridslam.logs.mcap.chunks import unpack
from gridslam.logs.mcap.file import McapFile
from gridslam.logs.mcap.records import CHUNK, MAGIC
from gridslam.logs.message_counts import MessageCounts
from tests.logs.mutations import SCANS, read, sample_mcap, whole_chunk_messages


def mcap(path: Path, messages: int = 30, **options: Any) -> Path:
    """Messages of 100 bytes without a known type."""
    buffer = io.BytesIO()
    writer = Writer(buffer, **options)
    writer.start()
    channel = writer.register_channel("/t", "cdr", writer.register_schema("a/msg/B", "ros2msg", b"int32 x"))
    for i in range(messages):
        writer.add_message(channel, i, bytes([i]) * 100, i)
    writer.finish()
    path.write_bytes(buffer.getvalue())
    return path


def open_mcap(path: Path, limit: int = 1 << 20) -> tuple[McapFile, MessageCounts]:
    message_counts = MessageCounts()
    return McapFile(path, message_counts, limit), message_counts


@pytest.mark.parametrize("compression", CompressionType)
@pytest.mark.parametrize("chunked", [True, False])
@pytest.mark.parametrize("index", [IndexType.ALL, IndexType.NONE])
def test_all_messages_are_read_whatever_the_layout(
    tmp_path: Path, compression: CompressionType, chunked: bool, index: IndexType
) -> None:
    path = mcap(
        tmp_path / "a.mcap", compression=compression, use_chunking=chunked, index_types=index, chunk_size=700
    )
    file, message_counts = open_mcap(path)
    expected = [bytes([i]) * 100 for i in range(30)]
    assert [data for _, data in file.messages()] == expected
    assert [data for _, data in file.messages()] == expected
    assert not message_counts.is_lossy


@pytest.mark.parametrize(
    "options", [{"repeat_channels": False}, {"use_statistics": False, "enable_crcs": False}]
)
def test_a_poor_summary_does_no_harm(tmp_path: Path, options: dict[str, bool]) -> None:
    file, message_counts = open_mcap(mcap(tmp_path / "a.mcap", **options))
    assert len(list(file.messages())) == 30
    assert not message_counts.is_lossy


def test_an_unchunked_file_cut_anywhere_gives_its_whole_messages(tmp_path: Path) -> None:
    whole = mcap(tmp_path / "a.mcap", use_chunking=False).read_bytes()
    record = 9 + 22 + 100
    first = whole.index(struct.pack("<BQ", 5, 122))
    for cut in range(first, first + 5 * record, 17):
        path = tmp_path / "cut.mcap"
        path.write_bytes(whole[:cut])
        file, message_counts = open_mcap(path)
        assert len(list(file.messages())) == (cut - first) // record
        assert message_counts.is_lossy


def test_an_unindexed_chunked_file_resumes_after_a_damaged_chunk_header(tmp_path: Path) -> None:
    whole = bytearray(mcap(tmp_path / "a.mcap", chunk_size=700, index_types=IndexType.NONE).read_bytes())
    chunks = [i for i in range(len(whole)) if whole[i] == CHUNK and _is_chunk(whole, i)]
    assert len(chunks) > 3
    struct.pack_into("<Q", whole, chunks[1] + 1, 1 << 60)
    path = tmp_path / "damaged.mcap"
    path.write_bytes(whole)
    file, message_counts = open_mcap(path)
    messages = [data[0] for _, data in file.messages()]
    lost = sorted(set(range(30)) - set(messages))
    assert 0 < len(lost) < 10
    assert lost == list(range(lost[0], lost[-1] + 1))
    assert message_counts.counters == {"lost.damaged_part": 1}


def _is_chunk(data: bytes, at: int) -> bool:
    if at + 49 > len(data):
        return False
    length, name = struct.unpack_from("<Q", data, at + 1)[0], struct.unpack_from("<I", data, at + 37)[0]
    if name > 10 or at + 49 + name > len(data):
        return False
    return bool(struct.unpack_from("<Q", data, at + 41 + name)[0] + 40 + name == length)


def test_a_chunk_with_a_wrong_checksum_is_lost_and_no_other(tmp_path: Path) -> None:
    whole = bytearray(
        mcap(tmp_path / "a.mcap", chunk_size=700, compression=CompressionType.NONE).read_bytes()
    )
    whole[whole.index(bytes([12]) * 100) + 50] ^= 1
    path = tmp_path / "damaged.mcap"
    path.write_bytes(whole)
    file, message_counts = open_mcap(path)
    messages = [data[0] for _, data in file.messages()]
    assert 12 not in messages
    assert len(messages) >= 22
    assert message_counts.counters == {"lost.chunk_with_wrong_checksum": 1}


@pytest.mark.parametrize("compression", ["zstd", "lz4"])
def test_a_chunk_never_unpacks_to_more_than_it_says(compression: str) -> None:
    import lz4.frame
    import zstandard

    plain = bytes(10_000_000)
    packed = zstandard.compress(plain) if compression == "zstd" else lz4.frame.compress(plain)
    assert unpack(compression, packed, 1000) is None
    assert unpack(compression, packed, len(plain)) == plain
    assert unpack(compression, packed[:-20], len(plain)) is None
    assert unpack("xz", packed, len(plain)) is None


def test_a_chunk_that_claims_a_huge_size_is_lost_without_being_unpacked(tmp_path: Path) -> None:
    path = mcap(tmp_path / "a.mcap", 3)
    whole = bytearray(path.read_bytes())
    at = next(i for i in range(len(whole)) if whole[i] == CHUNK and _is_chunk(whole, i))
    struct.pack_into("<Q", whole, at + 9 + 16, 1 << 50)
    path.write_bytes(whole)
    file, message_counts = open_mcap(path)
    assert list(file.messages()) == []
    assert message_counts.counters == {"lost.chunk_of_impossible_size": 1}


def test_a_chunk_above_the_limit_is_lost(tmp_path: Path) -> None:
    path = sample_mcap(tmp_path / "a.mcap", chunk_bytes=1 << 22)
    config = LogConfig.model_validate({"limits": {"chunk_mb": 1}})
    with open_log(path, config) as log:
        assert len(list(log.events())) > SCANS  # 200 kB are below it
    file, message_counts = open_mcap(path, 1000)
    assert list(file.messages()) == []
    assert message_counts.is_lossy


def test_a_right_checksum_of_the_summary_is_needed_to_believe_it(tmp_path: Path) -> None:
    whole = bytearray(mcap(tmp_path / "a.mcap").read_bytes())
    footer = len(whole) - 8 - 29
    start, _, crc = struct.unpack_from("<QQI", whole, footer + 9)
    assert zlib.crc32(whole[start : footer + 9 + 16]) == crc
    whole[start + 30] ^= 1
    path = tmp_path / "damaged.mcap"
    path.write_bytes(whole)
    file, message_counts = open_mcap(path)
    assert len(list(file.messages())) == 30
    assert not message_counts.is_lossy


def test_an_index_that_leads_beyond_the_file_is_not_followed(tmp_path: Path) -> None:
    whole = bytearray(mcap(tmp_path / "a.mcap", chunk_size=700).read_bytes())
    chunks = [i for i in range(len(whole)) if whole[i] == CHUNK and _is_chunk(whole, i)]
    places = [i for chunk in chunks if (i := whole.rfind(struct.pack("<Q", chunk))) > chunks[-1]]
    assert len(places) == len(chunks) > 3
    for place in places[2:]:
        struct.pack_into("<Q", whole, place, 2**64 - 1)
    struct.pack_into("<I", whole, len(whole) - 12, 0)  # no checksum of the summary
    struct.pack_into("<Q", whole, chunks[2] + 1, 1 << 60)
    path = tmp_path / "damaged.mcap"
    path.write_bytes(whole)
    file, message_counts = open_mcap(path)
    assert len(list(file.messages())) > 20
    assert message_counts.counters["lost.damaged_part"] == 1


def test_other_bytes_are_no_mcap(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(b"something else")
    with pytest.raises(LogError, match="first bytes"):
        open_mcap(path)


@pytest.mark.parametrize("size", [8, 9, 20, 60])
def test_a_file_of_a_few_bytes_is_an_empty_log(tmp_path: Path, size: int) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(sample_mcap(tmp_path / "whole.mcap").read_bytes()[:size])
    reading = read(path)
    assert reading.error is None
    assert not reading.events
    assert reading.is_lossy


def test_the_library_counts_the_same_messages(tmp_path: Path) -> None:
    whole = sample_mcap(tmp_path / "a.mcap").read_bytes()
    assert whole.startswith(MAGIC)
    assert whole_chunk_messages(whole, len(whole)) == 2 * SCANS + 1
