"""One line that says how much a run trusted each sensor."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any


def sensor_summary(motion: Mapping[str, Any]) -> str | None:
    """The `motion` measures of a run in a line: the matched scans of each lidar, and the error per scan of each prediction.

    None for a method that does not match lidar scans.
    """
    lidars = motion.get("lidars")
    if not lidars:
        return None
    parts = [
        f"{name or 'lidar'} {100 * one['matched_ratio']:.0f} % of {one['scans']} scans matched"
        for name, one in lidars.items()
    ]
    sources = {
        name: one for name, one in motion.items() if isinstance(one, Mapping) and one.get("predicted_scans")
    }
    total = sum(one["predicted_scans"] for one in sources.values())
    for name, one in sources.items():
        is_corrected = name == "odometry" and motion.get("odometry_check", {}).get("is_corrected")
        off = f"{one['rms_error_m']:.3f} m, {math.degrees(one['rms_error_rad']):.1f} deg"
        parts.append(
            f"{'corrected ' if is_corrected else ''}{name.replace('_', ' ')} predicted "
            f"{100 * one['predicted_scans'] / total:.0f} %, off by {off} a scan"
        )
    return "; ".join(parts)
