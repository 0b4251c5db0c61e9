"""All measures of a result as a nested document; gates name a measure by its dotted key, such as `ape.trans.rmse`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from gridslam.core.errors import InputError
from gridslam.core.stamps import format_stamp
from gridslam.core.trajectory import Trajectory
from gridslam.evaluation.alignment import Align, Alignment, find_alignment
from gridslam.evaluation.association import (
    DEFAULT_MAX_DIFFERENCE_NS,
    DEFAULT_MAX_GAP_NS,
    Pairs,
    Sync,
    associate,
)
from gridslam.evaluation.kitti_errors import kitti_errors
from gridslam.evaluation.localization import judge_localization
from gridslam.evaluation.map_errors import intersection_over_union, log_loss, wall_distances
from gridslam.evaluation.map_registration import MapRegistration, register_maps
from gridslam.evaluation.object_errors import MapObject, object_errors
from gridslam.evaluation.pose_errors import Delta, PoseErrors, absolute_errors, relative_errors
from gridslam.evaluation.readers.pose_series import PoseSeries
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
"""First part of a key -> what these measures need."""


@dataclass(frozen=True, slots=True)
class Result:
    """The result to evaluate; a part that is None is not evaluated."""

    trajectory: Trajectory | None = None
    occupancy: OccupancyGrid | None = None
    probability: OccupancyGrid | None = None
    objects: Mapping[str, MapObject] | None = None
    series: PoseSeries | None = None  # the trajectory as its file states it, for remarks
    consistency: Mapping[str, float | bool] | None = None  # what the run says of its own map


@dataclass(frozen=True, slots=True)
class Truth:
    """The ground truth; a measure without ground truth is left out."""

    trajectory: Trajectory | None = None
    relations: Relations | None = None
    occupancy: OccupancyGrid | None = None
    objects: Mapping[str, MapObject] | None = None
    series: PoseSeries | None = None  # the trajectory as its file states it, for remarks


@dataclass(frozen=True, slots=True)
class EvaluationOptions:
    """Options of an evaluation: alignment, pairing of poses, length of relative motions, bounds of success."""

    align: Align = "none"
    with_scale: bool = False
    sync: Sync = "nearest"
    max_difference_ns: int | None = None  # None: 10 ms for `nearest`, no bound for `interpolate`
    max_gap_ns: int = DEFAULT_MAX_GAP_NS  # between the poses that `interpolate` takes
    time_offset_ns: int = 0  # added to the stamps of the estimate
    delta: Delta = field(default_factory=Delta)
    completeness_radius_m: float | None = (
        None  # true walls farther from every known cell do not count; None: all count
    )
    max_position_m: float = 0.5  # bound for a successful localization and a correct object
    max_heading_deg: float = 10.0

    @property
    def nearness(self) -> str:
        """Condition on the stamps of paired poses, as the end of a sentence."""
        if self.sync == "interpolate" and self.max_difference_ns is None:
            return f"between poses of the other at most {self.max_gap_ns / 1e9:g} s apart"
        largest = DEFAULT_MAX_DIFFERENCE_NS if self.max_difference_ns is None else self.max_difference_ns
        return f"within {largest / 1e9:g} s of each other"

    @property
    def nearness_option(self) -> str:
        """The command-line option that sets the bound of `nearness`."""
        is_gap = self.sync == "interpolate" and self.max_difference_ns is None
        return "--max-gap" if is_gap else "--max-difference"


def evaluate(result: Result, truth: Truth, options: EvaluationOptions) -> Document:
    """All measures for which both result and ground truth are given, as a nested document.

    Map and objects are in the frame of the trajectory, so its alignment is applied to them too. Without a true trajectory a
    map is aligned by registration of its walls where `options.align` is `se2`.
    Raises InputError: the trajectories have no stamps in common, or cannot be aligned.
    """
    document: Document = {}
    alignment = Alignment(np.zeros(3))
    if result.trajectory is not None and truth.trajectory is not None:
        pairs, alignment = _align(result.trajectory, truth.trajectory, options)
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
    """The registration of the maps, if nothing else relates their frames and an alignment is wanted."""
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


def _align(estimate: Trajectory, truth: Trajectory, options: EvaluationOptions) -> tuple[Pairs, Alignment]:
    pairs = pairs_of(estimate, truth, options)
    if not len(pairs):
        raise InputError(
            f"estimate ({_span(estimate)}) and truth ({_span(truth)}) have no stamps {options.nearness}; "
            f"a larger {options.nearness_option} pairs more"
        )
    alignment = find_alignment(pairs.estimate, pairs.truth, options.align, options.with_scale)
    if alignment is None:
        raise InputError(
            f"the {len(pairs)} paired positions do not determine an alignment (no motion, or none in common); "
            "use --align origin or --align none"
        )
    return pairs, alignment


def pairs_of(estimate: Trajectory, truth: Trajectory, options: EvaluationOptions) -> Pairs:
    """The paired poses, not aligned, after the estimate's stamps were shifted by the time offset."""
    shifted = Trajectory(estimate.stamps_ns + options.time_offset_ns, estimate.poses)
    return associate(
        shifted.sorted(), truth.sorted(), options.sync, options.max_difference_ns, options.max_gap_ns
    )


