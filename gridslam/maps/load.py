"""Reader of maps of any format; the format is recognised by the content."""

from __future__ import annotations

from pathlib import Path

from gridslam.core.errors import MapError
from gridslam.maps.image_levels import MAX_PIXELS
from gridslam.maps.map_server import load_map
from gridslam.maps.map_yaml import read_map_yaml
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.maps.wean import decompressed_head, load_wean_map, looks_like_wean_map

_IMAGE_MAGIC = (b"P2", b"P5", b"\x89PNG", b"BM")
_YAML_SUFFIXES = frozenset({".yaml", ".yml"})


def load_any_map(path: str | Path, max_cells: int = MAX_PIXELS) -> OccupancyGrid:
    """The map of a map_server YAML or of Wean Hall's wean.dat(.gz).

    Raises MapError: the file is missing, damaged or of another format, or the map has more than `max_cells` cells.
    """
    path = Path(path)
    if path.is_dir():
        raise MapError(f"{path}: a folder; give the YAML file of the map in it")
    if path.suffix.lower() not in _YAML_SUFFIXES:
        head = decompressed_head(path)
        if looks_like_wean_map(head):
            return load_wean_map(path)
        if head.startswith(_IMAGE_MAGIC):
            raise MapError(f"{path}: an image alone has no scale; give the YAML file that names it")
    return load_map(path, max_cells=max_cells)


def map_files(path: Path) -> list[Path]:
    """The file of a map and, of a map_server YAML, the image that it names; the path alone if no such map is there."""
    if path.suffix.lower() not in _YAML_SUFFIXES and looks_like_wean_map(decompressed_head(path)):
        return [path]
    try:
        return [path, path.parent / read_map_yaml(path).image]
    except MapError:  # whoever loads the map says so
        return [path]
