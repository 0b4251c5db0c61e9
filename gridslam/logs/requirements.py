"""Whether a log has what a method needs."""

from __future__ import annotations

from collections.abc import Collection

from gridslam.core.errors import LogError
from gridslam.logs.log import Log


def require_streams(log: Log, needs: Collection[str]) -> None:
    """Raise a LogError unless the log has a used stream of every kind in `needs`; the message lists its streams.

    A need may name several kinds of which one will do: "scan|depth".
    """
    have = {info.kind for info in log.streams if info.used and info.count}
    for need in needs:
        kinds = need.split("|")
        if have.isdisjoint(kinds):
            found = ", ".join(f"{i.label} ({i.type}, {i.count})" for i in log.streams if i.count) or "nothing"
            damage = f"It is damaged: {'; '.join(log.problems)}. " if log.is_lossy else ""
            raise LogError(
                f"{log.path}: no {' or '.join(kinds)} stream, which the method needs. The log has: {found}. {damage}"
                f"If one of these is it, say so in the config: log: {{topics: {{{kinds[0]}: TOPIC}}}}"
            )
