"""Gates on single runs of a sweep (`ape.trans.rmse<=0.1`) and on groups of seeds (`mean(ape.trans.rmse)<=0.05`)."""

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
    """A bound on each run, or with a `statistic` on each group of seeds.

    It holds for the runs of this `log`, `config` and `override`; for any of them where it is None.
    """

    gate: Gate
    statistic: str = ""
    log: str | None = None
    config: str | None = None
    override: str | None = None

    def applies_to(self, log: str, config: str, override: str) -> bool:
        """Whether the gate applies to runs of this log, config and override."""
        pairs = zip((self.log, self.config, self.override), (log, config, override), strict=True)
        return all(chosen is None or chosen == actual for chosen, actual in pairs)


def parse_sweep_gate(
    text: str, log: str | None = None, config: str | None = None, override: str | None = None
) -> SweepGate:
    """The gate of a text: `KEY<=NUMBER` for every run, or `STATISTIC(KEY)<=NUMBER` for every group.

    Raises ConfigError if the text is neither, or the statistic is unknown.
    """
    match = _OF_GROUP.fullmatch(text)
    if match is None:
        return SweepGate(parse_gate(text), "", log, config, override)
    statistic, key, bound = match.groups()
    if statistic not in STATISTICS:
        raise ConfigError(f"--require {text!r}: no statistic {statistic!r}{nearest(statistic, STATISTICS)}")
    return SweepGate(parse_gate(key + bound), statistic, log, config, override)


def failed_gates(gates: Iterable[SweepGate], rows: Sequence[RunRow], groups: Sequence[Group]) -> list[str]:
    """A line for each run or group that fails a gate, and for each gate that applies to no run.

    Failed runs are skipped, since they have no measures. In other runs a missing measure fails the gate.
    """
    return [line for gate in gates for line in _failures(gate, rows, groups)]


def _failures(gate: SweepGate, rows: Sequence[RunRow], groups: Sequence[Group]) -> list[str]:
    lines, applied = [], False
    if gate.statistic:
        for group in groups:
            if gate.applies_to(group.log, group.config, group.override):
                applied = True
                measure = group.measures.get(gate.gate.key)
                value = None if measure is None else measure.statistic(gate.statistic)
                lines += _lines(gate, value, f"{group.log} {group.config} {group.override}")
    else:
        for row in rows:
            if row.is_done and gate.applies_to(row.log, row.config, row.override):
                applied = True
                lines += _lines(gate, row.measures.get(gate.gate.key), row.label)
    return lines if applied else [f"gate failed: {gate.gate}: it applies to no run"]


def _lines(gate: SweepGate, value: Value, where: str) -> list[str]:
    document: Mapping[str, Any] = {gate.gate.key: value}
    of = f"{gate.statistic} of " if gate.statistic else ""
    return [
        f"{where}: " + line.replace("gate failed: ", f"gate failed: {of}", 1)
        for line in failures([gate.gate], document)
    ]


def meets(bounds: Iterable[Gate], measures: Mapping[str, Value]) -> bool:
    """Whether the measures of a run meet all bounds; a missing measure meets none."""
    return all(not failures([bound], {bound.key: measures.get(bound.key)}) for bound in bounds)
