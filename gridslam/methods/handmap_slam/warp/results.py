"""Report of a run about the warp: tables, a picture, measures, and whether the robot's place in the drawing is known."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.stamps import format_stamp
from gridslam.maps.drawings.drawing import DrawnMap
from gridslam.methods.base import Doubt, Picture, Table
from gridslam.methods.handmap_slam.drawing_pose import DrawingPose
from gridslam.methods.handmap_slam.warp.comparison import MIN_ROOM_M2, DrawingComparison
from gridslam.methods.handmap_slam.warp.warp import MAX_MISFIT, DrawingWarp

Floats = NDArray[np.float64]

PATH_COLUMNS = ("stamp", "x", "y", "yaw", "scale_x", "scale_y", "agreement", "doubtful")
WARP_COLUMNS = ("map_x_m", "map_y_m", "x", "y", "rotation", "scale_x", "scale_y", "agreement", "doubtful")
ROOM_COLUMNS = ("room", "x", "y", "area_m2", "observed", "agreement", "state")
OUTSIDE, DRAWN, WALL = (214, 218, 224), (255, 255, 255), (60, 66, 76)
MATCHING, DIFFERS = (222, 240, 222), (250, 226, 200)
LACKING, EXTRA, PATH, START = (205, 45, 45), (150, 60, 190), (30, 110, 200), (30, 150, 70)
DOUBTFUL = (240, 130, 20)
# Of the poses. Above the first a note says so, above the last the run is lost: of the doubtful poses of made drawings one in six
# is wrong, and most of the others lie about them.
MAX_DOUBTFUL_FRACTION, LOST_FRACTION = 0.1, 0.75
MIN_PICTURE_PX, MAX_PICTURE_PX = 700, 1600


def poses_in_drawing(
    warp: DrawingWarp, stamps_ns: Sequence[int], poses: Floats, agreement: Floats
) -> list[DrawingPose]:
    """The robot at poses `(n, 3)` of the map, in the drawing."""
    owners = warp.graph.owners
    at = warp.to_drawing(poses[:, :2], owners)
    states = warp.states[owners]
    yaws = se2.wrap_angle(states[:, 2] + poses[:, 2])
    scales = np.exp(states[:, 3:])
    numbers = np.column_stack([at, yaws, scales]).tolist()
    ratios = agreement[owners].tolist()
    return [
        DrawingPose(
            stamp_ns=int(stamp),
            x=x,
            y=y,
            yaw_rad=yaw,
            scale_x=scale_x,
            scale_y=scale_y,
            position_std=float("nan"),
            inlier_ratio=ratio,
        )
        for stamp, (x, y, yaw, scale_x, scale_y), ratio in zip(stamps_ns, numbers, ratios, strict=True)
    ]


def tables_of(
    warp: DrawingWarp, comparison: DrawingComparison, path: Sequence[DrawingPose]
) -> dict[str, Table]:
    """`drawing_path`: the robot in the drawing. `warp`: places of the map in it. `rooms`: the drawing's rooms."""
    poses = [
        (
            format_stamp(p.stamp_ns),
            *_rounded(p.x, p.y, p.yaw_rad, p.scale_x, p.scale_y, p.inlier_ratio),
            int(is_doubtful),
        )
        for p, is_doubtful in zip(path, warp.doubtful_poses.tolist(), strict=True)
    ]
    places = [
        (*_rounded(*centre, *state[:3], *np.exp(state[3:]), ratio), int(is_doubtful))
        for centre, state, ratio, is_doubtful in zip(
            warp.graph.centres, warp.states, comparison.place_agreement, warp.doubtful, strict=True
        )
    ]
    rooms = [
        (number, *_rounded(room.x, room.y, room.area_m2, room.observed, room.agreement), room.state)
        for number, room in enumerate(comparison.rooms, 1)
        if room.area_m2 >= MIN_ROOM_M2
    ]
    return {
        "drawing_path": Table(PATH_COLUMNS, poses),
        "warp": Table(WARP_COLUMNS, places),
        "rooms": Table(ROOM_COLUMNS, rooms),
    }


def _rounded(*values: float) -> tuple[float, ...]:
    return tuple(round(float(v), 3) for v in values)


