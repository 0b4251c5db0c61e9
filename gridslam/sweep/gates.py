"""Bounds on the runs of a sweep (`ape.trans.rmse<=0.1`) and on their groups (`mean(ape.trans.rmse)<=0.05`)."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from gridslam.config.errors import nearest
from gridslam.core.errors import ConfigError
from gridslam.evaluation.gates import Gate, Value, failures, parse_gate
from gridslam.sweep.job_result import RunRow
from gridslam.sweep.summary import STATISTICS, Group

_OF_GROUP = re.compile(r"\s*([a-z_0-9]+)\(\s*([A-Za-z_][\w.-]*)\s*\)\s*(\S.*)")


@dataclass(frozen=True, slots=True)
class SweepGate:
    """A bound on each run, or with a `statistic` on each group of seeds; None: of all logs, configs, overrides."""

    gate: Gate
    statistic: str = ""
    log: str | None = None
    config: str | None = None
    override: str | None = None

    def concerns(self, log: str, config: str, override: str) -> bool:
        """Whether runs of this log, config and override are held to it."""
        wanted = zip((self.log, self.config, self.override), (log, config, override), strict=True)
        return all(want is None or want == have for want, have in wanted)


def parse_sweep_gate(
    text: str, log: str | None = None, config: str | None = None, override: str | None = None
) -> SweepGate:
    """`KEY<=NUMBER` of every run, `STATISTIC(KEY)<=NUMBER` of every group. Raises ConfigError."""
    match = _OF_GROUP.fullmatch(text)
    if match is None:
        return SweepGate(parse_gate(text), "", log, config, override)
    statistic, key, bound = match.groups()
    if statistic not in STATISTICS:
        raise ConfigError(f"--require {text!r}: no statistic {statistic!r}{nearest(statistic, STATISTICS)}")
    return SweepGate(parse_gate(key + bound), statistic, log, config, override)


def failed_gates(gates: Iterable[SweepGate], rows: Sequence[RunRow], groups: Sequence[Group]) -> list[str]:
    """One line for each bound that does not hold, and where. Runs that failed are not asked: they have no measures.

    A measure that a run or a group lacks meets no bound.
    """
    return [line for gate in gates for line in _failures(gate, rows, groups)]


def _failures(gate: SweepGate, rows: Sequence[RunRow], groups: Sequence[Group]) -> list[str]:
    lines, concerned = [], False
    if gate.statistic:
        for group in groups:
            if gate.concerns(group.log, group.config, group.override):
                concerned = True
                measure = group.measures.get(gate.gate.key)
                value = None if measure is None else measure.statistic(gate.statistic)
                lines += _lines(gate, value, f"{group.log} {group.config} {group.override}")
    else:
        for row in rows:
            if row.is_done and gate.concerns(row.log, row.config, row.override):
                concerned = True
                lines += _lines(gate, row.measures.get(gate.gate.key), row.label)
    return lines if concerned else [f"gate failed: {gate.gate}: no run to hold to it"]


def _lines(gate: SweepGate, value: Value, where: str) -> list[str]:
    document: Mapping[str, Any] = {gate.gate.key: value}
    of = f"{gate.statistic} of " if gate.statistic else ""
    return [
        f"{where}: " + line.replace("gate failed: ", f"gate failed: {of}", 1)
        for line in failures([gate.gate], document)
    ]


def meets(bounds: Iterable[Gate], measures: Mapping[str, Value]) -> bool:
    """Whether a run's measures meet all bounds; a measure that it lacks meets none."""
    return all(not failures([bound], {bound.key: measures.get(bound.key)}) for bound in bounds)
