"""The settings of `ispace-mcl`."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from gridslam.config.base import StrictModel
from gridslam.methods.ispace_mcl.camera_config import CamerasConfig


class ParticleConfig(StrictModel):
    """How many particles, and when they are drawn anew."""

    least: int = Field(1000, ge=10, description="never fewer particles")
    most: int = Field(10_000, ge=10, description="never more particles")
    kld_error: float = Field(0.02, gt=0.0, description="KLD sampling: bound of the Kullback-Leibler distance")
    kld_quantile: float = Field(
        2.33, description="KLD sampling: normal quantile of the bound's probability (2.33: 99 %)"
    )
    bin_m: float = Field(0.25, gt=0.0, description="KLD sampling: bin of position, m")
    bin_rad: float = Field(0.175, gt=0.0, description="KLD sampling: bin of heading, rad")
    resample_below: float = Field(
        0.5, gt=0.0, le=1.0, description="resample when N_eff falls below this share"
    )


class MotionConfig(StrictModel):
    """Noise of the odometry: variances per squared motion (Thrun et al. 2005, table 5.6), and slipping wheels."""

    alpha1: float = Field(0.1, ge=0.0, description="turning noise by turning")
    alpha2: float = Field(0.01, ge=0.0, description="turning noise by driving, rad^2/m^2")
    alpha3: float = Field(0.03, ge=0.0, description="driving noise by driving")
    alpha4: float = Field(0.005, ge=0.0, description="driving noise by turning, m^2/rad^2")
    wild_share: float = Field(
        0.05, ge=0.0, le=1.0, description="share of particles that move with much more noise"
    )
    wild_factor: float = Field(3.0, ge=1.0, description="how much more, as a factor of the deviation")
    max_speed_mps: float = Field(5.0, gt=0.0, description="odometry that moves faster has jumped")
    max_turn_radps: float = Field(10.0, gt=0.0, description="odometry that turns faster has jumped")
    jump_m: float = Field(0.5, gt=0.0, description="jumps shorter than this are let pass")
    jump_rad: float = Field(0.5, gt=0.0, description="turns smaller than this are let pass")


class DepthRangesConfig(StrictModel):
    """In a log without a lidar, ranges are made of the depth images of a camera on the robot."""

    low_m: float = Field(0.1, description="lower end of the height band in which walls are looked for")
    high_m: float = Field(1.0, gt=0.0, description="its upper end")
    reach_m: float = Field(5.0, gt=0.0, description="depths beyond this are too coarse: no return")
    wait_s: float = Field(
        2.0, ge=0.0, description="a lidar that says nothing for this long at the beginning is not there"
    )


class ScanConfig(StrictModel):
    """Which readings of a scan are used."""

    beams: int = Field(
        60, ge=3, description="most beams that weigh the particles, spread evenly over the scan"
    )
    min_range_m: float = Field(0.1, ge=0.0, description="shorter readings are the robot itself")
    max_range_m: float = Field(
        30.0, gt=0.0, description="longer readings count as no return, whatever the log's range_max"
    )
    depth: DepthRangesConfig = DepthRangesConfig()


class LikelihoodFieldConfig(StrictModel):
    """End points are likely near walls; quick and smooth."""

    kind: Literal["likelihood-field"] = "likelihood-field"
    sigma_m: float = Field(0.15, gt=0.0, description="standard deviation of an end point about a wall")
    random_share: float = Field(
        0.1, gt=0.0, lt=1.0, description="share of beams that anything may have caused: people"
    )
    beam_weight: float = Field(
        0.15, gt=0.0, le=1.0, description="power of a beam's likelihood: neighbouring beams err together"
    )
    moving_radius_m: float = Field(
        0.3, ge=0.0, description="a beam that ends nearer to what fixed cameras see moving is half explained"
    )


class BeamConfig(StrictModel):
    """Ray casting with the four-part mixture of Thrun et al. 2005, table 6.1."""

    kind: Literal["beam"] = "beam"
    sigma_m: float = Field(0.3, gt=0.0, description="standard deviation of a range about the expected one")
    hit: float = Field(0.65, ge=0.0, description="weight of the wall")
    short: float = Field(0.1, ge=0.0, description="weight of something before the wall")
    max: float = Field(0.05, ge=0.0, description="weight of no return")
    random: float = Field(0.2, gt=0.0, description="weight of anything")
    short_decay_per_m: float = Field(
        0.2, gt=0.0, description="how quickly short readings get rarer with range, 1/m"
    )
    bin_m: float = Field(0.05, gt=0.0, description="bin of the tabulated model")
    beam_weight: float = Field(0.05, gt=0.0, le=1.0, description="power of a beam's likelihood")


class RangeDifferenceConfig(StrictModel):
    """The paper's weight (eqs. 3, 4): a Gaussian of the mean squared difference of ranges."""

    kind: Literal["range-difference"] = "range-difference"
    sigma_m: float = Field(0.5, gt=0.0, description="standard deviation of the root mean squared difference")


