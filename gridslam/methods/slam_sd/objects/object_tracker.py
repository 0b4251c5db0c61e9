"""Tagged objects over the whole log: the evidence of a visit is weighted when the visit is over, by slam-sd's eq. 6.

The paper gives every particle of the trajectory its own filters over the objects. Here a filter lives in the frame of the key
scan from which its object was seen. Over the few metres of a visit all particles have the same path (the front end's), so
their filters would be copies of each other. Only the pose of that key scan differs between the particles' maps, and the
object moves with it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.lidar_slam.sessions.object_records import ObjectRecords
from gridslam.methods.slam_sd.objects.absence import log_silence, scans_see_nothing
from gridslam.methods.slam_sd.objects.joint_estimation import LocatedObject, VisitedObject, locate_jointly
from gridslam.methods.slam_sd.objects.landmarks import Reobservation
from gridslam.methods.slam_sd.objects.object_estimation import (
    earlier_estimate,
    estimate_of,
    has_moved,
    is_seen_by_lidar,
    replace_last_estimate,
)
from gridslam.methods.slam_sd.objects.object_filter import (
    LIDAR_WEIGHT,
    READ_WEIGHT,
    ObjectFilter,
    ObjectPosterior,
)
from gridslam.methods.slam_sd.objects.object_history import ObjectEpisode, ObjectHistory
from gridslam.methods.slam_sd.objects.object_model import ObjectModel
from gridslam.methods.slam_sd.objects.object_records import after_earlier_drives
from gridslam.methods.slam_sd.objects.object_settings import ObjectSettings
from gridslam.methods.slam_sd.objects.observations import RunObservations
from gridslam.methods.slam_sd.objects.read_gating import ReadGate
from gridslam.methods.slam_sd.objects.smoothing import (
    episodes_of,
    estimates_of_one_hinge,
    passes_without_read,
)
from gridslam.methods.slam_sd.objects.tag_visits import OpenVisits, TagVisit
from gridslam.methods.slam_sd.objects.visit_evidence import InventoryRound, KeyScanObservation

Floats = NDArray[np.float64]

NEIGHBOUR_NS = 20_000_000_000  # objects read within this time of each other may explain the same beams
SILENCE_RADIUS_M = 3.0  # a tag farther from the robot is not expected to be read
# Log probability of the silent rounds, if the object is still there, below which the scans are examined as well
GONE_LOG_PROBABILITY = -8.0


class ObjectTracker:
    """Keeps the history of each object, from key scans and inventory rounds."""

    def __init__(
        self, models: Sequence[ObjectModel], settings: ObjectSettings, rng: np.random.Generator
    ) -> None:
        self._settings = settings
        self._rng = rng
        self._antenna = settings.antenna
        self._observations = RunObservations()
        self._rounds_checked = 0  # for silence
        self.objects = {model.id: ObjectHistory(model) for model in models}
        self._visits = OpenVisits({tag: model.id for model in models for tag in model.tag_ids})
        self._gate = ReadGate(settings)
        self._recent: dict[str, tuple[int, LocatedObject]] = {}  # last read of the last visit, and its result
        self._reobservations: list[Reobservation] = []
        self._counters: Counter[str] = Counter()

    @property
    def counters(self) -> Counter[str]:
        """Reads and visits that were not used, objects that were located again or are gone."""
        return self._counters + self._visits.counters

    def add_round(self, inventory: InventoryRound) -> None:
        """Add one inventory round, in the front end's frame."""
        self._observations.rounds.append(inventory)
        self._visits.add(inventory)

    def add_scan(self, scan: KeyScanObservation, path: Floats) -> None:
        """Add one key scan; `path` `(k, 3)` is the best particle's so far, including this scan."""
        self._observations.scans.append(scan)
        for name, visit in self._visits.take_ended(scan.stamp_ns).items():
            self._close_visit(self.objects[name], visit, path)
        self._check_silence(path)

    def take_reobservations(self) -> list[Reobservation]:
        """The objects found again since the last call."""
        taken, self._reobservations = self._reobservations, []
        return taken

    def finish(self, path: Floats) -> None:
        """End all visits; doors that were passed without a read are located by the scans of the pass. `path` is `(k, 3)`."""
        if not self._observations.scans:
            return
        for name, visit in self._visits.take_ended(None).items():
            self._close_visit(self.objects[name], visit, path)
        self.update_episodes(path)  # an estimate that is dropped here leaves a pass to be examined
        for history in self.objects.values():
            if history.model.is_door and history.episodes and self._settings.objects.is_joint:
                for visit in passes_without_read(history, self._observations.scans, path):
                    self._locate_without_read(history, visit, path)
        self.update_episodes(path)

    def continue_histories(self, earlier: ObjectRecords, first_key: int, path: Floats) -> None:
        """Put the estimates of earlier drives before those of this one, at the end of the log.

        `path` `(k, 3)` are the poses of the key scans of all drives, of which this one has those from `first_key` on.
        """
        for history in after_earlier_drives(self.objects.values(), earlier, first_key):
            self.objects[history.model.id] = history
        self._separate_episodes(path)

    def update_episodes(self, path: Floats) -> None:
        """Decide again what has moved, for better poses `(k, 3)` of the key scans."""
        for history in self.objects.values():
            history.estimates.sort(key=lambda estimate: estimate.first_ns)
        self._separate_episodes(path)

    def _separate_episodes(self, path: Floats) -> None:
        for history in self.objects.values():
            if history.estimates:
                if history.model.is_door:
                    history.estimates = estimates_of_one_hinge(history.estimates, path)
                differs = partial(has_moved, history.model)
                history.episodes = episodes_of(history.estimates, path, differs)

    def _locate_without_read(self, history: ObjectHistory, visit: TagVisit, path: Floats) -> None:
        """Locate an unread door by scans alone: an open leaf may turn its tag away, but its hinge is known."""
        key = self._observations.key_nearest_to(visit.middle_ns)
        earlier = earlier_estimate(history, self._observations, path, key)
        if earlier is None:
            return
        evidence = self._observations.evidence(history.model, visit, earlier.pose[:2])
        if evidence is None:
            return
        earlier = replace(earlier, is_certain=True)
        visited = VisitedObject(history.model, evidence, earlier)
        object_filter = visited.filter(self._footprints({history.model.id}, path, key), self._settings)
        posterior = object_filter.locate(self._rng)
        if self._is_better_than_before(object_filter, posterior, earlier.pose):
            located = LocatedObject(visited, posterior)
            history.estimates.append(estimate_of(history, visit, located, self._observations))

    def _is_better_than_before(
        self, object_filter: ObjectFilter, posterior: ObjectPosterior, before: Floats
    ) -> bool:
        """Whether the scans clearly prefer the new pose to the one before (3,)."""
        ratio_before = object_filter.log_likelihood_ratio(before)
        gained = LIDAR_WEIGHT * (posterior.gain - min(ratio_before, 0.0))
        return posterior.gain > 0.0 and gained > self._settings.evidence.min_log_likelihood_ratio

    def _close_visit(self, history: ObjectHistory, visit: TagVisit, path: Floats) -> None:
        """Weight the evidence of a visit and add the estimate to the object's history."""
        history.log_silence = 0.0
        model, observations = history.model, self._observations
        earlier = earlier_estimate(history, observations, path, observations.last_key)
        key = observations.key_nearest_to(visit.middle_ns)
        readers = observations.readers(model, visit)
        if not self._gate.accepts(model, visit, key, readers=readers, earlier=earlier, path=path):
            self._counters["tags.false_reads"] += visit.reads
            return
        evidence = observations.evidence(model, visit)
        if evidence is None:
            self._counters["objects.without_scan"] += 1
            return
        visited = VisitedObject(model, evidence, earlier)
        neighbours = self._neighbours(history, visit)
        footprints = self._footprints({model.id, *neighbours}, path, observations.last_key)
        posterior, displaced = locate_jointly(visited, neighbours, footprints, self._settings, self._rng)
        located = LocatedObject(visited, posterior)
        if not is_seen_by_lidar(located, self._settings):
            self._counters["objects.not_in_scan_plane"] += 1
            return
        for name, other in displaced.items():
            self._relocate(name, other)
        self._add_estimate(history, estimate_of(history, visit, located, observations), located)
        self._recent[model.id] = (visit.last_ns, located)

    def _relocate(self, name: str, posterior: ObjectPosterior) -> None:
        """Correct the last estimate of an object that a neighbour has displaced."""
        self._counters["objects.located_again"] += 1
        last_ns, located = self._recent[name]
        self._recent[name] = (last_ns, replace(located, posterior=posterior))
        replace_last_estimate(self.objects[name], self._recent[name][1], self._observations)

    def _footprints(self, excluded: set[str], path: Floats, key: int) -> list[Floats]:
        """Corners `(k, 2)` of all other objects at the time of a key scan, in the front end's frame about it."""
        stamp_ns = self._observations.scans[key].stamp_ns
        T_track_map = self._observations.map_in_track(key, path)
        return [
            other.model.corners_at(se2.compose(T_track_map, episodes[-1].pose_in_map(path)))
            for name, other in self.objects.items()
            if name not in excluded and (episodes := other.at(stamp_ns))
        ]

    def _neighbours(self, history: ObjectHistory, visit: TagVisit) -> dict[str, LocatedObject]:
        """Objects visited shortly before, whose evidence can be weighted again."""
        since = visit.first_ns - NEIGHBOUR_NS
        return {
            name: located
            for name, (last_ns, located) in self._recent.items()
            if name != history.model.id and last_ns > since and self.objects[name].present is not None
        }

    def _add_estimate(self, history: ObjectHistory, estimate: ObjectEpisode, located: LocatedObject) -> None:
        """Extend the present episode, or begin another one if the object has moved."""
        history.estimates.append(estimate)
        earlier, pose = located.visited.earlier, located.posterior.pose
        if history.present is None or earlier is None or has_moved(history.model, earlier.pose, pose):
            history.episodes.append(estimate)
        else:
            before = history.episodes[-1]
            self._reobservations.append(Reobservation(before, estimate, history.model.is_door))
            reads = before.reads + estimate.reads
            history.episodes[-1] = replace(estimate, first_ns=before.first_ns, reads=reads)

    def _check_silence(self, path: Floats) -> None:
        """Boxes that the reader should have read and did not, and that the lidar does not see either, are gone.

        A silent antenna is information as well. But a tag may be defective, so the scans decide.
        """
        rounds = self._observations.rounds[self._rounds_checked :]
        self._rounds_checked = len(self._observations.rounds)
        if not rounds:
            return
        scan = self._observations.scans[-1]
        T_track_map = self._observations.map_in_track(self._observations.last_key, path)
        for name, history in self.objects.items():
            episode = history.present
            if episode is None or history.model.is_door or name in self._visits:
                continue
            pose = se2.compose(T_track_map, episode.pose_in_map(path))
            if float(np.hypot(*(pose - scan.pose)[:2])) > SILENCE_RADIUS_M:
                history.log_silence = 0.0
                continue
            silence = log_silence(history.model, pose, rounds, scan, self._antenna)
            history.log_silence += READ_WEIGHT * silence
            if history.log_silence < GONE_LOG_PROBABILITY:
                history.log_silence = 0.0
                self._check_scans(history, pose)

    def _check_scans(self, history: ObjectHistory, pose: Floats) -> None:
        """Mark an object as gone if the last scans do not see it at its pose (3,) in the front end's frame."""
        scans, rounds = self._observations.scans, self._observations.rounds
        if scans_see_nothing(history.model, pose, scans, rounds, self._settings):
            gone_ns = scans[-1].stamp_ns
            history.episodes[-1] = replace(history.episodes[-1], gone_ns=gone_ns)
            history.estimates[-1] = replace(history.estimates[-1], gone_ns=gone_ns)
            self._counters["objects.gone"] += 1
