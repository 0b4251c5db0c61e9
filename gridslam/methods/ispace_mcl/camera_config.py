"""The settings of the fixed cameras of `ispace-mcl`."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from gridslam.config.base import StrictModel


class DensityConfig(StrictModel):
    """The paper's product of densities (eqs. 5 - 7): w = eta P_onboard P_iSpace, both Gaussian kernel densities of the plane."""

    kind: Literal["density"] = "density"
    bandwidth_m: float = Field(0.3, gt=0.0, description="standard deviation of the kernel, m")
    onboard: Literal["particles", "kernel"] = Field(
        "particles",
        description="P_onboard as the weighted particles stand for it, or by a kernel density of its own",
    )


class SightingConfig(StrictModel):
    """A robot in view is seen nearly always, people are seen besides, and what no camera sees says nothing.

    The likelihood of a pose relative to that of a robot out of view: 1 - detection + detection N(d) / clutter_per_m2 where it
    would be seen, d being its distance to the nearest thing that moves; 1 where it would not be seen.
    """

    kind: Literal["sightings"] = "sightings"
    bandwidth_m: float = Field(0.3, gt=0.0, description="standard deviation of a sighted place, m")
    radius_m: float = Field(
        0.15, ge=0.0, description="what is nearer than this to a hypothesis may be the robot's own surface"
    )
    detection: float = Field(0.85, gt=0.0, lt=1.0, description="probability that a robot in view is seen")
    clutter_per_m2: float = Field(0.1, gt=0.0, description="people expected per square metre")
    frame_weight: float = Field(
        0.5, gt=0.0, le=1.0, description="power of a frame's likelihood: frames of one moment err together"
    )
    proposal_share: float = Field(
        0.1,
        ge=0.0,
        lt=1.0,
        description="share of particles drawn anew about what moves while the robot is not found",
    )
    sure_mass: float = Field(
        0.8,
        gt=0.0,
        le=1.0,
        description="share of all weight in one place from which the robot counts as found",
    )


EnvironmentWeightConfig = Annotated[DensityConfig | SightingConfig, Field(discriminator="kind")]


class CamerasConfig(StrictModel):
    """RGB-D cameras that hang in the room: their frames' root must be the map's frame."""

    enabled: bool = Field(True, description="off: the onboard sensor alone")
    frame: str = Field("map", min_length=1, description="root of the frames of fixed cameras")
    weight: EnvironmentWeightConfig = SightingConfig()
    history: int = Field(200, ge=2, description="frames that the colour background remembers")
    threshold: float = Field(
        16.0, gt=0.0, description="squared Mahalanobis distance from which a colour is foreground"
    )
    opening_px: int = Field(3, ge=1, description="smaller specks of foreground are removed")
    closing_px: int = Field(5, ge=1, description="smaller holes of it are filled")
    warm_up: int = Field(5, ge=1, description="frames from which only the background is learned")
    low_m: float = Field(0.1, description="foreground below this height is floor")
    high_m: float = Field(2.2, gt=0.0, description="foreground above this height is ignored")
    stride_px: int = Field(2, ge=1, description="every so many-th pixel is projected, in rows and columns")
    most_foreground: float = Field(
        0.4, gt=0.0, le=1.0, description="a larger share of foreground is a light switched on or off"
    )
    depth_check: bool = Field(
        True, description="what moves must stand before the depths learned as background, whatever its colour"
    )
    margin_m: float = Field(0.08, gt=0.0, description="by at least this much")
    margin_share: float = Field(0.03, ge=0.0, description="and this share of the depth")
    moved_share: float = Field(
        0.12, gt=0.0, le=1.0, description="a camera with other depths than learned in this share was moved"
    )
    moved_frames: int = Field(5, ge=1, description="if that lasts so many frames")
    least_area_m2: float = Field(0.01, ge=0.0, description="less surface in a floor cell is noise")
    cell_m: float = Field(0.1, gt=0.0, description="size of a floor cell")
    pair_tolerance_s: float = Field(0.02, ge=0.0, description="colour and depth of one frame differ by less")
    most_age_s: float = Field(
        0.6, gt=0.0, description="a frame that is older than the scan by more says nothing about it"
    )
    silent_s: float = Field(
        5.0, gt=0.0, description="a camera without frames for longer is reported as silent"
    )
