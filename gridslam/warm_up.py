"""Compiles all kernels by letting every method run over a short scripted log."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from gridslam.maps.occupancy import OccupancyGrid
from gridslam.methods import registry
from gridslam.methods.base import Method, RunResult
from gridslam.simulation.scripted import scripted_drawing, scripted_log

INPUTS: Mapping[str, Callable[[], object]] = MappingProxyType({"drawing": scripted_drawing})


def warm_up() -> None:
    """Run each mapper and then each localizer with its default settings; numba's cache holds their kernels afterwards.

    What a setting other than the default needs is compiled when it is first used.
    """
    occupancy: OccupancyGrid | None = None
    for entry in registry.METHODS.values():
        if entry.mapper:
            inputs = {name: INPUTS[name]() for name in entry.needs_inputs}
            made = _result(registry.load(entry.mapper)(registry.load(entry.config)(), 0, **inputs)).occupancy
            occupancy = made if occupancy is None else occupancy
    for entry in registry.METHODS.values():
        if entry.localizer and occupancy is not None:
            _result(registry.load(entry.localizer)(registry.load(entry.config)(), 0, occupancy))


def _result(method: Method) -> RunResult:
    """Two laps, so that loops are closed as well."""
    for event, _ in scripted_log(laps=2):
        method.process(event)
    return method.result()
