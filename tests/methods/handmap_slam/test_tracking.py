"""Parts of the tracking in the drawing: visited poses, curved walls, the start of the localizer."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from gridslam.core import poses as se2
from gridslam.core.random import random_stream
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.maps.drawings.drawing import Drawing, DrawnMap, drawn_map
from gridslam.methods.handmap_slam.config import HandmapSlamConfig
from gridslam.methods.handmap_slam.drawing_pose import DrawingPose
from gridslam.methods.handmap_slam.drawn_likelihood import DrawnLikelihood
from gridslam.methods.handmap_slam.driving.visited_poses import VisitedPose, VisitedPoses
from gridslam.methods.handmap_slam.line_front_end import LineFrontEnd
from gridslam.methods.handmap_slam.line_observation import LineObserver
from gridslam.methods.handmap_slam.localizer import DrawingLocalizer

SEMI_AXES_M = (6.0, 4.0)
CENTRE_M = (8.0, 6.0)


def oval() -> DrawnMap:
    """An oval room of 12 x 8 m: no straight wall."""
    levels = np.full((121, 161), 255, np.uint8)
    axes = tuple(round(10 * a) for a in SEMI_AXES_M)
    cv2.ellipse(levels, (80, 60), axes, 0, 0, 360, 0, 1)
    return drawn_map(Drawing(levels, "oval"))


def scan_from(pose: np.ndarray, stamp_ns: int = 0) -> PreparedScan:
    """A scan of the oval from a pose in it, relative to its centre."""
    angle = np.linspace(-np.pi, np.pi, 240, endpoint=False)
    wall = np.column_stack([SEMI_AXES_M[0] * np.cos(angle), SEMI_AXES_M[1] * np.sin(angle)])
    inward = -np.column_stack([np.cos(angle) / SEMI_AXES_M[0], np.sin(angle) / SEMI_AXES_M[1]])
    inward /= np.hypot(*inward.T)[:, None]
    points = se2.transform_points(se2.inverse(pose), wall)
    normals = se2.transform_points(np.array([0.0, 0.0, -pose[2]]), inward)
    return PreparedScan(stamp_ns, np.zeros(2), points, points, normals, points, normals)


def drawn_pose(pose: np.ndarray) -> DrawingPose:
    return DrawingPose(
        0,
        pose[0] + CENTRE_M[0],
        pose[1] + CENTRE_M[1],
        float(pose[2]),
        scale_x=1.0,
        scale_y=1.0,
        position_std=0.1,
        inlier_ratio=1.0,
    )


def test_in_an_oval_room_the_distance_field_keeps_the_heading():
    drawn, config = oval(), HandmapSlamConfig(front_end="lines")
    front_end = LineFrontEnd(config, LineObserver(drawn), DrawnLikelihood(drawn, 0.3))
    truth, odometry = np.array([-3.0, 0.0, 0.0]), np.zeros(3)
    first = truth.copy()
    front_end.track(scan_from(truth), odometry)
    front_end.add_key_scan(scan_from(truth))
    for _ in range(60):
        front_end.drawing_pose = drawn_pose(truth)
        truth = se2.compose(truth, np.array([0.1, 0.0, 0.01]))
        odometry = se2.compose(odometry, np.array([0.1, 0.0, 0.02]))  # its yaw rate is twice the true one
        front_end.track(scan_from(truth), odometry)
        front_end.add_key_scan(scan_from(truth))
    error = se2.between(se2.compose(first, front_end.pose), truth)
    assert abs(float(error[2])) < 0.03
    assert float(np.hypot(error[0], error[1])) < 0.1


@pytest.mark.parametrize("scale", [0.6, 1.0, 2.0])
def test_the_first_scan_gives_pose_and_scale_around_a_given_start(scale):
    levels = np.asarray(oval().walls, np.uint8)[::1]
    size = (round(161 * scale), round(121 * scale))
    picture = np.where(cv2.resize(levels, size, interpolation=cv2.INTER_AREA) > 0, 0, 255).astype(np.uint8)
    drawn = drawn_map(Drawing(picture, "oval"), start_xy=(CENTRE_M[0] * scale, CENTRE_M[1] * scale))
    start = (CENTRE_M[0] * scale + 0.3, CENTRE_M[1] * scale - 0.2, 0.1)
    config = HandmapSlamConfig(start=start)
    localizer = DrawingLocalizer(config, drawn, random_stream(0, "test"))
    belief = localizer.start(scan_from(np.array([1.0, 0.5, 0.0])).points)
    assert np.exp(belief.state[3:].mean()) == pytest.approx(scale, rel=0.08)
    wanted = ((CENTRE_M[0] + 1.0) * scale, (CENTRE_M[1] + 0.5) * scale)
    assert belief.state[:2] == pytest.approx(wanted, abs=0.35 * scale)
    assert belief.inlier_ratio > 0.9


def test_a_state_outside_the_picture_is_not_free():
    likelihood = DrawnLikelihood(oval(), 0.3)
    states = np.zeros((3, 5))
    states[0, :2] = CENTRE_M
    states[1, :2] = (-5.0, 3.0)
    states[2, :2] = (1e6, 1e6)
    assert likelihood.is_free(states).tolist() == [True, False, False]
    assert likelihood.inlier_ratio(np.zeros((0, 2)), states[0]) == 0.0


def test_visited_poses_within_the_radius_are_returned():
    rng = np.random.default_rng(0)
    places, all_of_them = VisitedPoses(1.0), []
    for k in range(300):
        visited = VisitedPose(np.array([*rng.uniform(-5, 5, 2), 0.0]), float(k), drawn_pose(np.zeros(3)))
        places.add(visited)
        all_of_them.append(visited)
    for query in rng.uniform(-5, 5, (30, 3)):
        found = {b.travelled_m for b in places.near(query, 0.8)}
        wanted = {b.travelled_m for b in all_of_them if np.hypot(*(b.track_pose - query)[:2]) < 0.8}
        assert found == wanted


def test_a_start_outside_the_drawn_walls_makes_the_drawing_open():
    picture = np.full((121, 161), 255, np.uint8)
    cv2.ellipse(picture, (80, 60), (60, 40), 0, 0, 360, 0, 2)
    drawn = drawn_map(Drawing(picture, "oval"), start_xy=(1.0, 1.0))
    assert drawn.is_open
    assert not drawn_map(Drawing(picture, "oval"), start_xy=CENTRE_M).is_open
