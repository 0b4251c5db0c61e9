"""Errors that name why there is no path, and what to change."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from gridslam.core.errors import MethodError
from gridslam.maps.distances import distances_to
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.planning.space import Space

Floats = NDArray[np.float64]

HALVINGS = 12  # number of halvings of the interval that holds the width of the widest passage


def blocked_pose(
    occupancy: OccupancyGrid, space: Space, name: str, pose: Floats, local: Floats
) -> MethodError:
    """The error for a start or goal where the robot cannot stand: `pose` `(3,)` in the map frame, `local` in the space's."""
    where = f"{name} {pose[0]:g},{pose[1]:g}"
    row, col = space.cell(local)
    rows, cols = occupancy.probability.shape
    if not (1 <= row <= rows and 1 <= col <= cols):
        return MethodError(f"{where}: lies outside the map; {_extent(occupancy)}")
    if space.blocked[row, col]:
        unknown = bool(np.isnan(occupancy.probability[row - 1, col - 1]))
        if unknown:
            return MethodError(
                f"{where}: lies in an unknown cell; choose a free place, or let unknown cells be free"
            )
        return MethodError(f"{where}: lies inside an obstacle; choose a free place")
    cells = _blocked_cells_near(space, local)
    centres = (cells[:, ::-1] + 0.5) * space.resolution_m
    gaps = np.maximum(np.abs(centres - local[:2]) - 0.5 * space.resolution_m, 0.0)
    distances = np.hypot(*gaps.T)
    nearest = int(np.argmin(distances))
    x, y = space.to_map(np.array([[*centres[nearest], 0.0]]))[0, :2]
    kind = _kind(occupancy, *(cells[nearest] - 1))
    return MethodError(
        f"{where}: the robot does not fit there: {kind} at {x:.2f},{y:.2f} is {distances[nearest]:.2f} m from its origin; "
        "choose another place or a smaller robot"
    )


def _blocked_cells_near(space: Space, local: Floats) -> NDArray[np.int64]:
    """Blocked cells `(k, 2)` (row, col) around a pose in the space's frame; the nearest one is among them."""
    row, col = space.cell(local)
    distance_m = float(space.field[2 * row + 1, 2 * col + 1])  # from the centre of the pose's cell
    radius = int(distance_m / space.resolution_m) + 3
    r0, c0 = max(row - radius, 0), max(col - radius, 0)
    window = space.blocked[r0 : row + radius + 1, c0 : col + radius + 1]
    return np.asarray(np.argwhere(window) + np.array([r0, c0]))


def no_path(
    occupancy: OccupancyGrid, space: Space, occupied_from: float, start: Floats, goal: Floats
) -> MethodError:
    """The error for a start and a goal `(3,)`, in the space's frame, that are separated by obstacles or unknown cells."""
    (sx, sy), (gx, gy) = space.to_map(np.array([start, goal]))[:, :2].tolist()
    pair = f"no path from {sx:g},{sy:g} to {gx:g},{gy:g}"
    width, narrowest = _widest_passage(space, start, goal)
    if width > 0.0:
        x, y = space.to_map(np.array([[*narrowest, 0.0]]))[0, :2]
        return MethodError(
            f"{pair}: the widest passage is only {width:.2f} m wide at {x:.2f},{y:.2f}; a smaller robot would fit"
        )
    if _is_connected(
        ~(np.pad(occupancy.probability, 1) > occupied_from), space.cell(start), space.cell(goal)
    ):
        return MethodError(
            f"{pair}: unknown cells separate them; map the place, or let unknown cells be free"
        )
    return MethodError(f"{pair}: obstacles separate them")


def unreachable_heading(which: str, pose: Floats, radius_m: float, reverse: bool) -> MethodError:
    """The error for a pose `(3,)` (map frame) with room for the robot, but not for arcs that lead to or from its heading."""
    hint = "allow a smaller radius, turns on the spot" + ("" if reverse else ", or driving backwards")
    return MethodError(
        f"{which} {pose[0]:g},{pose[1]:g}: its heading {pose[2]:.3g} rad cannot be met by arcs of {radius_m:g} m or more; {hint}"
    )


def search_limit_reached(radius_m: float, states: int) -> MethodError:
    """The error for a search that reached its limit of states."""
    return MethodError(
        f"no path found among {states} poses: there may be one, but it needs many turns of {radius_m:g} m in narrow places; "
        "allow a smaller radius, turns on the spot or driving backwards"
    )


def path_too_long(length_m: float, max_length_m: float) -> MethodError:
    """The error for a path longer than the planner's limit."""
    return MethodError(
        f"the path would be {length_m / 1000.0:.0f} km long, at most {max_length_m / 1000.0:.0f} km are planned: "
        "plan it in parts, or check the map's resolution"
    )


def _widest_passage(space: Space, start: Floats, goal: Floats) -> tuple[float, Floats]:
    """Width (m) of the widest path at its narrowest place, and that place (x, y) in the space's frame; 0 if there is no path.

    With any larger clearance the free space separates, so the place lies between the part with the start and another part.
    """
    ends = [(2 * row + 1, 2 * col + 1) for row, col in (space.cell(start), space.cell(goal))]
    low, high = 0.0, float(min(space.field[end] for end in ends))
    if not _is_connected(space.field > 0.0, *ends):
        return 0.0, np.zeros(2)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _is_connected(space.field > middle, *ends) else (low, middle)
    _, parts = cv2.connectedComponents(np.asarray(space.field > high, np.uint8), connectivity=8)
    _, whole = cv2.connectedComponents(np.asarray(space.field > low, np.uint8), connectivity=8)
    around_start = parts == parts[ends[0]] if parts[ends[0]] else _single_cell(parts.shape, ends[0])
    others = ((parts > 0) & ~around_start & (whole == whole[ends[0]])) | _single_cell(parts.shape, ends[1])
    detours = np.where(whole == whole[ends[0]], distances_to(around_start) + distances_to(others), np.inf)
    row, col = np.unravel_index(int(np.argmin(detours)), detours.shape)
    return 2.0 * low, np.array([col, row]) * 0.5 * space.resolution_m


def _single_cell(shape: tuple[int, ...], place: tuple[int, int]) -> NDArray[np.bool_]:
    """A mask with one cell set."""
    mask = np.zeros(shape, np.bool_)
    mask[place] = True
    return mask


def _is_connected(free: NDArray[np.bool_], a: tuple[int, int], b: tuple[int, int]) -> bool:
    """Whether two cells lie in one 8-connected part of the mask."""
    _, labels = cv2.connectedComponents(np.asarray(free, np.uint8), connectivity=8)
    return bool(labels[a] == labels[b] and labels[a] > 0)


def _kind(occupancy: OccupancyGrid, row: int, col: int) -> str:
    """A noun phrase for what blocks the map's cell (row, col)."""
    rows, cols = occupancy.probability.shape
    if not (0 <= row < rows and 0 <= col < cols):
        return "the map's edge"
    return "an unknown cell" if np.isnan(occupancy.probability[row, col]) else "an obstacle"


def _extent(occupancy: OccupancyGrid) -> str:
    """A phrase with the bounding box of the map."""
    rows, cols = occupancy.probability.shape
    ends = np.array([[0, 0], [0, cols], [rows, 0], [rows, cols]])
    corners = occupancy.geometry.centres(ends - 0.5)
    (x0, y0), (x1, y1) = corners.min(axis=0), corners.max(axis=0)
    return f"it reaches from {x0:.2f},{y0:.2f} to {x1:.2f},{y1:.2f}"
