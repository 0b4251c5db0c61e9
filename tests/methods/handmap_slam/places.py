"""The scripted hall as a drawing, and a run of handmap-slam over the scripted log."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import Event, Odometry, Range
from gridslam.maps.drawings.drawing import Drawing
from gridslam.methods.base import RunResult
from gridslam.methods.handmap_slam.config import HandmapSlamConfig
from gridslam.methods.handmap_slam.drawing_pose import DrawingPose
from gridslam.methods.handmap_slam.method import HandmapSlam
from gridslam.simulation.driving.scripted import scripted_drawing, scripted_log

MARGIN_M = 1.0
START = (3.0, 2.5, 0.0)  # of the scripted robot in the drawing at scale 1


def hall_drawing(scale_x: float = 1.0, scale_y: float = 1.0, mirrored: bool = False) -> Drawing:
    """The hall drawn with these scales, in drawing units per metre."""
    levels = scripted_drawing().levels
    rows, cols = levels.shape
    size = (round(cols * scale_x), round(rows * scale_y))
    stretched = cv2.resize(levels, size, interpolation=cv2.INTER_AREA)
    thick = cv2.erode(stretched, np.ones((3, 3), np.uint8))
    return Drawing(np.ascontiguousarray(thick[:, ::-1] if mirrored else thick), "hall.png")


def start_in(scale_x: float = 1.0, scale_y: float = 1.0) -> tuple[float, float, float]:
    """Where the scripted robot starts in such a drawing."""
    return START[0] * scale_x, START[1] * scale_y, START[2]


def drawn_truth(pose: NDArray[np.float64], scale_x: float = 1.0, scale_y: float = 1.0) -> NDArray[np.float64]:
    """Where a true position `(..., 2+)` of the hall lies in such a drawing."""
    return (pose[..., :2] + MARGIN_M) * (scale_x, scale_y)


def run(
    config: HandmapSlamConfig, drawing: Drawing, laps: int = 1, seed: int = 0, max_events: int = 10**9
) -> tuple[RunResult, list[tuple[DrawingPose, NDArray[np.float64]]], HandmapSlam]:
    """The result, and the pose in the drawing with the true pose after every odometry message."""
    method = HandmapSlam(config, seed, drawing=drawing)
    method.process_at_once()
    pairs = []
    for index, (event, truth) in enumerate(scripted(laps)):
        if index >= max_events:
            break
        method.process(event)
        if truth is not None and method.drawing_pose is not None:
            pairs.append((method.drawing_pose, np.array([truth.x_m, truth.y_m, truth.yaw_rad])))
    return method.result(), pairs, method


def true_poses() -> dict[int, NDArray[np.float64]]:
    """True poses of the scripted log by stamp."""
    return {
        truth.stamp_ns: np.array([truth.x_m, truth.y_m, truth.yaw_rad])
        for _, truth in scripted_log(laps=1)
        if truth is not None
    }


def position_errors(result: RunResult) -> NDArray[np.float64]:
    """Position errors `(n,)` of the trajectory, with the first pose aligned to the truth."""
    truth = true_poses()
    expected = np.array([truth[stamp] for stamp in result.trajectory.stamps_ns.tolist()])
    aligned = se2.compose(expected[0], result.trajectory.poses)
    return np.hypot(*(aligned - expected)[:, :2].T)


def events(laps: int = 1) -> list[Event]:
    """The scripted events."""
    return [event for event, _ in scripted(laps)]


def scripted(laps: int = 1) -> Iterator[tuple[Event, Odometry | None]]:
    """The scripted log without its infrared ranger."""
    return ((event, truth) for event, truth in scripted_log(laps=laps) if not isinstance(event, Range))
