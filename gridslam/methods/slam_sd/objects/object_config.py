"""The section `objects` of slam-sd: tagged objects that are moved now and then."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from gridslam.config.base import StrictModel
from gridslam.maps.tag_database import TagDatabase


class AntennaConfig(StrictModel):
    """The RFID reader's antenna."""

    range_m: float = Field(
        2.0,
        gt=0.0,
        le=20.0,
        description="Distance in metres at which a tag on the antenna's axis that faces it is read half as often as nearby. "
        "Raise it for a stronger antenna: objects are then looked for farther away.",
    )


class ObjectsConfig(StrictModel):
    """Poses of tagged objects."""

    database: TagDatabase | None = Field(
        None,
        description="The tag database itself, instead of the file given with --tags: the tagged objects of the place.",
    )
    estimation: Literal["joint", "paper"] = Field(
        "joint",
        description="How objects are estimated. joint: those that explain the same beams together, doors hinge in "
        "walls, and doors that were passed unread are looked for at the end. paper: each object on its own, "
        "its first poses drawn uniformly over the antenna's detection area.",
    )
    particles: int = Field(
        1000,
        ge=50,
        le=100_000,
        description="Number of poses in the filter of an object. Raise it for long-range antennas; it costs time.",
    )
    min_reads: int = Field(
        2,
        ge=1,
        description="Number of reads of an object in one visit from which they are believed; fewer may be false reads. Raise "
        "it where false reads come in bursts.",
    )
    antenna: AntennaConfig = AntennaConfig()

    @property
    def is_joint(self) -> bool:
        """Whether objects are estimated jointly, with walls as prior, and again at the end of the log."""
        return self.estimation == "joint"


class ObjectEvidenceConfig(StrictModel):
    """Likelihoods of reads and scans, given an object."""

    antenna_softness: float = Field(
        0.12,
        gt=0.0,
        description="Width of the edge of the antenna's range, as a fraction of the range. Raise it for a gradual edge.",
    )
    detection_probability: float = Field(
        0.93,
        gt=0.0,
        lt=1.0,
        description="Probability of a read well within the antenna's range. Lower it for a reader that misses tags: a "
        "round without a read then says less.",
    )
    false_read_probability: float = Field(
        0.003,
        gt=0.0,
        lt=0.5,
        description="Probability of a read from outside the antenna's range. Raise it for a reader with many false "
        "reads.",
    )
    min_log_likelihood_ratio: float = Field(
        10.0,
        ge=0.0,
        description="Smallest log likelihood ratio of the scans with and without an object at which it enters the map. "
        "Raise it if objects appear where there are none.",
    )
    move_probability: float = Field(
        0.02,
        gt=0.0,
        lt=1.0,
        description="Probability that an object is moved between two visits. Raise it where things move often.",
    )
    footprint_margin_m: float = Field(
        0.06,
        gt=0.0,
        description="Distance in metres from a footprint up to which endpoints belong to the object. Raise it for "
        "footprints that are known less exactly.",
    )
