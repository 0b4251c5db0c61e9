"""Remarks on a map against the true one: how their frames were related, and whether another frame or a mirror image fits."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from gridslam.evaluation.map_registration import INLIER_M, register_maps
from gridslam.maps.occupancy import OccupancyGrid

MIRROR_BELOW = 0.9  # inlier ratio below which the mirror image of a map is tried
MIN_SAME_PLACE = 0.75  # smallest inlier ratio of maps of one place
MIN_MIRROR_GAIN = 0.1  # smallest gain of the inlier ratio by which the mirror image fits better


def map_remarks(built: OccupancyGrid, truth: OccupancyGrid, document: dict[str, Any]) -> Iterator[str]:
    """Remarks on maps whose frames no trajectory relates; `document` has their measures."""
    facts = document["map"].get("alignment")
    if facts is not None:
        yield from _registration_remarks(built, truth, facts)
    elif (document["map"]["accuracy"]["p50"] or 0.0) > INLIER_M:
        found = register_maps(built, truth)
        if found is not None and found.inlier_ratio >= MIN_SAME_PLACE:
            yield (
                f"the maps seem to lie in different frames: moved by {_pose_text(*found.T_truth_map.tolist())}, "
                f"{found.inlier_ratio:.0%} of the mapped walls agree; --align se2 does this"
            )


def _registration_remarks(built: OccupancyGrid, truth: OccupancyGrid, facts: dict[str, Any]) -> Iterator[str]:
    if facts["kind"] == "none":
        yield (
            f"the maps could not be registered: at best {facts['inlier_ratio']:.0%} of the mapped walls are near true walls; "
            "they are compared without alignment. Are they maps of one place?"
        )
    else:
        place = _pose_text(facts["x"], facts["y"], facts["yaw"])
        yield (
            f"no trajectory relates the frames of the maps: they were aligned by registration of their walls ({place}; "
            f"{facts['inlier_ratio']:.0%} of the mapped walls agree)"
        )
        if facts["ambiguous"]:
            yield "the registration is ambiguous: another pose fits as well"
    if facts["inlier_ratio"] < MIRROR_BELOW:
        image = register_maps(OccupancyGrid(built.probability[::-1], built.geometry), truth)
        if image is not None and image.inlier_ratio > facts["inlier_ratio"] + MIN_MIRROR_GAIN:
            yield f"the map is mirrored: with y negated {image.inlier_ratio:.0%} of its walls agree with the true ones"


def _pose_text(x: float, y: float, yaw: float) -> str:
    return f"x {x:.3f} m, y {y:.3f} m, yaw {np.degrees(yaw):.2f} deg"
