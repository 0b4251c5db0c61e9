from __future__ import annotations

import io
import threading

import pytest

from gridslam.logs.read_ahead import BLOCK_BYTES, ReadAhead


class Breaking(io.BytesIO):
    """Raises when its bytes are read."""

    def read1(self, size: int | None = -1, /) -> bytes:
        part = super().read1(size)
        if not part:
            raise EOFError("cut")
        return part


@pytest.mark.parametrize("size", [0, 10, BLOCK_BYTES, 2 * BLOCK_BYTES, 3 * BLOCK_BYTES + 7])
def test_all_bytes_arrive_in_order(size: int) -> None:
    data = bytes(range(256)) * (size // 256 + 1)
    with io.BufferedReader(ReadAhead(io.BytesIO(data[:size]))) as stream:
        assert stream.read() == data[:size]


def test_an_error_comes_behind_the_bytes_before_it() -> None:
    with io.BufferedReader(ReadAhead(Breaking(b"first\nsecond\n"))) as stream:
        assert [stream.readline(), stream.readline()] == [b"first\n", b"second\n"]
        with pytest.raises(EOFError, match="cut"):
            stream.readline()


def test_the_thread_ends_when_the_reader_closes_early() -> None:
    stream = ReadAhead(io.BytesIO(bytes(20 * BLOCK_BYTES)))
    assert len(stream.read(10)) == 10
    stream.close()
    assert "read-ahead" not in [thread.name for thread in threading.enumerate()]
