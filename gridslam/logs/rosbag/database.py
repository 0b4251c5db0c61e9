"""A rosbag2 database: a .db3 file of SQLite, which is not trusted."""

from __future__ import annotations

import shutil
import sqlite3
import tempfile
import weakref
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

from gridslam.core.errors import LogError
from gridslam.core.files import real_path
from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.ros.container import Channel, Schema
from gridslam.logs.ros.types import MAX_SCHEMA_BYTES, full_name

_TICK_INSTRUCTIONS = 100_000  # number of instructions of SQLite's machine between two checks for signals
_MAX_TOPICS = 100_000
_MAX_NAME = 10_000  # largest number of bytes of a topic, a type and an encoding together
_MIN_MESSAGE_LIMIT = 10_000  # messages that any file may hold; a larger file one per byte
_LOG_MAGIC = (b"\x37\x7f\x06\x82", b"\x37\x7f\x06\x83")
_LOG_HEAD_BYTES, _FRAME_HEAD_BYTES = 32, 24
_DAMAGE = (sqlite3.Error, UnicodeDecodeError, OverflowError)


class DatabaseFile:
    """The messages of a .db3 file, in the order in which they were written.

    Messages that a killed recorder left in the write-ahead log `FILE-wal` are read as well, from a copy of both files.
    Views, virtual tables and computed columns are refused: they can hold more than any disk.
    """

    def __init__(self, path: Path, message_counts: MessageCounts, limit_bytes: int) -> None:
        self.path = path
        self.channels: dict[int, Channel] = {}
        self.schemas: dict[int, Schema] = {}
        self.files = [path]
        self.arrival_ns: int | None = None
        self._message_counts = message_counts
        self._limit = limit_bytes
        self._is_indexed = False
        self._copy: Path | None = None
        self._message_limit = path.stat().st_size
        self._use_write_ahead_log(Path(f"{path}-wal"))
        try:
            with closing(self._connect()) as database:
                self._check_write_ahead_log(database)
                _refuse_computed_tables(database, path)
                self._read_topics(database)
        except _DAMAGE as error:
            raise _interrupt_or(
                LogError(
                    f"{path}: not a readable rosbag2 database ({error}); "
                    f"`sqlite3 {path.name} .recover | sqlite3 saved.db3` may save what is left"
                ),
                error,
            ) from error

    def messages(self) -> Iterator[tuple[int, bytes]]:
        """(topic id, data) of every readable message."""
        number = 0
        query = (
            "SELECT topic_id, timestamp, CASE WHEN typeof(data) = 'blob' AND length(data) <= ? THEN data END FROM messages "
            "ORDER BY rowid"
        )
        try:
            with closing(self._connect()) as database:
                for channel, arrival, data in database.execute(query, (self._limit,)):
                    number += 1
                    if number > max(self._message_limit, _MIN_MESSAGE_LIMIT):
                        self._lose("messages_beyond_one_per_byte", number)
                        break
                    if data is not None and isinstance(channel, int):
                        self.arrival_ns = arrival if isinstance(arrival, int) else None
                        yield channel, data
                    else:
                        self._lose("unreadable_row", number)
        except _DAMAGE as error:
            self._lose("rest_of_database", number, f" ({error})")
            _interrupt_or(error, error)
        self._is_indexed = True

    @property
    def span_ns(self) -> tuple[int, int] | None:
        """The smallest and the largest time of arrival (ns); None for an empty or damaged database."""
        try:
            with closing(self._connect()) as database:
                ((first, last),) = database.execute("SELECT min(timestamp), max(timestamp) FROM messages")
        except _DAMAGE as error:
            _interrupt_or(error, error)
            return None
        return (first, last) if isinstance(first, int) and isinstance(last, int) else None

    def _lose(self, what: str, number: int, why: str = "") -> None:
        if not self._is_indexed:
            self._message_counts.lose(what, f"{self.path.name} message {number}{why}")

    def _use_write_ahead_log(self, log: Path) -> None:
        """Copy the database and its write-ahead log, if it has one: reading them in place would write beside them."""
        try:
            if not log.is_file() or log.stat().st_size == 0:
                return
            size = self.path.stat().st_size + log.stat().st_size
            folder = Path(tempfile.mkdtemp(prefix="gridslam-"))
            weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
            if shutil.disk_usage(folder).free < 2 * size:
                raise OSError(f"{folder} has no room for a copy")
            self._copy = folder / "recording.db3"
            shutil.copyfile(self.path, self._copy)
            shutil.copyfile(log, f"{self._copy}-wal")
        except OSError as error:
            raise LogError(
                f"{self.path}: the recorder left messages in {log.name}, which cannot be read ({error}); write them into "
                f"the database with `sqlite3 {self.path.name} 'PRAGMA wal_checkpoint'`"
            ) from error
        self._message_limit = size
        self.files.append(log)
        self._message_counts.note(f"{self.path.name}: read together with {log.name}, which its recorder left")

    def _check_write_ahead_log(self, database: sqlite3.Connection) -> None:
        """Count a loss where SQLite leaves out a part of the write-ahead log: cut, damaged, or never committed."""
        if self._copy is None:
            return
        recorded = _frames_of(self.files[-1])
        ((_, used, _),) = database.execute("PRAGMA wal_checkpoint")
        if used < recorded:
            where = f"{self.files[-1].name} page {max(used, 0) + 1} of {recorded}"
            self._message_counts.lose("rest_of_write_ahead_log", where)

    def _connect(self) -> sqlite3.Connection:
        path, options = (self.path, "mode=ro&immutable=1") if self._copy is None else (self._copy, "mode=rw")
        database = sqlite3.connect(f"{real_path(path).as_uri()}?{options}", uri=True)
        database.text_factory = lambda text: text.decode("utf-8", "replace")
        database.set_progress_handler(lambda: 0, _TICK_INSTRUCTIONS)
        return database

    def _read_topics(self, database: sqlite3.Connection) -> None:
        definitions = self._definitions(database)
        query = (
            "SELECT id, name, type, serialization_format FROM topics WHERE typeof(id) = 'integer' "
            f"AND length(name) + length(type) + length(serialization_format) < {_MAX_NAME} ORDER BY id LIMIT {_MAX_TOPICS}"
        )
        for number, name, kind, encoding in database.execute(query):
            self.channels[number] = Channel(str(name), str(encoding), number)
            text_encoding, text = definitions.get(str(kind), ("", ""))
            self.schemas[number] = Schema(full_name(str(kind)), text_encoding, text.encode())

    @staticmethod
    def _definitions(database: sqlite3.Connection) -> dict[str, tuple[str, str]]:
        """Definitions by type: newer recorders store them, older ones do not."""
        if "message_definitions" not in _tables(database):
            return {}
        rows = database.execute(
            "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions "
            f"WHERE length(encoded_message_definition) <= {MAX_SCHEMA_BYTES} LIMIT {_MAX_TOPICS}"
        )
        return {str(kind): (str(encoding), str(text)) for kind, encoding, text in rows}


