"""Maps that are cut, turned and merged keep every wall where it stands in the map frame."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gridslam.core import poses as se2
from gridslam.core.errors import ConfigError, MapError
from gridslam.evaluation.map_errors import wall_points
from gridslam.maps import drawings_out, occupancy
from gridslam.maps.drawings_out import svg_text
from gridslam.maps.editing import crop_to_polygon, crop_to_reachable, merged, moved, wall_direction
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid

Floats = NDArray[np.float64]


def room(yaw_rad: float = 0.0) -> OccupancyGrid:
    """A room of 6 x 4 m with a wall in it, and a closed chamber beside it."""
    values = np.full((100, 160), np.nan, np.float32)
    values[10:90, 10:130] = 0.05
    values[10:90, 131:150] = 0.05
    for rows, cols in ((slice(9, 91), [9, 130, 150]), ([9, 90], slice(9, 151)), (slice(10, 50), 60)):
        values[rows, cols] = 0.95
    return OccupancyGrid(values, GridGeometry(0.05, (-2.0, 1.0), yaw_rad))


def walls(grid: OccupancyGrid) -> Floats:
    return grid.geometry.centres(np.argwhere(grid.probability > 0.65))


def test_a_cropped_map_has_its_cells_where_they_were() -> None:
    for yaw in (0.0, 0.7):
        grid = room(yaw)
        corners = grid.geometry.centres(np.array([(20.0, 30.0), (20.0, 100.0), (95.0, 100.0), (95.0, 30.0)]))
        part = crop_to_polygon(grid, corners)
        assert part.probability.shape == (71, 71)
        assert cKDTree(walls(grid)).query(walls(part))[0].max() < 1e-9
        assert (part.probability > 0.65).sum() == 30 + 71


def test_only_what_can_be_reached_is_kept() -> None:
    grid = room()
    part = crop_to_reachable(grid, grid.geometry.centres(np.array([[20, 20]]))[0])
    assert part.probability.shape == (82, 124)
    assert (part.probability < 0.2).sum() == 80 * 120 - 40
    with pytest.raises(ConfigError, match="free space"):
        crop_to_reachable(grid, np.array([50.0, 50.0]))
    with pytest.raises(ConfigError, match="no known cell"):
        crop_to_polygon(grid, np.array([[50.0, 50.0], [51.0, 50.0], [51.0, 51.0]]))


def test_walls_lie_along_the_axes_after_turning() -> None:
    grid = moved(room(), np.array([1.0, 2.0, 0.3]))
    assert wall_direction(grid) == pytest.approx(0.3, abs=0.004)
    back = moved(grid, np.array([0.0, 0.0, -wall_direction(grid)]))
    assert wall_direction(back) == pytest.approx(0.0, abs=0.004)
    assert back.geometry.resolution_m == 0.05
    true = se2.transform_points(
        np.array([0.0, 0.0, -0.3]), se2.transform_points(np.array([1.0, 2.0, 0.3]), walls(room()))
    )
    assert cKDTree(true).query(walls(back))[0].max() < 0.1


def test_merged_maps_know_what_either_knew() -> None:
    grid = room()
    left = crop_to_polygon(grid, np.array([[-3.0, 0.0], [2.0, 0.0], [2.0, 7.0], [-3.0, 7.0]]))
    right = crop_to_polygon(grid, np.array([[1.0, 0.0], [9.0, 0.0], [9.0, 7.0], [1.0, 7.0]]))
    pose = np.array([0.5, -0.25, 0.0])
    shifted = OccupancyGrid(
        right.probability,
        GridGeometry(0.05, tuple((np.array(right.geometry.origin_xy_m) - pose[:2]).tolist())),
    )
    whole = merged(left, shifted, pose)
    assert np.count_nonzero(~np.isnan(whole.probability)) == np.count_nonzero(~np.isnan(grid.probability))
    assert cKDTree(walls(grid)).query(walls(whole))[0].max() < 1e-6


def test_a_polygon_that_reaches_far_beyond_the_map_keeps_its_edges() -> None:
    grid = room()
    near = np.array([[-10.0, 0.0], [10.0, 5.0], [10.0, 20.0], [-10.0, 20.0]])
    far = np.array([[-1e8, 0.25e8 * -1 + 2.5], [1e8, 0.25e8 + 2.5], [1e8, 1e8], [-1e8, 1e8]])
    parts = [crop_to_polygon(grid, corners) for corners in (near, far)]
    assert parts[0].geometry == parts[1].geometry
    np.testing.assert_array_equal(parts[0].probability, parts[1].probability)


@pytest.mark.parametrize("pose", [(1e300, 0.0, 0.0), (0.0, 1e9, 0.0)])
def test_a_map_that_would_be_endless_is_refused(pose: tuple[float, float, float]) -> None:
    with pytest.raises(ConfigError, match="the limit is"):
        merged(room(), room(), np.array(pose))


def test_noise_is_refused_before_its_walls_are_looked_at_one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    noise = OccupancyGrid(
        np.random.default_rng(0).random((200, 200)).astype(np.float32), GridGeometry(0.05, (0.0, 0.0))
    )
    monkeypatch.setattr(occupancy, "MAX_MARKED_CELLS", 10_000)
    for look in (wall_direction, wall_points):
        with pytest.raises(
            MapError, match=r"200 x 200 cells has at least \d+ wall cells; the limit is 10000"
        ):
            look(noise)
    monkeypatch.setattr(drawings_out, "MAX_CONTOUR_EDGES", 1_000)
    with pytest.raises(MapError, match="edges of cells, as noise has"):
        svg_text(noise)
    monkeypatch.setattr(drawings_out, "MAX_CONTOUR_CELLS", 10_000)
    with pytest.raises(MapError, match="at most 10000 cells"):
        svg_text(noise)