WeightConfig = Annotated[
    LikelihoodFieldConfig | BeamConfig | RangeDifferenceConfig, Field(discriminator="kind")
]


class UpdateConfig(StrictModel):
    """When a scan weighs the particles."""

    min_travel_m: float = Field(0.2, ge=0.0, description="after this much travel since the last update")
    min_turn_rad: float = Field(0.15, ge=0.0, description="or after this much turning")
    standing: int = Field(3, ge=0, description="or without motion, so often in a row")


class SearchConfig(StrictModel):
    """The search of the whole map for where the last scans could have been seen from."""

    enabled: bool = Field(
        True, description="off: a start without pose is uniform over free space, and a lost robot stays lost"
    )
    spacing_m: float = Field(0.3, gt=0.0, description="distance between the places tried")
    headings: int = Field(120, ge=8, description="number of headings tried")
    sigma_m: float = Field(0.3, gt=0.0, description="width of the likelihood in the coarse search")
    points: int = Field(64, ge=8, description="points of the scans used in the coarse search")
    most_poses: int = Field(
        3_000_000, ge=1000, description="on large maps the spacing grows to keep below this"
    )
    refined: int = Field(3000, ge=10, description="poses that are refined")
    hypotheses: int = Field(1000, ge=1, description="of these, the most that are weighed by lines of sight")
    finalists: int = Field(60, ge=1, description="of these, the most that compete with the tracked pose")
    match_sigma_m: float = Field(
        0.2, gt=0.0, description="standard deviation of the window's points about walls"
    )
    random_share: float = Field(
        0.1, gt=0.0, lt=1.0, description="share of beams that the map does not explain"
    )
    beam_weight: float = Field(0.1, gt=0.0, le=1.0, description="power of a beam's likelihood")
    start_trust: float = Field(3.0, ge=0.0, description="log-odds that a start pose has in its favour")
    trust_per_m: float = Field(
        1.0, ge=0.0, description="log-odds that the tracked pose earns by a metre of travel with a good fit"
    )
    distrust_per_m: float = Field(
        3.0, ge=0.0, description="log-odds that it loses by a metre of travel with a bad fit"
    )
    most_trust: float = Field(6.0, ge=0.0, description="most log-odds that it can have before a contest")
    sure_lead: float = Field(
        2.0, ge=0.0, description="lead of the tracked pose, in log-odds, that leaves no doubt"
    )
    rival_lead: float = Field(
        2.0, ge=0.0, description="lead of a rival, in log-odds, from which particles go there"
    )
    tracked_share: float = Field(0.3, ge=0.0, lt=1.0, description="share of particles that go on as they are")
    window_m: float = Field(4.0, ge=0.0, description="scans of this much travel are searched for together")
    window_points: int = Field(300, ge=10, description="most beams of the window, evenly from its scans")
    window_scans: int = Field(10, ge=1, description="most scans in the window")
    past_scans: int = Field(50, ge=1, description="most scans that a hypothesis is traced back over")
    past_beams: int = Field(30, ge=3, description="most beams of each of these scans")
    most_evidence: float = Field(
        0.8, gt=0.0, description="most log-odds that a scan speaks for one and against another pose"
    )
    carried_odds: float = Field(
        10.0, ge=0.0, description="log-odds against the robot having been carried elsewhere unseen"
    )
    window_step_m: float = Field(0.4, gt=0.0, description="travel between the scans of the window")
    retry_m: float = Field(1.0, gt=0.0, description="travel between searches while lost or uncertain")
    check_m: float = Field(
        4.0, gt=0.0, description="a start pose is checked against the whole map after this much travel"
    )
    recheck_m: float = Field(25.0, gt=0.0, description="travel between checks while localized")


