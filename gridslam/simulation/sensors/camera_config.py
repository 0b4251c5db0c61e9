"""Cameras of a world file: stereo and RGB-D, on the robot or fixed in the world."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from gridslam.simulation.sensors.sensor_config import SensorExtrinsics, Stream
from gridslam.simulation.shapes import Fraction, NotNegative, Number, Positive, Rate


class Camera(Stream):
    """A pinhole camera that looks along the x axis of its extrinsics. Pixel noise is normal; `noise_levels` is its
    standard deviation in grey levels (0 to 255).
    """

    former_keys: ClassVar[Mapping[str, str]] = {"mounting": "extrinsics"}

    name: str = Field(min_length=1, pattern="^[A-Za-z][A-Za-z0-9_]*$")
    extrinsics: SensorExtrinsics = SensorExtrinsics(z=0.6)
    rate_hz: Rate = 2.0
    width_px: Annotated[int, Field(ge=16, le=4096)] = 320
    height_px: Annotated[int, Field(ge=16, le=4096)] = 240
    focal_px: Positive = 280.0
    noise_levels: NotNegative = 1.5


class RgbdCamera(Camera):
    """Colour and depth of the same pixels.

    The standard deviation of a depth is depth_noise_m + depth_noise_per_m2 * depth^2; `depth_offset_m` is added to every
    depth. A pixel has no depth outside [depth_min_m, depth_max_m], where its incidence exceeds `grazing_deg`, beside a depth
    edge of more than 5 % (`edge_shadow`), and at random for the fraction `holes` of the pixels.
    """

    kind: Literal["rgbd"] = "rgbd"
    depth_min_m: Positive = 0.4
    depth_max_m: Positive = 8.0
    depth_noise_m: NotNegative = 0.002
    depth_noise_per_m2: NotNegative = 0.002
    depth_offset_m: Number = 0.0
    depth_resolution_m: NotNegative = 0.001
    holes: Fraction = 0.01
    grazing_deg: Annotated[float, Field(gt=0.0, le=90.0)] = 80.0
    edge_shadow: bool = True


class StereoCamera(Camera):
    """Two rectified grey cameras. The extrinsics are those of the left one; the right one is `baseline_m` to its right."""

    kind: Literal["stereo"] = "stereo"
    baseline_m: Positive = 0.12


AnyCamera = Annotated[RgbdCamera | StereoCamera, Field(discriminator="kind")]