def _frames_of(log: Path) -> int:
    """Number of pages in a write-ahead log since it was last restarted, including a cut one; at least 1, for a damaged log.

    Format: https://www.sqlite.org/fileformat2.html, section 4.1.
    """
    with log.open("rb") as stream:
        head = stream.read(_LOG_HEAD_BYTES)
        if head[:4] not in _LOG_MAGIC or len(head) < _LOG_HEAD_BYTES:
            return 1
        page_bytes, salts, count = int.from_bytes(head[8:12], "big"), head[16:24], 0
        while stream.read(_FRAME_HEAD_BYTES)[8:16] == salts:
            count += 1
            stream.seek(page_bytes, 1)
    return max(count, 1)


def _tables(database: sqlite3.Connection) -> dict[str, str]:
    """The tables of a database with the statement that made each; no views."""
    return dict(
        database.execute("SELECT name, sql FROM sqlite_master WHERE type = 'table' AND length(sql) < 100000")
    )


def _refuse_computed_tables(database: sqlite3.Connection, path: Path) -> None:
    """Raises LogError unless topics and messages are real tables of stored columns."""
    tables = _tables(database)
    for name in ("topics", "messages", "message_definitions"):
        if name not in tables:
            entry = database.execute("SELECT type FROM sqlite_master WHERE name = ?", (name,)).fetchone()
            if name == "message_definitions" and entry is None:
                continue
            what = f"is a {entry[0]}" if entry else "is missing"
            raise LogError(f"{path}: not a readable rosbag2 database (the table {name!r} {what})")
        columns: list[tuple[Any, ...]] = database.execute(f"PRAGMA table_xinfo({name})").fetchall()
        is_computed = any(column[6] in (2, 3) for column in columns)
        if is_computed or tables[name].lstrip().upper().startswith("CREATE VIRTUAL"):
            raise LogError(f"{path}: not a readable rosbag2 database (the table {name!r} is computed)")


def _interrupt_or(otherwise: Exception, error: Exception) -> Exception:
    """The error `otherwise`; raises KeyboardInterrupt instead if a signal has stopped SQLite."""
    if isinstance(error, sqlite3.OperationalError) and str(error) == "interrupted":
        raise KeyboardInterrupt from None
    return otherwise
