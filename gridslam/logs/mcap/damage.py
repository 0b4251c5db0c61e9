"""The damage of an MCAP file, counted once."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from gridslam.logs.message_counts import MessageCounts


@dataclass(slots=True)
class Damage:
    """Counts what is lost by damage of a file, with its place, during the first pass over it."""

    path: Path
    message_counts: MessageCounts
    is_first_pass: bool = True

    def lose(self, what: str, at: int, why: str = "") -> None:
        """Count damage (`lost.<what>`) at byte `at` of the file."""
        if self.is_first_pass:
            self.message_counts.lose(what, f"{self.path.name} byte {at}{why}")

    def note(self, line: str) -> None:
        """Keep a line for the user about the file."""
        if self.is_first_pass:
            self.message_counts.note(f"{self.path.name}: {line}")
