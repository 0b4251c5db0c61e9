"""Renders colour and depth of a mesh: rays cast by Embree (the extra `sim`), procedural textures, one lamp, ambient light."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gridslam.core.errors import ConfigError
from gridslam.core.random import random_stream
from gridslam.simulation.sensors.mesh import TEXTURES, Mesh

Array = NDArray[np.float64]
Pixels = NDArray[np.float32]
LAMP = np.array([0.35, 0.48, 0.80], np.float32)  # direction to the light, nearly a unit vector
AMBIENT, DIRECT = 0.55, 0.45
TILE = 256  # texels of the noise tile
# Contrast of the noise by texture, for each size of texels (m); `checks` and `brick` have a pattern as well.
TEXEL_M = (0.008, 0.03, 0.12)
CONTRAST: dict[str, tuple[float, float, float]] = {
    "plain": (0.02, 0.02, 0.03),
    "plaster": (0.22, 0.22, 0.12),
    "wood": (0.12, 0.22, 0.18),
    "brick": (0.15, 0.12, 0.08),
    "checks": (0.08, 0.08, 0.08),
    "carpet": (0.25, 0.22, 0.12),
}
PATTERNED = (TEXTURES.index("brick"), TEXTURES.index("checks"))
BRICK_M, ROW_M, JOINT_M, CHECK_M = 0.25, 0.08, 0.012, 0.12


@dataclass(frozen=True, slots=True)
class CameraView:
    """A rendered image: colour `(rows, cols, 3)` (0 to 255); depth along the optical axis (m, infinite without a surface) and
    cosine of incidence `(rows, cols)`.
    """

    colour: Pixels
    depth_m: Pixels
    cosine: Pixels


class Renderer:
    """Renders meshes for pinhole cameras of one size and focal length."""

    def __init__(self, width_px: int, height_px: int, focal_px: float) -> None:
        self._shape = height_px, width_px
        self._focal_px = focal_px
        cols = (np.arange(width_px) - 0.5 * (width_px - 1)) / focal_px
        rows = (np.arange(height_px) - 0.5 * (height_px - 1)) / focal_px
        x, y = np.meshgrid(cols, rows)
        # camera axes: x forward, y left, z up
        self._directions = np.stack([np.ones_like(x), -x, -y], axis=-1).reshape(-1, 3).astype(np.float32)
        self._tile = random_stream(0, "texture").uniform(-1.0, 1.0, (TILE, TILE)).astype(np.float32)

    def render(self, mesh: Mesh, position: Array, rotation: Array) -> CameraView:
        """The view from `position` `(3,)` with the axes `rotation` `(3, 3)` (columns: forward, left, up)."""
        directions = np.ascontiguousarray(self._directions @ rotation.T.astype(np.float32))
        origins = np.ascontiguousarray(np.broadcast_to(position, directions.shape), np.float32)
        hit = _embree_scene(mesh.triangles).run(origins, directions, query="INTERSECT", output=True)
        index: NDArray[np.int32] = hit["primID"]
        is_hit = index >= 0
        depth = np.where(is_hit, hit["tfar"], np.float32(np.inf)).astype(np.float32)
        colour, cosine = self._shade(
            mesh, np.maximum(index, 0), origins, directions, np.where(is_hit, depth, 0)
        )
        colour[~is_hit] = 0.0
        shape = self._shape
        return CameraView(colour.reshape(*shape, 3), depth.reshape(shape), cosine.reshape(shape))

    def _shade(
        self, mesh: Mesh, index: NDArray[np.int32], origins: Pixels, directions: Pixels, depth: Pixels
    ) -> tuple[Pixels, Pixels]:
        """Colours `(n, 3)` and cosines of incidence `(n,)` of rays that hit the triangles `index`."""
        normals = _normals(mesh.triangles)
        light = (AMBIENT + DIRECT * np.abs(normals @ LAMP)).astype(np.float32)
        normal = normals[index]
        lengths = np.sqrt(np.einsum("ij,ij->i", directions, directions))
        cosine = np.abs(np.einsum("ij,ij->i", normal, directions)) / lengths
        points = origins + depth[:, None] * directions
        is_level = np.abs(normal[:, 2]) > 0.5
        across = np.where(is_level, points[:, 0], points[:, 0] * normal[:, 1] - points[:, 1] * normal[:, 0])
        up = np.where(is_level, points[:, 1], points[:, 2])
        footprint = depth / (self._focal_px * np.maximum(cosine, 0.1))
        brightness = self._texture(mesh.textures[index], across, up, footprint) * light[index]
        return (mesh.colours[index] * brightness[:, None]).astype(np.float32), cosine.astype(np.float32)

    def _texture(self, texture: NDArray[np.int32], across: Pixels, up: Pixels, footprint: Pixels) -> Pixels:
        """Factors on the colour `(n,)`. Texture finer than a pixel's footprint fades out, which avoids flicker."""
        import cv2

        shape = self._shape
        factor = np.ones(len(texture), np.float32)
        for k, texel in enumerate(TEXEL_M):
            contrast = np.array([CONTRAST[name][k] for name in TEXTURES], np.float32)[texture]
            u = (across / texel % TILE).astype(np.float32).reshape(shape)
            v = (up / texel % TILE).astype(np.float32).reshape(shape)
            noise = cv2.remap(self._tile, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP).reshape(-1)
            factor += contrast * noise * np.clip(texel / np.maximum(footprint, 1e-6) - 0.5, 0.0, 1.0)
        patterned = np.flatnonzero(np.isin(texture, PATTERNED))
        dark = _dark_parts(texture[patterned], across[patterned], up[patterned])
        factor[patterned[dark]] *= 0.6
        return np.maximum(factor, 0.05)


def _dark_parts(texture: NDArray[np.int32], across: Pixels, up: Pixels) -> NDArray[np.bool_]:
    """Mask `(n,)` of the joints between bricks and of every other check."""
    row = np.floor(up / ROW_M)
    in_joint = (up % ROW_M < JOINT_M) | ((across + 0.5 * BRICK_M * (row % 2)) % BRICK_M < JOINT_M)
    dark = (np.floor(across / CHECK_M) + np.floor(up / CHECK_M)) % 2 == 0
    is_brick, is_checks = texture == TEXTURES.index("brick"), texture == TEXTURES.index("checks")
    return np.asarray((is_brick & in_joint) | (is_checks & dark))


def _normals(triangles: NDArray[np.float32]) -> Pixels:
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    return np.asarray(normal / np.maximum(length, 1e-12), np.float32)


def _embree_scene(triangles: NDArray[np.float32]) -> Any:
    try:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene
    except ImportError:
        raise ConfigError("cameras are rendered with embreex: pip install 'gridslam[sim]'") from None
    scene = EmbreeScene()
    TriangleMesh(scene, triangles)
    return scene
