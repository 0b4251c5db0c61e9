"""Occupancy mapping, SLAM and localization from recorded sensor logs.

`PUBLIC` below is the surface for notebooks, scripts and packages that add a method; docs/python.md shows it at work. Names
are loaded when they are first used: `import gridslam` itself takes no time.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

PUBLIC = {
    # Runs
    "load_config": "gridslam.runs.run_config",
    "RunConfig": "gridslam.runs.run_config",
    "map_log": "gridslam.api",
    "localize": "gridslam.api",
    "FinishedRun": "gridslam.api",
    "Progress": "gridslam.runs.feed",
    # Logs
    "open_log": "gridslam.logs.open",
    "Log": "gridslam.logs.log",
    "LogConfig": "gridslam.logs.config",
    "StreamInfo": "gridslam.logs.streams",
    "write_log": "gridslam.logs.write",
    "simulate": "gridslam.api",
    "messages": "gridslam.core",
    # Maps, trajectories, plans
    "load_map": "gridslam.api",
    "save_map": "gridslam.api",
    "render_map": "gridslam.maps.preview",
    "OccupancyGrid": "gridslam.maps.occupancy",
    "GridGeometry": "gridslam.maps.occupancy",
    "GridLayer": "gridslam.maps.occupancy",
    "Trajectory": "gridslam.core.trajectory",
    "load_trajectory": "gridslam.api",
    "poses": "gridslam.core",
    "plan_path": "gridslam.planning.arcs_and_lines",
    "PlanOptions": "gridslam.planning.options",
    "SpeedLimits": "gridslam.planning.travel_time",
    "PlannedPath": "gridslam.planning.arcs_and_lines",
    "PathCandidate": "gridslam.planning.arcs_and_lines",
    "ArcLinePath": "gridslam.planning.path",
    "Segment": "gridslam.planning.path",
    # Evaluation
    "evaluate": "gridslam.api",
    "EvaluationOptions": "gridslam.evaluation.inputs",
    "Delta": "gridslam.evaluation.pose_errors",
    # What a method is made of
    "Method": "gridslam.methods.base",
    "MethodEntry": "gridslam.methods.registry",
    "InputKind": "gridslam.methods.registry",
    "StrictModel": "gridslam.config.base",
    "RunResult": "gridslam.methods.base",
    "Estimate": "gridslam.methods.base",
    "Table": "gridslam.methods.base",
    "Series": "gridslam.methods.base",
    "Picture": "gridslam.methods.base",
    "PlacedObject": "gridslam.methods.base",
    "Doubt": "gridslam.methods.base",
    "random_stream": "gridslam.core.random",
    # What a method with a lidar can use
    "ScanPoses": "gridslam.motion.scan_poses",
    "PlacedScan": "gridslam.motion.scan_poses",
    "OdometryLimits": "gridslam.motion.odometry_limits",
    "Beams": "gridslam.sensors.lidar_beams",
    "LidarExtrinsics": "gridslam.sensors.lidar_beams",
    "beams_of": "gridslam.sensors.lidar_beams",
    "extrinsics_of": "gridslam.sensors.lidar_beams",
    "GrowingGrid": "gridslam.maps.growing_grid",
    # Errors
    "GridslamError": "gridslam.core.errors",
    "ConfigError": "gridslam.core.errors",
    "InputError": "gridslam.core.errors",
    "LogError": "gridslam.core.errors",
    "MapError": "gridslam.core.errors",
    "MethodError": "gridslam.core.errors",
}
"""Each public name, and the module that it comes from."""

if TYPE_CHECKING:
    from gridslam.api import FinishedRun as FinishedRun
    from gridslam.api import evaluate as evaluate
    from gridslam.api import load_map as load_map
    from gridslam.api import load_trajectory as load_trajectory
    from gridslam.api import localize as localize
    from gridslam.api import map_log as map_log
    from gridslam.api import save_map as save_map
    from gridslam.api import simulate as simulate
    from gridslam.config.base import StrictModel as StrictModel
    from gridslam.core import messages as messages
    from gridslam.core import poses as poses
    from gridslam.core.errors import ConfigError as ConfigError
    from gridslam.core.errors import GridslamError as GridslamError
    from gridslam.core.errors import InputError as InputError
    from gridslam.core.errors import LogError as LogError
    from gridslam.core.errors import MapError as MapError
    from gridslam.core.errors import MethodError as MethodError
    from gridslam.core.random import random_stream as random_stream
    from gridslam.core.trajectory import Trajectory as Trajectory
    from gridslam.evaluation.inputs import EvaluationOptions as EvaluationOptions
    from gridslam.evaluation.pose_errors import Delta as Delta
    from gridslam.logs.config import LogConfig as LogConfig
    from gridslam.logs.log import Log as Log
    from gridslam.logs.open import open_log as open_log
    from gridslam.logs.streams import StreamInfo as StreamInfo
    from gridslam.logs.write import write_log as write_log
    from gridslam.maps.growing_grid import GrowingGrid as GrowingGrid
    from gridslam.maps.occupancy import GridGeometry as GridGeometry
    from gridslam.maps.occupancy import GridLayer as GridLayer
    from gridslam.maps.occupancy import OccupancyGrid as OccupancyGrid
    from gridslam.maps.preview import render_map as render_map
    from gridslam.methods.base import Doubt as Doubt
    from gridslam.methods.base import Estimate as Estimate
    from gridslam.methods.base import Method as Method
    from gridslam.methods.base import Picture as Picture
    from gridslam.methods.base import PlacedObject as PlacedObject
    from gridslam.methods.base import RunResult as RunResult
    from gridslam.methods.base import Series as Series
    from gridslam.methods.base import Table as Table
    from gridslam.methods.registry import InputKind as InputKind
    from gridslam.methods.registry import MethodEntry as MethodEntry
    from gridslam.motion.odometry_limits import OdometryLimits as OdometryLimits
    from gridslam.motion.scan_poses import PlacedScan as PlacedScan
    from gridslam.motion.scan_poses import ScanPoses as ScanPoses
    from gridslam.planning.arcs_and_lines import PathCandidate as PathCandidate
    from gridslam.planning.arcs_and_lines import PlannedPath as PlannedPath
    from gridslam.planning.arcs_and_lines import plan_path as plan_path
    from gridslam.planning.options import PlanOptions as PlanOptions
    from gridslam.planning.path import ArcLinePath as ArcLinePath
    from gridslam.planning.path import Segment as Segment
    from gridslam.planning.travel_time import SpeedLimits as SpeedLimits
    from gridslam.runs.feed import Progress as Progress
    from gridslam.runs.run_config import RunConfig as RunConfig
    from gridslam.runs.run_config import load_config as load_config
    from gridslam.sensors.lidar_beams import Beams as Beams
    from gridslam.sensors.lidar_beams import LidarExtrinsics as LidarExtrinsics
    from gridslam.sensors.lidar_beams import beams_of as beams_of
    from gridslam.sensors.lidar_beams import extrinsics_of as extrinsics_of

__all__ = ["PUBLIC", "__version__", *PUBLIC]


def __getattr__(name: str) -> Any:
    """The public object of a name, imported at its first use."""
    if name not in PUBLIC:
        raise AttributeError(
            f"module 'gridslam' has no attribute {name!r}; public names are in gridslam.PUBLIC"
        )
    module = importlib.import_module(PUBLIC[name])
    value = getattr(module, name, None) or importlib.import_module(f"{PUBLIC[name]}.{name}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *PUBLIC})