class ConfidenceConfig(StrictModel):
    """What it takes to believe that the robot is where the filter says."""

    tolerance_m: float = Field(
        0.25, gt=0.0, description="a beam that ends nearer to a wall is explained by the map"
    )
    sight_tolerance_m: float = Field(
        0.4, gt=0.0, description="and if no wall is farther than this before its end"
    )
    sight_slack_m: float = Field(
        0.3, ge=0.0, description="a beam that this much aside would be free grazes a wall"
    )
    behind_share: float = Field(
        0.5, ge=0.0, le=1.0, description="how much a beam counts that ends at a wall behind another one"
    )
    open_share: float = Field(
        0.4, ge=0.0, le=1.0, description="how much a beam counts that ends in the open: a person"
    )
    lost_fit: float = Field(
        0.55, ge=0.0, le=1.0, description="share of explained beams below which the robot is lost"
    )
    good_fit: float = Field(0.8, gt=0.0, le=1.0, description="share of explained beams that leaves no doubt")
    spread_m: float = Field(
        0.5, gt=0.0, description="standard deviation of the position that halves the confidence"
    )
    memory: float = Field(0.7, ge=0.0, lt=1.0, description="share of the past in the running mean of the fit")
    cluster_m: float = Field(1.0, gt=0.0, description="particles within this distance are one cluster")
    cluster_rad: float = Field(0.5, gt=0.0, description="and within this angle")
    localized: float = Field(
        0.7, ge=0.0, le=1.0, description="confidence from which the robot counts as localized"
    )
    lost: float = Field(0.3, ge=0.0, le=1.0, description="confidence below which it counts as lost")


class IspaceMclConfig(StrictModel):
    """Monte Carlo localization on a given map, with fixed cameras where the log has any."""

    name: Literal["ispace-mcl"] = "ispace-mcl"
    start: tuple[float, float, float] | None = Field(
        None, description="x (m), y (m), yaw (rad) of the first scan in the map; absent: anywhere"
    )
    start_deviation: tuple[float, float, float] = Field(
        (0.3, 0.3, 0.15), description="standard deviations of the start pose, m, m, rad"
    )
    occupied_from: float = Field(
        0.65, gt=0.0, lt=1.0, description="cells of at least this probability are walls"
    )
    free_below: float = Field(
        0.3, gt=0.0, lt=1.0, description="cells of at most this probability may hold the robot"
    )
    field_reach_m: float = Field(2.0, gt=0.0, description="distances to walls are kept up to here")
    estimate: Literal["cluster", "mean"] = Field(
        "cluster", description="the pose is the mean of the main cluster, or as the paper's of all particles"
    )
    particles: ParticleConfig = ParticleConfig()
    motion: MotionConfig = MotionConfig()
    scan: ScanConfig = ScanConfig()
    weight: WeightConfig = LikelihoodFieldConfig()
    update: UpdateConfig = UpdateConfig()
    search: SearchConfig = SearchConfig()
    confidence: ConfidenceConfig = ConfidenceConfig()
    cameras: CamerasConfig = CamerasConfig()
