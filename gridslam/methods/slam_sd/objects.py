"""Tagged objects over the whole log: each visit's evidence is weighed when the visit is over, by slam-sd's eq. 6.

The paper gives every particle of the trajectory its own filters over the objects. Here a filter lives in the frame of
the key scan from which its object was seen: over the few metres of a visit all particles have the same path (the front
end's), so their filters would be copies; what differs is where that key scan lies in each particle's map, and the object
goes with it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.methods.slam_sd.doors import HINGE_REACH_M, closed_yaw_of
from gridslam.methods.slam_sd.evidence import Evidence, SeenRound, SeenScan, gather
from gridslam.methods.slam_sd.hindsight import hinged_alike, stays_of, unread_passes
from gridslam.methods.slam_sd.neighbours import Candidate, locate_beside
from gridslam.methods.slam_sd.object_config import ObjectsConfig
from gridslam.methods.slam_sd.object_filter import ObjectFilter, Posterior, antenna_model
from gridslam.methods.slam_sd.object_prior import Known
from gridslam.methods.slam_sd.silence import log_silence, sees_nothing
from gridslam.methods.slam_sd.stays import Stay, TrackedObject, turned
from gridslam.methods.slam_sd.things import Thing
from gridslam.methods.slam_sd.visits import Visit, VisitBook

Floats = NDArray[np.float64]

TRAIL_NS = 1_000_000_000  # scans and silent rounds so long after the last read are looked at too
NEIGHBOURS_NS = 20_000_000_000  # objects read within so long of each other may compete for beams
SILENT_FROM_M = 3.0  # from the reader: nothing is expected of a tag farther away
GONE_BELOW = -8.0  # log probability of the silent rounds if the object still stood there


class ObjectTracker:
    """Takes in key scans and inventory rounds, and holds what is known of each object."""

    def __init__(self, things: Sequence[Thing], config: ObjectsConfig, rng: np.random.Generator) -> None:
        self._config = config
        self._rng = rng
        self._model = antenna_model(config.antenna)
        self._scans: list[SeenScan] = []
        self._rounds: list[SeenRound] = []
        self._silent_from = 0
        self.objects = {thing.id: TrackedObject(thing) for thing in things}
        self._book = VisitBook({tag: t.id for t in things for tag in t.tag_ids}, config.pause_s)
        self._recent: dict[str, tuple[int, Candidate]] = {}  # last read of the last visit, and its evidence
        self._doubted: dict[str, list[tuple[int, int]]] = {}  # key scans at doubtful visits, and their reads
        # an earlier estimate, the new one, whether it is a door
        self.found_again: list[tuple[Stay, Stay, bool]] = []
        self.counters: Counter[str] = Counter()

    @property
    def all_counters(self) -> Counter[str]:
        """Also those of the reads."""
        return self.counters + self._book.counters

    def add_round(self, seen: SeenRound) -> None:
        """Take in one inventory round, in the front end's frame."""
        self._rounds.append(seen)
        self._book.add(seen)

    def add_scan(self, seen: SeenScan, path: Floats) -> None:
        """Take in one key scan; `path` `(k, 3)` is that of the best particle so far, this scan's pose included."""
        self._scans.append(seen)
        for name, visit in self._book.take_ended(seen.stamp_ns).items():
            self._close(self.objects[name], visit, path)
        self._listen_to_silence(path)

    def finish(self, path: Floats) -> None:
        """The log is over, and with it all visits; doors are looked at again where they were passed without being read."""
        if not self._scans:
            return
        for name, visit in self._book.take_ended(None).items():
            self._close(self.objects[name], visit, path)
        self.settle(path)  # what is dropped here leaves a pass to be looked at again
        for found in self.objects.values():
            if found.thing.is_door and found.stays and self._config.look_back:
                for visit in unread_passes(found, self._scans, path):
                    self._look_back(found, visit, path)
        self.settle(path)

    def settle(self, path: Floats) -> None:
        """Decide anew what has moved, with better poses `(k, 3)` of the key scans than those of the moment."""
        for found in self.objects.values():
            if found.seen:
                found.seen.sort(key=lambda stay: stay.first_ns)
                if found.thing.is_door:
                    found.seen = hinged_alike(found.seen, path)
                found.stays = stays_of(found.seen, path, partial(self._differs, found.thing))

    def _look_back(self, found: TrackedObject, visit: Visit, path: Floats) -> None:
        """A leaf that stands open may turn its tag away; but its hinge is known, and the scans show how it stood."""
        key = self._key_amid(visit)
        known = self._known(found, path, key)
        evidence = self._evidence(found.thing, visit, None if known is None else known.pose[:2])
        if known is None or evidence is None:
            return
        known = replace(known, is_firm=True)
        others = self._outlines({found.thing.id}, path, key)
        poses = ObjectFilter(found.thing, evidence.explained_by(others), known, self._config)
        posterior = poses.locate(self._rng)
        gained = self._config.lidar_share * (posterior.gain - min(poses.judge(known.pose), 0.0))
        if posterior.gain > 0.0 and gained > self._config.least_gain:
            found.seen.append(self._stay(found, visit, posterior, evidence, known))

    def _close(self, found: TrackedObject, visit: Visit, path: Floats) -> None:
        """Weigh a visit's evidence and take the outcome into the object's record."""
        found.silence = 0.0
        known = self._known(found, path, len(self._scans) - 1)
        if self._is_doubtful(found, visit, known, path):
            self.counters["tags.stray_reads"] += visit.reads
            return
        evidence = self._evidence(found.thing, visit)
        if evidence is None:
            self.counters["objects.without_scan"] += 1
            return
        neighbours = self._neighbours(found, visit)
        standing = self._outlines({found.thing.id, *neighbours}, path, len(self._scans) - 1)
        posterior, moved = locate_beside(
            found.thing, evidence, known, neighbours, standing, self._config, self._rng
        )
        if not self._is_there(found.thing, posterior, evidence):
            self.counters["objects.not_in_scan_plane"] += 1
            return
        for name, other in moved.items():
            self._locate_again(self.objects[name], other)
        self._record(found, self._stay(found, visit, posterior, evidence, known), posterior, known)
        self._recent[found.thing.id] = (visit.last_ns, Candidate(found.thing, evidence, known, posterior))

    def _is_doubtful(self, found: TrackedObject, visit: Visit, known: Known | None, path: Floats) -> bool:
        """Whether the reads of a visit are taken as stray: too few, and not where the object was or was read before."""
        if visit.reads >= self._config.least_reads or self._is_near(found.thing, visit, known):
            return False
        places = self._doubted.setdefault(found.thing.id, [])
        here = self._key_amid(visit)
        reach = 2.0 * self._config.antenna.range_m
        before = sum(reads for key, reads in places if float(np.hypot(*(path[key] - path[here])[:2])) < reach)
        places.append((here, visit.reads))
        return before + visit.reads < self._config.least_reads

    def _is_near(self, thing: Thing, visit: Visit, known: Known | None) -> bool:
        """Whether the reads came from where the tag was known to be: then they are not stray, however few."""
        if known is None:
            return False
        readers = self._readers(thing, visit.first_ns, visit.last_ns)
        place = se2.compose(known.pose, np.array([*thing.centre, 0.0]))[:2]
        reach = self._config.antenna.range_m + thing.radius_m
        return bool(len(readers)) and float(np.hypot(*(readers - place).T).max()) < reach

    def _key_amid(self, visit: Visit) -> int:
        """The key scan in the middle of a visit."""
        middle_ns = (visit.first_ns + visit.last_ns) // 2
        return min(range(len(self._scans)), key=lambda i: abs(self._scans[i].stamp_ns - middle_ns))

    def _readers(self, thing: Thing, begin_ns: int, end_ns: int) -> Floats:
        """Where the antennas were `(r, 2)` that read one of its tags."""
        found = [
            seen.antenna[:2]
            for seen in self._rounds
            if begin_ns <= seen.stamp_ns <= end_ns and any(tag in seen.tag_ids for tag in thing.tag_ids)
        ]
        return np.array(found).reshape(-1, 2)

    def _evidence(self, thing: Thing, visit: Visit, centre: Floats | None = None) -> Evidence | None:
        """The scans from somewhat before the first read to somewhat after the last one, and the rounds meanwhile.

        `centre` (2,) is where about the object is; if not given, where the tag was read from.
        """
        begin = visit.first_ns - round(1e9 * self._config.lead_s)
        end = visit.last_ns + TRAIL_NS
        scans = [seen for seen in self._scans if begin <= seen.stamp_ns <= end] or self._scans[-1:]
        rounds = [seen for seen in self._rounds if begin <= seen.stamp_ns <= end]
        if not sum(len(seen.scan.returns) for seen in scans):
            return None
        if centre is None:
            centre = self._readers(thing, visit.first_ns, visit.last_ns).mean(axis=0)
        return gather(thing, scans, rounds, centre, self._config)

    def _known(self, found: TrackedObject, path: Floats, at_key: int) -> Known | None:
        """Where it was, in the front end's frame about a key scan; less certain by what the map may be off."""
        config = self._config
        T_track_map = se2.compose(self._scans[at_key].pose, se2.inverse(path[at_key]))
        if not found.stays:
            if found.thing.closed_pose is None:
                return None
            pose = se2.compose(T_track_map, found.thing.closed_pose)
            covariance = np.zeros((3, 3))
        else:
            stay = found.stays[-1]
            pose = se2.compose(T_track_map, stay.placed(path))
            covariance = turned(stay.covariance, float(T_track_map[2] + path[stay.anchor, 2]))
        slack = [config.revisit_sigma_m, config.revisit_sigma_m, config.revisit_sigma_rad]
        return Known(pose, covariance + np.diag(np.square(slack)))

    def _locate_again(self, found: TrackedObject, posterior: Posterior) -> None:
        """A neighbour has made an object give way: its last estimate is put right."""
        self.counters["objects.located_again"] += 1
        last_ns, candidate = self._recent[found.thing.id]
        self._recent[found.thing.id] = (last_ns, replace(candidate, posterior=posterior))
        stay, seen = found.stays[-1], found.seen[-1]
        frame = self._scans[seen.anchor].pose
        closed = None
        if found.thing.is_door:
            before = None if len(found.seen) == 1 else self._known_closed(found, candidate.known)
            closed = closed_yaw_of(posterior.pose, candidate.evidence.walls, before)
        found.seen[-1] = replace(
            seen,
            pose=se2.between(frame, posterior.pose),
            covariance=turned(posterior.covariance, -float(frame[2])),
            gain=posterior.gain,
            closed_yaw=None if closed is None else float(se2.wrap_angle(closed - frame[2])),
        )
        found.stays[-1] = replace(found.seen[-1], first_ns=stay.first_ns, reads=stay.reads)

    def _outlines(self, left_out: set[str], path: Floats, at_key: int) -> list[Floats]:
        """The corners of all other objects where they stood at a key scan, in the front end's frame about it."""
        seen = self._scans[at_key]
        T_track_map = se2.compose(seen.pose, se2.inverse(path[at_key]))
        return [
            other.thing.placed(se2.compose(T_track_map, stays[-1].placed(path)))
            for name, other in self.objects.items()
            if name not in left_out and (stays := other.at(seen.stamp_ns))
        ]

    def _neighbours(self, found: TrackedObject, visit: Visit) -> dict[str, Candidate]:
        """Other objects visited on the same way past, whose evidence can be weighed again."""
        since = visit.first_ns - NEIGHBOURS_NS
        return {
            name: candidate
            for name, (last_ns, candidate) in self._recent.items()
            if name != found.thing.id and last_ns > since and self.objects[name].present is not None
        }

    def _is_there(self, thing: Thing, posterior: Posterior, evidence: Evidence) -> bool:
        """Whether the lidar has seen the object: a tag may be read whose object is above or below the plane of the scan."""
        gain = self._config.lidar_share * posterior.gain
        if thing.is_door and evidence.walls.distances(posterior.pose[None, :2])[0] < HINGE_REACH_M:
            return gain > -self._config.least_gain
        return gain > self._config.least_gain

    def _stay(
        self,
        found: TrackedObject,
        visit: Visit,
        posterior: Posterior,
        evidence: Evidence,
        known: Known | None,
    ) -> Stay:
        """The outcome of a visit, hung on the key scan in its middle."""
        anchor = self._key_amid(visit)
        frame = self._scans[anchor].pose
        closed = None
        if found.thing.is_door:
            closed = closed_yaw_of(posterior.pose, evidence.walls, self._known_closed(found, known))
        return Stay(
            anchor,
            se2.between(frame, posterior.pose),
            turned(posterior.covariance, -float(frame[2])),
            visit.first_ns,
            visit.last_ns,
            visit.reads,
            posterior.gain,
            None if closed is None else float(se2.wrap_angle(closed - frame[2])),
        )

    def _record(self, found: TrackedObject, stay: Stay, posterior: Posterior, known: Known | None) -> None:
        """Extend the present stay, or begin another where the object has moved."""
        found.seen.append(stay)
        if found.present is None or known is None or self._differs(found.thing, known.pose, posterior.pose):
            found.stays.append(stay)
        else:
            before = found.stays[-1]
            self.found_again.append((before, stay, found.thing.is_door))
            found.stays[-1] = replace(stay, first_ns=before.first_ns, reads=before.reads + stay.reads)

    def _known_closed(self, found: TrackedObject, known: Known | None) -> float | None:
        """The heading of the closed leaf, in the front end's frame, as far as it is known from before."""
        if known is None:
            return None
        if found.stays:
            angle = found.stays[-1].door_angle
            return None if angle is None else float(known.pose[2]) - angle
        return float(known.pose[2])

    def _differs(self, thing: Thing, before: Floats, after: Floats) -> bool:
        """Whether an object was moved: a door when it has turned, anything else when it is elsewhere or turned."""
        config = self._config
        change = se2.between(before, after)
        has_turned = abs(float(change[2])) > config.moved_from_rad
        is_elsewhere = float(np.hypot(change[0], change[1])) > config.moved_from_m
        return has_turned or (is_elsewhere and not thing.is_door)

    def _listen_to_silence(self, path: Floats) -> None:
        """Boxes that the reader should have read and did not, where the lidar sees nothing either, are gone.

        A silent antenna is information as well; but a tag may be broken, so the scans decide.
        """
        rounds, self._silent_from = self._rounds[self._silent_from :], len(self._rounds)
        if not rounds:
            return
        seen = self._scans[-1]
        T_track_map = se2.compose(seen.pose, se2.inverse(path[len(self._scans) - 1]))
        for name, found in self.objects.items():
            stay = found.present
            if stay is None or found.thing.is_door or name in self._book.open:
                continue
            pose = se2.compose(T_track_map, stay.placed(path))
            if float(np.hypot(*(pose - seen.pose)[:2])) > SILENT_FROM_M:
                found.silence = 0.0
                continue
            found.silence += self._config.tag_share * log_silence(
                found.thing, pose, rounds, seen, self._model
            )
            if found.silence < GONE_BELOW:
                found.silence = 0.0
                if sees_nothing(found.thing, pose, self._scans, self._rounds, self._config):
                    found.stays[-1] = replace(stay, gone_ns=seen.stamp_ns)
                    found.seen[-1] = replace(found.seen[-1], gone_ns=seen.stamp_ns)
                    self.counters["objects.gone"] += 1
