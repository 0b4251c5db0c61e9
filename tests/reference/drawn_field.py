"""Reference implementation of the score of a scan on a drawing, point by point."""

from __future__ import annotations

import math


def sum_over_stretched_points(field, resolution_m, table, entries_per_m, points, state):
    x, y, yaw, log_x, log_y = (float(v) for v in state)
    scale_x, scale_y = math.exp(log_x), math.exp(log_y)
    mean_scale = math.sqrt(scale_x * scale_y)
    total = 0.0
    for px, py in points:
        along = math.cos(yaw) * px - math.sin(yaw) * py
        across = math.sin(yaw) * px + math.cos(yaw) * py
        col = math.floor((x + scale_x * along) / resolution_m)
        row = math.floor((y + scale_y * across) / resolution_m)
        entry = len(table) - 1
        if 0 <= row < field.shape[0] and 0 <= col < field.shape[1]:
            in_world_m = float(field[row, col]) / mean_scale
            entry = min(math.floor(in_world_m * entries_per_m + 0.5), len(table) - 1)
        total += float(table[entry])
    return total
