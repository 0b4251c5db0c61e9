"""Maps, paths, particles and markers as ROS 2 messages in CDR encoding."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.core.poses import quaternion_of_yaw
from gridslam.core.stamps import split_stamp
from gridslam.logs.encoding.cdr import CdrWriter
from gridslam.logs.encoding.encoded import Encoded
from gridslam.maps.map_cells import cells_of_grid
from gridslam.maps.occupancy import OccupancyGrid

MAP_FRAME = "map"
CUBE, TEXT = 1, 9  # visualization_msgs/Marker.type

Colour = tuple[float, float, float, float]


def occupancy_grid(topic: str, stamp_ns: int, grid: OccupancyGrid) -> Encoded:
    """nav_msgs/OccupancyGrid: occupancy in percent, -1 for unknown; row 0 is the bottom row."""
    rows, cols = grid.probability.shape
    x, y = grid.geometry.origin_xy_m
    body = CdrWriter().header(stamp_ns, MAP_FRAME)
    body.uint32(*split_stamp(stamp_ns)).float32(grid.geometry.resolution_m).uint32(cols, rows)
    body.float64(*pose_values(x, y, grid.geometry.yaw_rad))
    body.sequence(cells_of_grid(grid).ravel(), 1)
    return Encoded(topic, "nav_msgs/msg/OccupancyGrid", stamp_ns, body.data())


def path(topic: str, stamp_ns: int, stamps_ns: NDArray[np.int64], poses: NDArray[np.float64]) -> Encoded:
    """nav_msgs/Path of stamps `(n,)` and poses `(n, 3)`."""
    body = CdrWriter().header(stamp_ns, MAP_FRAME).uint32(len(poses))
    for stamp, (x, y, yaw) in zip(stamps_ns.tolist(), poses.tolist(), strict=True):
        body.header(stamp, MAP_FRAME).float64(*pose_values(x, y, yaw))
    return Encoded(topic, "nav_msgs/msg/Path", stamp_ns, body.data())


def pose_array(topic: str, stamp_ns: int, poses: NDArray[np.floating]) -> Encoded:
    """geometry_msgs/PoseArray of poses `(n, 3)`, n > 0."""
    w, x, y, z = quaternion_of_yaw(poses[:, 2].astype(np.float64)).T
    values = np.column_stack([poses[:, :2], np.zeros(len(poses)), x, y, z, w])
    body = CdrWriter().header(stamp_ns, MAP_FRAME).uint32(len(poses)).float64(*values.ravel().tolist())
    return Encoded(topic, "geometry_msgs/msg/PoseArray", stamp_ns, body.data())


def marker(
    body: CdrWriter, stamp_ns: int, space: str, number: int, kind: int, at: tuple[float, float, float, float],
    size: tuple[float, float, float], colour: Colour, text: str = "",
) -> None:  # fmt: skip
    """Append a visualization_msgs/Marker without a lifetime limit to a message `body`.

    `stamp_ns` is its stamp, `space` and `number` its namespace and id, `kind` its type; `at` is x, y, z (m), yaw (rad) in the map
    frame, `size` its scale (m) along x, y, z. `text` is shown by markers of text.
    """
    x, y, z, yaw = at
    add, forever = 0, (0, 0)
    body.header(stamp_ns, MAP_FRAME).text(space).numbers("i", (number, kind, add), 4)
    body.float64(*pose_values(x, y, yaw, z), *size).float32(*colour)
    body.uint32(*forever).uint8(0)  # lifetime, frame_locked
    body.uint32(0, 0).text("")  # points, colors, texture_resource
    body.header(0, "").text("").uint32(0)  # texture
    body.uint32(0).text(text).text("")  # uv_coordinates, text, mesh_resource
    body.text("").uint32(0).uint8(0)  # mesh_file, mesh_use_embedded_materials


def pose_values(x: float, y: float, yaw: float, z: float = 0.0) -> tuple[float, ...]:
    """The seven numbers of a geometry_msgs/Pose."""
    qw, qx, qy, qz = quaternion_of_yaw(yaw).tolist()
    return x, y, z, qx, qy, qz, qw