def aligned_pairs(estimate: Trajectory, truth: Trajectory, options: EvaluationOptions) -> Pairs:
    """The paired poses, the estimate's aligned with the ground truth. Raises InputError as `evaluate`."""
    pairs, alignment = _align(estimate, truth, options)
    return Pairs(pairs.stamps_ns, alignment.apply(pairs.estimate), pairs.truth)


def _span(trajectory: Trajectory) -> str:
    first, last = int(trajectory.stamps_ns.min()), int(trajectory.stamps_ns.max())
    return f"{len(trajectory)} poses, {format_stamp(first)} to {format_stamp(last)} s"


def _trajectory_measures(
    estimate: Trajectory, truth: Trajectory, pairs: Pairs, alignment: Alignment, options: EvaluationOptions
) -> Document:
    aligned = Pairs(pairs.stamps_ns, alignment.apply(pairs.estimate), pairs.truth)
    errors = absolute_errors(aligned.estimate, aligned.truth)
    x, y, yaw = alignment.T_truth_estimate.tolist()
    relative = relative_errors(aligned, options.delta)
    document: Document = {
        "ape": {
            **_both(errors),
            "count": len(pairs),
            "alignment": {"kind": options.align, "x": x, "y": y, "yaw": yaw, "scale": alignment.scale},
            "estimate": _poses(estimate),
            "truth": _poses(truth),
        },
        "rpe": {
            **_both(relative),
            "count": len(relative.translation_m),
            "delta": options.delta.size,
            "unit": options.delta.unit,
            "all_pairs": options.delta.all_pairs,
        },
        "final": {"trans": float(errors.translation_m[-1]), "rot": float(errors.rotation_deg[-1])},
    }
    if (kitti := kitti_errors(aligned.estimate, aligned.truth)) is not None:
        document["kitti"] = {
            "t_rel": kitti.t_rel_percent,
            "r_rel": kitti.r_rel_deg_per_100m,
            "count": kitti.count,
        }
    if options.align == "none":
        start_ns = int(estimate.stamps_ns.min()) + options.time_offset_ns
        found = judge_localization(
            aligned.stamps_ns, errors, start_ns, options.max_position_m, options.max_heading_deg
        )
        document["localization"] = {
            "success": found.success,
            "time_to_convergence": found.time_to_convergence_s,
        }
    return document


def _both(errors: PoseErrors) -> Document:
    return {"trans": statistics(errors.translation_m), "rot": statistics(errors.rotation_deg)}


def _poses(trajectory: Trajectory) -> Document:
    """Number of poses, and of poses that repeat an earlier stamp and are ignored."""
    return {"poses": len(trajectory), "repeated_stamps": len(trajectory) - len(trajectory.sorted())}


def _relation_measures(trajectory: Trajectory, relations: Relations) -> Document:
    found = relation_errors(trajectory, relations)
    return {
        **_both(found.errors),
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
