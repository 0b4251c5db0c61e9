"""The settings of `handmap-slam` that only `gridslam explore` uses. Lengths are metres of the world."""

from __future__ import annotations

from pydantic import Field

from gridslam.config.base import StrictModel


class ObservationConfig(StrictModel):
    """Observation points and tour (paper sections 3.1 and 3.2)."""

    range_m: float = Field(6.0, gt=0.0, description="walls farther away do not count as seen")
    candidates: int = Field(500, ge=1, description="places scattered over the free space to choose from")
    wall_distance_m: float = Field(0.6, ge=0.0, description="observation points keep off drawn walls")
    arrival_m: float = Field(0.4, gt=0.0, description="so near to an observation point it is reached")
    seen_share: float = Field(
        0.97,
        gt=0.0,
        le=1.0,
        description="a point need not be visited when so much of its walls was seen before",
    )
    agreement_m: float = Field(
        0.6,
        ge=0.0,
        description="a drawn wall counts as seen if the beam towards it ends no earlier than this",
    )


class PathConfig(StrictModel):
    """The path in the drawing, corrected by what the lidar sees (paper section 4)."""

    cell_m: float = Field(0.1, gt=0.0, le=1.0, description="cell of the planning grid")
    margin_m: float = Field(0.05, ge=0.0, description="kept to obstacles seen, beyond the robot's radius")
    wished_m: float = Field(
        0.7, gt=0.0, description="nearer than this to obstacles and walls a metre costs more"
    )
    dread: float = Field(6.0, ge=0.0, description="how much more beside them")
    period_s: float = Field(0.8, gt=0.0, description="the path is found anew so often")
    sight_m: float = Field(8.0, gt=0.0, description="beams are believed so far")
    memory_m: float = Field(10.0, gt=0.0, description="what was seen from places farther away is forgotten")
    memory_scans: int = Field(60, ge=1, description="most scans remembered")
    memory_step_m: float = Field(0.4, gt=0.0, description="distance between scans remembered")
    joined_m: float = Field(
        0.4, ge=0.0, description="gaps between neighbouring readings up to here are closed"
    )
    look_ahead_m: float = Field(0.8, gt=0.0, description="the robot heads for the path's point so far ahead")


class MotionConfig(StrictModel):
    """The Dynamic Window Approach (paper section 5)."""

    speed_mps: float = Field(0.6, gt=0.0, description="largest speed")
    turn_radps: float = Field(1.2, gt=0.0, description="largest turn rate")
    acceleration_mps2: float = Field(0.6, gt=0.0, description="of a wheel; what the drive can do at most")
    samples: int = Field(11, ge=3, description="speeds tried of each wheel")
    look_s: float = Field(0.7, gt=0.0, description="the heading is judged after this time")
    margin_m: float = Field(0.04, ge=0.0, description="kept to obstacles beyond the robot's radius")
    far_m: float = Field(1.5, gt=0.0, description="an arc free for so long is clear")
    delay_s: float = Field(0.15, ge=0.0, description="between a scan and the motion that follows from it")
    heading: float = Field(1.0, ge=0.0, description="weight of the heading towards the path")
    clearance: float = Field(0.25, ge=0.0, description="weight of the way free on the arc")
    speed: float = Field(0.35, ge=0.0, description="weight of the speed")


class PatienceConfig(StrictModel):
    """When the robot frees itself, and when it gives a point up."""

    stuck_s: float = Field(3.0, gt=0.0, description="standing for so long the robot turns, then backs off")
    back_off_m: float = Field(0.3, gt=0.0, description="how far back")
    blocked_s: float = Field(
        10.0, gt=0.0, description="with every way closed for so long a point is given up"
    )
    progress_s: float = Field(45.0, gt=0.0, description="or when it came no nearer for so long")
    progress_m: float = Field(0.3, gt=0.0, description="what counts as nearer")
    tries: int = Field(2, ge=1, description="a point given up is tried again at the end, so often in all")


class FrontierConfig(StrictModel):
    """What the drawing lacks, looked at when its tour is done (beyond the paper)."""

    enabled: bool = Field(True, description="go on to where free space borders on what was never seen")
    least_m: float = Field(0.2, gt=0.0, description="shorter borders are left alone")
    view_m: float = Field(4.0, gt=0.0, description="they are looked at from no farther away")
    apart_m: float = Field(
        0.2, ge=0.0, description="borders so near to one that was given up are left alone as well"
    )
    patience_s: float = Field(20.0, gt=0.0, description="a view that came no nearer for so long is given up")
    settle_s: float = Field(
        3.0, ge=0.0, description="with nothing left to look at the robot looks on for so long, then ends"
    )
    near_m: float = Field(0.25, gt=0.0, description="so near to its place the robot looks")
    look_s: float = Field(2.0, ge=0.0, description="what it does not see in this time is given up, too")


class ExplorationConfig(StrictModel):
    """All of it."""

    observation: ObservationConfig = ObservationConfig()
    path: PathConfig = PathConfig()
    motion: MotionConfig = MotionConfig()
    patience: PatienceConfig = PatienceConfig()
    frontier: FrontierConfig = FrontierConfig()
