"""The search of a pose window without branch and bound: every pose is scored."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.scan_matching.window_search import LikelihoodField, PoseWindow, WindowSearch

Floats = NDArray[np.float64]


def all_scores(
    field: LikelihoodField, points: Floats, window: PoseWindow, search: WindowSearch
) -> tuple[Floats, Floats]:
    """All poses `(n, 3)` of the window and their scores `(n,)`."""
    cols, rows = (int(np.ceil(w / field.cell_m)) for w in window.half_width[:2])
    yaws = int(np.ceil(window.half_width[2] / search.yaw_step_rad))
    poses, scores = [], []
    for k in range(-yaws, yaws + 1):
        yaw = window.centre[2] + k * search.yaw_step_rad
        rotation = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
        placed = points @ rotation.T + window.centre[:2]
        cells = np.floor((placed - field.corner) / field.cell_m).astype(int)
        for dr in range(-rows, rows + 1):
            for dc in range(-cols, cols + 1):
                c, r = cells[:, 0] + dc, cells[:, 1] + dr
                inside = (r >= 0) & (c >= 0) & (r < field.values.shape[0]) & (c < field.values.shape[1])
                scores.append(field.values[r[inside], c[inside]].sum() / (255.0 * len(points)))
                offset = np.array([dc * field.cell_m, dr * field.cell_m, 0.0])
                poses.append(window.centre + offset)
                poses[-1][2] = yaw
    return np.array(poses), np.array(scores)
