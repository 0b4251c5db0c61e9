"""The section `objects` of slam-sd: tagged objects that are moved now and then."""

from __future__ import annotations

from pydantic import Field

from gridslam.config.base import StrictModel
from gridslam.maps.tag_database import TagDatabase


class AntennaConfig(StrictModel):
    """The reader's range (P(I|D)); see `gridslam.sensors.rfid.AntennaModel`."""

    range_m: float = Field(
        2.0, gt=0.0, le=20.0, description="half of the rounds read a tag here, face to face"
    )
    softness: float = Field(0.12, gt=0.0, description="width of the edge of the range, as a share of it")
    detection: float = Field(0.93, gt=0.0, lt=1.0, description="probability of a read well within the range")
    stray: float = Field(0.003, gt=0.0, lt=0.5, description="probability that a tag is read from anywhere")
    hidden_share: float = Field(0.1, ge=0.0, le=1.0, description="share of the reads left behind a wall")
    least_facing: float = Field(0.25, gt=0.0, le=1.0, description="share of the range left behind the tag")


class ObjectsConfig(StrictModel):
    """Filters over the poses of tagged objects."""

    database: TagDatabase | None = Field(None, description="the tag database itself, instead of --tags FILE")
    particles: int = Field(1000, ge=50, le=100_000, description="poses in the filter of an object")
    uniform: bool = Field(
        False, description="draw first poses over the detection area only, as the paper does"
    )
    doors_in_walls: bool = Field(True, description="whether a door's hinge must lie in the plane of a wall")
    joint: bool = Field(True, description="whether objects that dispute beams are located jointly")
    look_back: bool = Field(
        True, description="whether doors that were passed unread are looked for in those scans at the end"
    )
    antenna: AntennaConfig = AntennaConfig()
    least_reads: int = Field(2, ge=1, description="fewer reads of a tag on a visit are taken as stray")
    pause_s: float = Field(
        4.0, gt=0.0, description="without a read for so long, the visit to an object is over"
    )
    lead_s: float = Field(
        3.0, ge=0.0, description="scans from so long before the first read are looked at too"
    )
    most_scans: int = Field(12, ge=1, description="most key scans of a visit that weigh an object's poses")
    most_rounds: int = Field(100, ge=10, description="most inventory rounds of a visit that do")
    sigma_m: float = Field(0.02, gt=0.0, description="standard deviation of an end point about an outline")
    first_sigma_m: float = Field(0.3, gt=0.0, description="and at the first of the narrowing steps")
    narrowing_steps: int = Field(6, ge=1, description="number of those steps")
    random_share: float = Field(
        0.05, gt=0.0, lt=1.0, description="share of readings that no surface explains"
    )
    lidar_share: float = Field(0.3, gt=0.0, le=1.0, description="power of P(L|D): beams are not independent")
    tag_share: float = Field(0.25, gt=0.0, le=1.0, description="power of P(I|D): rounds are not independent")
    least_gain: float = Field(10.0, description="log likelihood ratio below which a box is not in the map")
    hinge_sigma_m: float = Field(0.03, gt=0.0, description="deviation of a hinge from the plane of its wall")
    move_probability: float = Field(0.02, gt=0.0, lt=1.0, description="of a move between two visits")
    moved_from_m: float = Field(0.15, gt=0.0, description="smaller changes are no move")
    moved_from_rad: float = Field(0.2, gt=0.0, description="smaller turns are no move")
    revisit_sigma_m: float = Field(0.08, gt=0.0, description="how far the map may be off on a later visit")
    revisit_sigma_rad: float = Field(0.03, gt=0.0)
    open_from_rad: float = Field(0.17, gt=0.0, description="a door turned less from its wall is closed")
    explained_m: float = Field(
        0.06, gt=0.0, description="end points so near to an outline belong to the object"
    )