def measures_of_warp(warp: DrawingWarp, comparison: DrawingComparison) -> dict[str, object]:
    """Whether the drawing fits, how well and where not, and how much it lacks or has too much of."""
    doubtful = float(warp.doubtful_poses.mean())
    states = [room.state for room in comparison.rooms if room.area_m2 >= MIN_ROOM_M2]
    return {
        "fits": warp.fits,
        "doubtful_fraction": round(doubtful, 4),
        "summary": f"the robot's place in it is uncertain over {doubtful:.0%} of the path"
        if doubtful
        else "",
        "cost_per_place": round(warp.cost_per_place, 3),
        "misfit": round(warp.misfit, 3),
        "wall_agreement": round(comparison.wall_agreement, 4),
        "lacking_m": round(comparison.lacking_m, 1),
        "extra_m": round(comparison.extra_m, 1),
        "rooms": {name: states.count(word) for name, word in _STATES.items()},
    }


_STATES = {"agree": "agrees", "differ": "differs", "not_visited": "not visited"}


def doubt_about(warp: DrawingWarp) -> Doubt | None:
    """Doubt where the drawing cannot be laid over the map, or over hardly any part of it with certainty."""
    if not warp.fits:
        return Doubt(
            "lost",
            "the drawing does not fit the map, so the robot's place in it is not known; the map is not affected "
            f"(misfit of a place {warp.misfit:.1f}, at most {MAX_MISFIT:g} expected); "
            "does it show this place, is it not mirrored, and is method.start right?",
        )
    doubtful = float(warp.doubtful_poses.mean())
    return Doubt("lost", _doubtful_line(doubtful)) if doubtful > LOST_FRACTION else None


def notes_about(warp: DrawingWarp) -> tuple[str, ...]:
    """A line for the user if the robot's place in the drawing is uncertain over a part of the path."""
    doubtful = float(warp.doubtful_poses.mean())
    return (_doubtful_line(doubtful),) if MAX_DOUBTFUL_FRACTION < doubtful <= LOST_FRACTION else ()


def _doubtful_line(doubtful: float) -> str:
    return (
        f"over {doubtful:.0%} of the path the robot may be elsewhere in the drawing: parts of it do not fit the map, or fit in "
        "another way as well (orange in warp.png, `doubtful` in drawing_path.csv); the map is not affected"
    )


def warp_picture(
    drawn: DrawnMap, warp: DrawingWarp, comparison: DrawingComparison, path: Sequence[DrawingPose]
) -> Picture:
    """The drawing, its rooms coloured by agreement, with the robot's path."""
    rows, cols = drawn.walls.shape
    rgb = np.full((rows, cols, 3), OUTSIDE, np.uint8)
    rgb[drawn.free] = DRAWN
    for number, room in enumerate(comparison.rooms, 1):
        if room.state != "not visited":
            rgb[comparison.labels == number] = MATCHING if room.state == "agrees" else DIFFERS
    rgb[drawn.walls] = WALL
    rgb[comparison.extra] = EXTRA
    rgb[comparison.lacking] = LACKING
    longest = max(rows, cols)
    zoom = min(max(MIN_PICTURE_PX / longest, 1.0), MAX_PICTURE_PX / longest)
    size = (round(cols * zoom), round(rows * zoom))
    picture = np.ascontiguousarray(cv2.resize(rgb, size, interpolation=cv2.INTER_NEAREST))
    points = np.array([(p.x, p.y) for p in path]) * (zoom / drawn.geometry.resolution_m)
    line = np.rint(points * 16).astype(np.int32)
    cv2.polylines(picture, [line], False, PATH, 2, cv2.LINE_AA, 4)
    doubtful = warp.doubtful_poses
    for part in np.split(np.arange(len(path)), np.flatnonzero(np.diff(doubtful)) + 1):
        if doubtful[part[0]]:
            cv2.polylines(picture, [line[part]], False, DOUBTFUL, 3, cv2.LINE_AA, 4)
    cv2.circle(picture, tuple(np.rint(points[0]).astype(int).tolist()), 4, START, -1, cv2.LINE_AA)
    note = (
        "The drawing laid over the finished map. Blue: the path, from the green dot; orange where it may be elsewhere. "
        "Green rooms agree, orange ones differ, "
        "white ones were not visited. Red: mapped walls that are not drawn. Violet: drawn walls where the robot saw free space."
    )
    return Picture(np.ascontiguousarray(picture[::-1]), "The drawing on the map", note)
