"""The settings of lidar SLAM without a filter: scans, odometry, front end, map and final stage."""

from __future__ import annotations

from pydantic import Field

from gridslam.config.base import StrictModel


class ScanConfig(StrictModel):
    """Which readings of a scan are used, and how many of them."""

    min_range_m: float = Field(0.05, ge=0.0, description="shorter readings are skipped")
    max_range_m: float = Field(
        40.0, gt=0.0, description="longer readings are skipped, whatever the log's range_max"
    )
    spacing_m: float = Field(
        0.03, ge=0.0, description="least distance between neighbouring points used for matching"
    )
    max_points: int = Field(360, ge=20, description="most points of a scan used by the front end")
    max_chord_m: float = Field(
        2.0, ge=0.0, description="neighbouring points of one flat surface are joined up to here"
    )
    chord_spacing_m: float = Field(0.1, gt=0.0, description="spacing of the points put in between")


class FrontEndConfig(StrictModel):
    """Matching of every scan against a local map of the last key scans."""

    resolution_m: float = Field(0.2, gt=0.0, description="cell of the local surface map")
    key_scans: int = Field(30, ge=2, description="a local map is matched against after this many key scans")
    sigma_m: float = Field(0.05, gt=0.0, description="scale of the robust loss on point-to-line distances")
    reach_m: float = Field(0.4, gt=0.0, description="farthest correspondence in the first iteration")
    final_reach_m: float = Field(0.1, gt=0.0, description="farthest correspondence in the last iterations")
    iterations: int = Field(12, ge=1, description="most Gauss-Newton iterations")
    yaw_step_rad: float = Field(
        0.02, gt=0.0, description="step of the search for the heading where odometry leaves it open"
    )
    yaw_points: int = Field(120, ge=20, description="most points used in that search")
    least_fit: float = Field(
        0.55, ge=0.0, le=1.0, description="share of points on surfaces below which it looks around"
    )
    look_around_m: float = Field(0.3, gt=0.0, description="how far along the way it looks then")
    look_around_rad: float = Field(0.5, gt=0.0, description="and how far in heading")
    better_fit: float = Field(0.2, ge=0.0, description="a pose found that way must fit by so much better")
    found_fit: float = Field(0.5, ge=0.0, le=1.0, description="and so well at least")
    min_points: int = Field(20, ge=3, description="with fewer correspondences the odometry stands")


class OdometryConfig(StrictModel):
    """Standard deviations of the odometry over one step, as floors and shares of the motion."""

    translation_floor_m: float = Field(0.01, gt=0.0)
    translation_per_m: float = Field(0.2, ge=0.0)
    translation_per_rad_m: float = Field(0.02, ge=0.0)
    rotation_floor_rad: float = Field(0.005, gt=0.0)
    rotation_per_rad: float = Field(0.5, ge=0.0)
    rotation_per_m_rad: float = Field(0.1, ge=0.0)
    surprise_share: float = Field(
        0.3, ge=0.0, description="share of an unexpected change of the step that adds to both"
    )
    max_speed_mps: float = Field(5.0, gt=0.0, description="odometry that goes faster has jumped")
    max_turn_radps: float = Field(10.0, gt=0.0, description="odometry that turns faster has jumped")
    jump_tolerance_m: float = Field(
        0.5, ge=0.0, description="beyond the speed limit, for stamps that are not exact"
    )
    jump_tolerance_rad: float = Field(0.5, ge=0.0)
    jump_deviation_m: float = Field(0.3, gt=0.0, description="standard deviation of the motion during a jump")
    jump_deviation_rad: float = Field(0.3, gt=0.0)


class MapConfig(StrictModel):
    """Log-odds of the grid maps."""

    resolution_m: float = Field(
        0.05, gt=0.0, description="cell of the map; the final stage may set another for its own"
    )
    hit: float = Field(0.9, gt=0.0, description="log-odds that an end point adds to its cell")
    miss: float = Field(-0.4, lt=0.0, description="log-odds that a crossing beam adds to a cell")
    limit: float = Field(6.0, gt=0.0, description="log-odds are held within +-limit")


class FinalStageConfig(StrictModel):
    """Loop closures and pose graph over the whole trajectory, after the last scan."""

    enabled: bool = Field(True, description="whether the trajectory of the filter is refined")
    submap_key_scans: int = Field(
        30, ge=4, description="key scans in a submap; neighbours share half of them"
    )
    max_points: int = Field(120, ge=20, description="most points of a key scan used for matching")
    stride: int = Field(4, ge=1, description="every so many key scans one is searched for in far submaps")
    search_radius_m: float = Field(
        8.0, gt=0.0, description="loops are looked for between poses nearer than this"
    )
    window_m: float = Field(3.0, gt=0.0, description="half width of the search window of a loop")
    window_rad: float = Field(0.2, gt=0.0, description="half angle of the search window of a loop")
    searches: int = Field(
        3, ge=1, description="loops are searched for again, so often at most, while poses move"
    )
    search_again_m: float = Field(1.5, gt=0.0, description="by more than this")
    field_resolution_m: float = Field(0.1, gt=0.0, description="cell of the field that the search uses")
    least_score: float = Field(
        0.6, gt=0.0, lt=1.0, description="mean likelihood of a loop's correlative match"
    )
    least_fit: float = Field(
        0.6, gt=0.0, lt=1.0, description="share of a scan's points that must lie on a submap"
    )
    information_share: float = Field(
        0.03, gt=0.0, le=1.0, description="share of a match's information that counts"
    )
    odometry_share: float = Field(1.0, gt=0.0, description="weight of the front end's steps")
    robust_scale: float = Field(5.0, gt=0.0, description="scale of the robust kernel in standard deviations")
    rounds: int = Field(3, ge=1, description="scans are registered anew so often at most, while poses move")
    resolution_m: float | None = Field(
        None, gt=0.0, description="cell of the rebuilt map; absent: map.resolution_m"
    )
