"""All measures of a result as a nested document. Gates name a measure by its dotted key, such as `ape.trans.rmse`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from gridslam.core.trajectory import Trajectory
from gridslam.evaluation.alignment import Alignment
from gridslam.evaluation.association import Pairs
from gridslam.evaluation.inputs import EvaluationOptions, Result, Truth
from gridslam.evaluation.kitti_errors import kitti_errors
from gridslam.evaluation.localization import judge_localization
from gridslam.evaluation.map_errors import intersection_over_union, log_loss, wall_distances
from gridslam.evaluation.map_registration import MapRegistration, register_maps
from gridslam.evaluation.object_errors import MapObject, object_errors
from gridslam.evaluation.pose_errors import PoseErrors, absolute_errors, relative_errors
from gridslam.evaluation.pose_pairs import aligned_pairs
from gridslam.evaluation.relations import Relations, relation_errors
from gridslam.evaluation.statistics import statistics
from gridslam.maps.occupancy import OccupancyGrid

Document: TypeAlias = dict[str, Any]

NEEDS: Mapping[str, str] = {
    "ape": "a trajectory and --truth",
    "rpe": "a trajectory and --truth",
    "final": "a trajectory and --truth",
    "kitti": "a trajectory and --truth with a path of more than 100 m",
    "localization": "a trajectory, --truth and --align none",
    "relations": "a trajectory and --relations",
    "map": "a run directory with a map, and --truth-map (or a --truth folder with a map)",
    "objects": "a run directory with objects.csv, and --truth-objects (or a --truth folder with objects.csv)",
    "consistency": "a run directory of a method that assesses its map",
    "doors": "a run directory with objects.csv, and --truth-objects (or a --truth folder with objects.csv)",
}
"""First part of a key -> the inputs that its measures need."""


def evaluate(result: Result, truth: Truth, options: EvaluationOptions) -> Document:
    """All measures for which both result and ground truth are given, as a nested document.

    Map and objects are in the frame of the trajectory, so its alignment is applied to them too. If the trajectory cannot be
    compared and `options.align` is `se2`, the map is aligned by registration of its walls.

    Raises InputError: the trajectories have no stamps in common, or cannot be aligned.
    """
    document: Document = {}
    alignment = Alignment(np.zeros(3))
    if result.trajectory is not None and truth.trajectory is not None:
        pairs, alignment = aligned_pairs(result.trajectory, truth.trajectory, options)
        document |= _trajectory_measures(result.trajectory, truth.trajectory, pairs, alignment, options)
    if result.trajectory is not None and truth.relations is not None:
        document["relations"] = _relation_measures(result.trajectory, truth.relations)
    T_truth_map = alignment.T_truth_estimate
    registration = _registration(result, truth, options)
    if registration is not None and registration.is_reliable:
        T_truth_map = registration.T_truth_map
    if result.occupancy is not None and truth.occupancy is not None:
        document["map"] = _map_measures(
            result.occupancy, result.probability, truth.occupancy, T_truth_map, options.completeness_radius_m
        )
        if registration is not None:
            document["map"]["alignment"] = _registration_facts(registration)
    if result.objects is not None and truth.objects is not None:
        document |= _object_measures(result.objects, truth.objects, T_truth_map, options.max_position_m)
    if result.consistency is not None:
        document["consistency"] = dict(result.consistency)
    return document


def _registration(result: Result, truth: Truth, options: EvaluationOptions) -> MapRegistration | None:
    """The registration of the maps, if an alignment is wanted and there are no two trajectories to align."""
    if result.occupancy is None or truth.occupancy is None or options.align != "se2":
        return None
    if result.trajectory is not None and truth.trajectory is not None:
        return None
    return register_maps(result.occupancy, truth.occupancy)


def _registration_facts(registration: MapRegistration) -> Document:
    x, y, yaw = registration.T_truth_map.tolist()
    kind = "registration" if registration.is_reliable else "none"
    facts = {"kind": kind, "x": x, "y": y, "yaw": yaw, "inlier_ratio": registration.inlier_ratio}
    return {**facts, "ambiguous": registration.is_ambiguous}


def without_nan(document: Document) -> Document:
    """The document for JSON, with None for NaN and infinities."""
    return {key: _json_value(value) for key, value in document.items()}


def _json_value(value: Any) -> Any:
    if isinstance(value, dict):
        return without_nan(value)
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _trajectory_measures(
    estimate: Trajectory, truth: Trajectory, pairs: Pairs, alignment: Alignment, options: EvaluationOptions
) -> Document:
    """The measures of a trajectory; `pairs` are aligned."""
    errors = absolute_errors(pairs.estimate, pairs.truth)
    x, y, yaw = alignment.T_truth_estimate.tolist()
    relative = relative_errors(pairs, options.delta)
    document: Document = {
        "ape": {
            **_pose_statistics(errors),
            "count": len(pairs),
            "alignment": {"kind": options.align, "x": x, "y": y, "yaw": yaw, "scale": alignment.scale},
            "estimate": _pose_counts(estimate),
            "truth": _pose_counts(truth),
        },
        "rpe": {
            **_pose_statistics(relative),
            "count": len(relative.translation_m),
            "delta": options.delta.size,
            "unit": options.delta.unit,
            "all_pairs": options.delta.all_pairs,
        },
        "final": {"trans": float(errors.translation_m[-1]), "rot": float(errors.rotation_deg[-1])},
    }
    if (kitti := kitti_errors(pairs.estimate, pairs.truth)) is not None:
        document["kitti"] = {
            "t_rel": kitti.t_rel_percent,
            "r_rel": kitti.r_rel_deg_per_100m,
            "count": kitti.count,
        }
    if options.align == "none":
        start_ns = int(estimate.stamps_ns.min()) + options.time_offset_ns
        found = judge_localization(
            pairs.stamps_ns, errors, start_ns, options.max_position_m, options.max_heading_deg
        )
        document["localization"] = {
            "success": found.success,
            "time_to_convergence": found.time_to_convergence_s,
        }
    return document


def _pose_statistics(errors: PoseErrors) -> Document:
    return {"trans": statistics(errors.translation_m), "rot": statistics(errors.rotation_deg)}


def _pose_counts(trajectory: Trajectory) -> Document:
    """Number of poses, and how many of them are ignored because they repeat an earlier stamp."""
    return {"poses": len(trajectory), "repeated_stamps": len(trajectory) - len(trajectory.sorted())}


def _relation_measures(trajectory: Trajectory, relations: Relations) -> Document:
    found = relation_errors(trajectory, relations)
    return {
        **_pose_statistics(found.errors),
        "count": len(found.errors.translation_m),
        "missed": found.missed,
    }


def _map_measures(
    built: OccupancyGrid,
    probability: OccupancyGrid | None,
    truth: OccupancyGrid,
    T_truth_map: NDArray[np.float64],
    completeness_radius_m: float | None,
) -> Document:
    walls = wall_distances(built, truth, T_truth_map, completeness_radius_m)
    document: Document = {
        "accuracy": _distances(walls.accuracy),
        "completeness": _distances(walls.completeness),
        "iou": intersection_over_union(built, truth, T_truth_map),
    }
    if probability is not None:
        document["log_loss"], document["log_loss_cells"] = log_loss(probability, truth, T_truth_map)
    return document


def _distances(values: NDArray[np.float64]) -> Document:
    if not len(values):
        return {**dict.fromkeys(("mean", "var", "max", "p50", "p95"), math.nan), "count": 0}
    p50, p95 = np.percentile(values, (50, 95)).tolist()
    return {
        "mean": float(values.mean()),
        "var": float(values.var()),
        "max": float(values.max()),
        "p50": p50,
        "p95": p95,
        "count": len(values),
    }


def _object_measures(
    found: Mapping[str, MapObject],
    truth: Mapping[str, MapObject],
    T_truth_map: NDArray[np.float64],
    max_position_m: float,
) -> Document:
    errors = object_errors(found, truth, T_truth_map, max_position_m)
    return {
        "objects": {
            "count": errors.count,
            "found": errors.found,
            "correct": errors.correct,
            "extra": errors.extra,
            "position": _mean_and_max(errors.position_m),
            "heading": _mean_and_max(errors.heading_deg),
        },
        "doors": {"count": errors.doors, "state_correct": errors.doors_state_correct},
    }


def _mean_and_max(values: NDArray[np.float64]) -> Document:
    if not len(values):
        return {"mean": math.nan, "max": math.nan}
    return {"mean": float(values.mean()), "max": float(values.max())}
