"""The table of methods. Entries are text, loaded when asked for, so that `--help` imports no heavy library."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from gridslam.core.errors import ConfigError
from gridslam.methods.plugins import PluginRegistry


@dataclass(frozen=True, slots=True)
class InputKind:
    """A file that a run can take besides the log; the method's constructor gets its content as keyword argument `name`.

    `reader` is "module:function": the function takes the path and returns the content, or raises a GridslamError.
    `is_needed`: the run is refused without the file. `example` is "module:function": the function takes no argument and returns
    content with which the method's kernels are compiled in advance. `in_run` is the file's name in run directories; if it is set,
    a run directory may be given instead of the file.
    """

    name: str
    reader: str
    is_needed: bool = False
    example: str = ""
    in_run: str = ""


DRAWING = InputKind(
    "drawing",
    reader="gridslam.maps.drawings.drawing:load_drawing",
    is_needed=True,
    example="gridslam.simulation.driving.scripted:scripted_drawing",
)
SESSION = InputKind(
    "session",
    reader="gridslam.lidar_slam.sessions.session_file:load_session",
    in_run="session.npz",
)
TAGS = InputKind("tags", reader="gridslam.maps.tag_database:load_tag_database")
OPTIONS: Mapping[str, str] = MappingProxyType(
    {"map": "map", "drawing": "drawing", "tags": "tags", "session": "continue"}
)
"""Options of the commands for the inputs that have one of their own."""


@dataclass(frozen=True, slots=True)
class MethodEntry:
    """The parts of a method, and the streams and files that they read.

    `config`, `mapper`, `localizer` and `explorer` are "module:Name". An empty string means that the method cannot do that. The
    explorer drives the robot in `gridslam explore`; it is built from the mapper, its config, the drive and a seed.
    """

    config: str
    mapper: str = ""
    localizer: str = ""
    needs: tuple[str, ...] = ()  # kinds of streams that a log must have; "scan|depth": one of them
    uses: tuple[str, ...] = ()  # kinds of streams that are also read if a log has them
    inputs: tuple[InputKind, ...] = ()  # files that a run can take besides the log
    localizes_without_map: bool = False  # its poses come from an external source, so `localize` needs no map
    is_continued: bool = False  # its mapper takes a session and the log's name, and writes session.npz
    explorer: str = ""

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the files that a run can take besides the log."""
        return tuple(kind.name for kind in self.inputs)

    @property
    def reads(self) -> tuple[str, ...]:
        """All kinds of streams that the method reads, needed or not."""
        needed = [kind for need in self.needs for kind in need.split("|")]
        return tuple(dict.fromkeys([*needed, *self.uses]))


BUILT_IN: Mapping[str, MethodEntry] = MappingProxyType(
    {
        "slam-sd": MethodEntry(
            config="gridslam.methods.slam_sd.config:SlamSdConfig",
            mapper="gridslam.methods.slam_sd.method:SlamSd",
            needs=("scan",),
            uses=("odom", "imu", "tags"),
            inputs=(TAGS, SESSION),
            is_continued=True,
        ),
        "stereo-bayes": MethodEntry(
            config="gridslam.methods.stereo_bayes.config:StereoBayesConfig",
            mapper="gridslam.methods.stereo_bayes.method:StereoBayes",
            localizer="gridslam.methods.stereo_bayes.method:StereoBayesPose",
            needs=("stereo|disparity",),
            uses=("odom", "pose", "camera_info"),
            localizes_without_map=True,
        ),
        "ir-scan": MethodEntry(
            config="gridslam.methods.ir_scan.config:IrScanConfig",
            mapper="gridslam.methods.ir_scan.method:IrScanMapper",
            localizer="gridslam.methods.ir_scan.method:IrScanLocalizer",
            needs=("range",),
            uses=("odom", "wheels", "imu", "pose"),
        ),
        "ispace-mcl": MethodEntry(
            config="gridslam.methods.ispace_mcl.config:IspaceMclConfig",
            localizer="gridslam.methods.ispace_mcl.method:IspaceMcl",
            needs=("scan|depth", "odom"),
            uses=("image", "depth", "camera_info"),
        ),
        "handmap-slam": MethodEntry(
            config="gridslam.methods.handmap_slam.config:HandmapSlamConfig",
            mapper="gridslam.methods.handmap_slam.method:HandmapSlam",
            explorer="gridslam.methods.handmap_slam.driving.mapping_explorer:MappingExplorer",
            needs=("scan",),
            uses=("odom", "imu"),
            inputs=(DRAWING,),
        ),
    }
)


def problem_of(entry: MethodEntry) -> str:
    """The part of an entry whose type is wrong, in words; no text if there is none."""
    texts = {name: getattr(entry, name) for name in ("config", "mapper", "localizer", "explorer")}
    for name, text in texts.items():
        if not isinstance(text, str):
            return f"its {name} is not a string"
    for name in ("needs", "uses"):
        kinds = getattr(entry, name)
        if not isinstance(kinds, (tuple, list)) or not all(isinstance(kind, str) for kind in kinds):
            return f"its {name} are not a tuple of strings"
    inputs = entry.inputs
    if not isinstance(inputs, (tuple, list)) or not all(isinstance(kind, InputKind) for kind in inputs):
        return "its inputs are not a tuple of InputKind"
    if not all(isinstance(text, str) for kind in inputs for text in (kind.name, kind.reader, kind.in_run)):
        return "an input has a name or a reader that is not a string"
    return ""


METHODS: Mapping[str, MethodEntry] = PluginRegistry(BUILT_IN, MethodEntry, problem_of)


def package_of(name: str) -> str:
    """A method and its package in words, for messages; no text for one of the program's own."""
    return METHODS.package_of(name) if isinstance(METHODS, PluginRegistry) else ""


def option_words(name: str, file: str) -> tuple[str, str]:
    """The option for the file of an input: `--drawing FILE`, or `--input NAME=FILE` where the command line has no such option."""
    return (f"--{OPTIONS[name]}", file) if name in OPTIONS else ("--input", f"{name}={file}")


def built_in_with(has: Callable[[MethodEntry], object]) -> list[str]:
    """Names of the built-in methods for which `has` is true, for help texts; plug-in packages are not searched."""
    return [name for name, entry in BUILT_IN.items() if has(entry)]


def load(reference: str) -> Any:
    """The object that "module:Name" names. Raises ConfigError: there is none, or its module cannot be imported."""
    module, _, name = reference.partition(":")
    try:
        return getattr(importlib.import_module(module), name)
    except (ImportError, AttributeError) as error:
        raise ConfigError(
            f"{reference}: this part of a method cannot be loaded ({error}); see its entry in the registry"
        ) from error
