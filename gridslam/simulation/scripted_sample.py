"""The scripted log as a file, with its truth beside it: `python -m gridslam.simulation.scripted_sample OUT.mcap`."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from gridslam.core.files import write_atomic
from gridslam.core.messages import Odometry
from gridslam.core.poses import quaternion_of_yaw
from gridslam.logs.stamps import format_stamp
from gridslam.logs.write import open_writer
from gridslam.maps.map_server import save_map
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid
from gridslam.simulation.scripted import BLOCKS, HALL, Rectangle, scripted_log, walls

RESOLUTION_M = 0.05


def write_sample(path: Path) -> None:
    """Write the log, and `NAME.truth/` with `trajectory.tum`, `map.pgm` and `map.yaml`."""
    lines = []
    with open_writer(path, force=True) as writer:
        for event, truth in scripted_log():
            writer.write(event)
            if truth is not None:
                writer.write_truth(truth)
                lines.append(_tum_line(truth))
    folder = path.with_name(f"{path.name.removesuffix('.mcap')}.truth")
    folder.mkdir(exist_ok=True)
    write_atomic(folder / "trajectory.tum", "".join(lines).encode())
    save_map(true_map(), folder / "map")


def _tum_line(pose: Odometry) -> str:
    qw, _, _, qz = quaternion_of_yaw(pose.yaw_rad).tolist()
    return f"{format_stamp(pose.stamp_ns)} {pose.x_m:.9f} {pose.y_m:.9f} 0 0 0 {qz:.12f} {qw:.12f}\n"


def true_map() -> OccupancyGrid:
    """Walls occupied, the hall free, the inside of blocks unknown."""
    margin = 0.5
    geometry = GridGeometry(RESOLUTION_M, (HALL[0] - margin, HALL[1] - margin))
    rows, cols = (round((HALL[i + 2] - HALL[i] + 2 * margin) / RESOLUTION_M) for i in (1, 0))
    cells = np.stack(np.meshgrid(np.arange(rows), np.arange(cols), indexing="ij"), axis=-1).reshape(-1, 2)
    centres = geometry.centres(cells)
    probability = np.full(len(cells), np.nan, np.float32)
    blocked = np.any([_inside(centres, block) for block in BLOCKS], axis=0)
    probability[_inside(centres, HALL) & ~blocked] = 0.0
    grid = probability.reshape(rows, cols)
    for x0, y0, x1, y1 in walls():
        n = int(np.hypot(x1 - x0, y1 - y0) / (0.2 * RESOLUTION_M)) + 1
        points = np.linspace((x0, y0), (x1, y1), n)
        row, col = geometry.cells(points).T
        grid[row, col] = 1.0
    return OccupancyGrid(grid, geometry)


def _inside(points: np.ndarray, rectangle: Rectangle) -> np.ndarray:
    x0, y0, x1, y1 = rectangle
    x, y = points.T
    return np.asarray((x > x0) & (x < x1) & (y > y0) & (y < y1))


if __name__ == "__main__":
    write_sample(Path(sys.argv[1]))
