"""Unpacks a packed file in another thread, while the main thread parses its lines."""

from __future__ import annotations

import io
import queue
import threading

BLOCK_BYTES = 1 << 20
BLOCKS_AHEAD = 4


class ReadAhead(io.RawIOBase):
    """Reads `source` block by block in a thread, until `close`. Decompression does not hold the interpreter's lock.

    An error of the source is raised after all bytes before it have been read.
    """

    def __init__(self, source: io.BufferedIOBase) -> None:
        super().__init__()
        self._source = source
        self._blocks: queue.Queue[bytes | BaseException] = queue.Queue(BLOCKS_AHEAD)
        self._left = memoryview(b"")
        self._is_done = False
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._fill, name="read-ahead", daemon=True)
        self._thread.start()

    def readable(self) -> bool:
        """True."""
        return True

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]
        """Copy the next bytes into the buffer; returns their number, 0 at the end."""
        if not self._left and not self._is_done:
            block = self._blocks.get()
            if isinstance(block, BaseException):
                self._is_done = True
                raise block
            self._is_done = not block
            self._left = memoryview(block)
        count = min(len(self._left), len(buffer))
        buffer[:count] = self._left[:count]
        self._left = self._left[count:]
        return count

    def close(self) -> None:
        """End the thread and close the source."""
        if not self.closed:
            self._stop.set()
            while self._thread.is_alive():
                self._drain()
                self._thread.join(0.01)
            self._source.close()
        super().close()

    def _fill(self) -> None:
        while not self._stop.is_set():
            parts: list[bytes] = []
            size = 0
            try:
                while size < BLOCK_BYTES and (part := self._source.read1(BLOCK_BYTES)):
                    parts.append(part)
                    size += len(part)
            except Exception as error:  # any: it is raised in the reader, behind the bytes before it
                if parts:
                    self._blocks.put(b"".join(parts))
                self._blocks.put(error)
                return
            self._blocks.put(b"".join(parts))
            if size < BLOCK_BYTES:
                if size:
                    self._blocks.put(b"")
                return

    def _drain(self) -> None:
        try:
            while True:
                self._blocks.get_nowait()
        except queue.Empty:
            pass
