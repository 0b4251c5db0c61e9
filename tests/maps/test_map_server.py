from __future__ import annotations

import io
import logging
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from gridslam.core.errors import ConfigError, MapError
from gridslam.maps.map_cells import cells_of_grid
from gridslam.maps.map_server import load_map, save_map
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid

YAML = "image: map.{kind}\nmode: {mode}\nresolution: 0.05\norigin: [1, 2, 0]\nnegate: {negate}\n"
YAML += "occupied_thresh: {occupied}\nfree_thresh: {free}\n"
UNKNOWN = -1


def write_map(
    folder: Path,
    image: Image.Image | bytes,
    mode: str = "trinary",
    negate: int = 0,
    kind: str = "png",
    thresholds: tuple[float, float] = (0.65, 0.196),
) -> Path:
    occupied, free = thresholds
    data = image if isinstance(image, bytes) else _encoded(image, kind)
    (folder / f"map.{kind}").write_bytes(data)
    text = YAML.format(kind=kind, mode=mode, negate=negate, occupied=occupied, free=free)
    (folder / "map.yaml").write_text(text)
    return folder / "map.yaml"


def _encoded(image: Image.Image, kind: str) -> bytes:
    buffer = io.BytesIO()
    image.save(buffer, format={"pgm": "PPM", "png": "PNG", "bmp": "BMP"}[kind])
    return buffer.getvalue()


def grey_ramp() -> Image.Image:
    return Image.fromarray(np.arange(256, dtype=np.uint8).reshape(1, 256))


def cell_by_map_server(level: int, mode: str, negate: bool, occupied: float, free: float) -> int:
    """nav2's rule for one grey pixel, from its documentation."""
    if mode == "raw":
        return level if level <= 100 else UNKNOWN
    occupancy = level / 255 if negate else 1 - level / 255
    if occupancy <= free:
        return 0
    if occupancy >= occupied:
        return 100
    if mode == "trinary":
        return UNKNOWN
    return round((occupancy - free) / (occupied - free) * 100)


@pytest.mark.parametrize("mode", ["trinary", "scale", "raw"])
@pytest.mark.parametrize("negate", [0, 1])
@pytest.mark.parametrize("kind", ["pgm", "png", "bmp"])
@pytest.mark.parametrize("thresholds", [(0.65, 0.196), (0.9, 0.25), (1.0, 0.0)])
def test_every_grey_level_has_the_value_of_map_server(
    tmp_path: Path, mode: str, negate: int, kind: str, thresholds: tuple[float, float]
) -> None:
    grid = load_map(write_map(tmp_path, grey_ramp(), mode, negate, kind, thresholds))
    expected = [cell_by_map_server(level, mode, bool(negate), *thresholds) for level in range(256)]
    assert cells_of_grid(grid)[0].tolist() == expected


def test_pixels_0_254_and_205_are_occupied_free_and_unknown(tmp_path: Path) -> None:
    pixels = Image.fromarray(np.array([[0, 254, 205]], np.uint8))
    assert cells_of_grid(load_map(write_map(tmp_path, pixels))).tolist() == [[100, 0, UNKNOWN]]


def test_the_bottom_row_of_the_image_is_row_0(tmp_path: Path) -> None:
    pixels = Image.fromarray(np.array([[0, 254], [254, 254]], np.uint8))
    grid = load_map(write_map(tmp_path, pixels))
    assert grid.probability.tolist() == [[0.0, 0.0], [1.0, 0.0]]
    assert grid.geometry.cells(np.array([[1.01, 2.06]])).tolist() == [[1, 0]]


@pytest.mark.parametrize(
    "pgm",
    [b"P2\n# made by hand\n3 1\n255\n0 254 205\n", b"P5\n3 1\n255\n\x00\xfe\xcd"],
    ids=["P2", "P5"],
)
def test_plain_and_binary_pgm_are_read(tmp_path: Path, pgm: bytes) -> None:
    path = write_map(tmp_path, pgm, kind="pgm")
    assert cells_of_grid(load_map(path)).tolist() == [[100, 0, UNKNOWN]]


def test_16_bit_grey_is_read_at_its_full_depth(tmp_path: Path) -> None:
    levels = np.array([[0, 65535, 22900, 22950]], ">u2")  # occupancy 0.6506 and 0.6498
    pgm = b"P5\n4 1\n65535\n" + levels.tobytes()
    png = Image.fromarray(levels.astype(np.uint16))
    for kind, image in (("pgm", pgm), ("png", png)):
        path = write_map(tmp_path, image, kind=kind)
        assert cells_of_grid(load_map(path)).tolist() == [[100, 0, 100, UNKNOWN]]


def test_colours_and_palettes_are_read_by_their_brightness(tmp_path: Path) -> None:
    palette = Image.fromarray(np.array([[0, 1, 2]], np.uint8), mode="L").convert("P")
    palette.putpalette([0, 0, 0, 255, 255, 255, 205, 205, 205] + [0] * 759)
    assert cells_of_grid(load_map(write_map(tmp_path, palette))).tolist() == [[100, 0, UNKNOWN]]
    colour = Image.fromarray(np.array([[[255, 0, 0], [255, 255, 0]]], np.uint8))  # means 85 and 170
    assert cells_of_grid(load_map(write_map(tmp_path, colour))).tolist() == [[100, UNKNOWN]]


@pytest.mark.parametrize("mode", ["trinary", "scale"])
def test_a_pixel_that_is_not_opaque_is_unknown(tmp_path: Path, mode: str) -> None:
    pixels = np.array([[[0, 0, 0, 255], [0, 0, 0, 254], [255, 255, 255, 0]]], np.uint8)
    grid = load_map(write_map(tmp_path, Image.fromarray(pixels), mode))
    assert cells_of_grid(grid).tolist() == [[100, UNKNOWN, UNKNOWN]]


grids = st.builds(
    lambda seed, rows, cols, resolution, x, y, yaw: OccupancyGrid(
        np.random.default_rng(seed)
        .choice(np.array([*np.arange(101) / 100, np.nan, np.nan], np.float32), (rows, cols))
        .astype(np.float32),
        GridGeometry(resolution, (x, y), yaw),
    ),
    st.integers(0, 2**32),
    st.integers(1, 12),
    st.integers(1, 12),
    st.floats(1e-3, 1e2),
    st.floats(-1e5, 1e5),
    st.floats(-1e5, 1e5),
    st.floats(-np.pi, np.pi),
)


@settings(max_examples=60, deadline=None)
@given(grids)
def test_a_graded_map_saved_in_scale_mode_reads_back_the_same(
    tmp_path_factory: pytest.TempPathFactory, grid: OccupancyGrid
) -> None:
    read = load_map(save_map(grid, tmp_path_factory.mktemp("m") / "map", "scale"))
    assert read.geometry == grid.geometry
    assert np.array_equal(cells_of_grid(read), cells_of_grid(grid))


@settings(max_examples=60, deadline=None)
@given(grids, st.sampled_from(["pgm", "png", "bmp"]))
def test_a_map_saved_in_trinary_mode_reads_back_classified_by_the_thresholds(
    tmp_path_factory: pytest.TempPathFactory, grid: OccupancyGrid, kind: str
) -> None:
    read = load_map(save_map(grid, tmp_path_factory.mktemp("m") / "map", image_format=kind))
    cells = cells_of_grid(grid)
    expected = np.where(cells >= 65, 100, np.where(cells <= 20, 0, UNKNOWN))
    assert read.geometry == grid.geometry
    assert np.array_equal(cells_of_grid(read), np.where(cells == UNKNOWN, UNKNOWN, expected))
    again = load_map(save_map(read, tmp_path_factory.mktemp("m") / "map"))
    assert np.array_equal(again.probability, read.probability, equal_nan=True)


def test_saving_writes_two_files_with_the_pixels_of_map_savers(tmp_path: Path) -> None:
    grid = OccupancyGrid(np.array([[1.0, 0.0, np.nan]], np.float32), GridGeometry(0.05, (0.1, 1e-7)))
    yaml_path = save_map(grid, tmp_path / "floor.2")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["floor.2.pgm", "floor.2.yaml"]
    assert np.asarray(Image.open(tmp_path / "floor.2.pgm")).tolist() == [[0, 254, 205]]
    assert "0.0000001" in yaml_path.read_text()  # 1e-07 would be text in YAML 1.1


def test_unknown_cells_in_scale_mode_need_an_alpha_channel(tmp_path: Path) -> None:
    grid = OccupancyGrid(np.full((1, 1), np.nan, np.float32), GridGeometry(0.05, (0.0, 0.0)))
    with pytest.raises(ConfigError, match="use png"):
        save_map(grid, tmp_path / "map", "scale", image_format="pgm")


@pytest.mark.parametrize(("occupied", "free"), [(0.2, 0.5), (0.5, 0.5), (1.5, 0.1), (0.6, -0.1)])
def test_thresholds_out_of_order_are_refused(tmp_path: Path, occupied: float, free: float) -> None:
    grid = OccupancyGrid(np.zeros((1, 1), np.float32), GridGeometry(0.05, (0.0, 0.0)))
    with pytest.raises(ConfigError, match="thresholds"):
        save_map(grid, tmp_path / "map", occupied_thresh=occupied, free_thresh=free)


@pytest.mark.parametrize("image", ["../map.png", "{absolute}"])
def test_an_image_outside_the_folder_is_refused_with_inside_folder(tmp_path: Path, image: str) -> None:
    (tmp_path / "sub").mkdir()
    text = write_map(tmp_path, grey_ramp()).read_text()
    path = tmp_path / "sub" / "map.yaml"
    name = image.format(absolute=tmp_path / "map.png")
    path.write_text(text.replace("image: map.png", f"image: {name}"))
    assert load_map(path).probability.shape == (1, 256)
    with pytest.raises(MapError, match="outside the map's folder"):
        load_map(path, inside_folder=True)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("image: map.png", "image: none.png", "none.png: no such image"),
        ("image: map.png", "image: ''", "image"),
        ("image: map.png", "other: 1", "'image' is missing"),
        ("resolution: 0.05", "resolution: 0", "resolution"),
        ("resolution: 0.05", "resolution: .nan", "resolution"),
        ("resolution: 0.05", "resolution: -1", "resolution"),
        ("[1, 2, 0]", "[1, 2]", "origin"),
        ("[1, 2, 0]", "[1, .inf, 0]", "origin[1]"),
        ("mode: trinary", "mode: quaternary", "trinary, scale or raw"),
        ("mode: trinary", "mode: [1]", "trinary, scale or raw"),
        ("negate: 0", "negate: perhaps", "negate"),
        ("free_thresh: 0.196", "free_thresh: 0.7", "not below"),
        ("free_thresh: 0.196", "free_thresh: [[[", "expected a map's YAML"),
        ("free_thresh: 0.196", "free_thresh: !!float ''", "tags are not allowed"),
        ("free_thresh: 0.196", f"free_thresh: 0x{'f' * 6000}", "a number too large for any use"),
        ("mode: trinary", "mode: trinary\nmode: scale", "the key 'mode' is given twice"),
        ("[1, 2, 0]", "[1e308, 0, 0]", "origin: expected metres and radians up to 1e+09"),
        ("[1, 2, 0]", "[0, 0, 1.0e+300]", "origin: expected metres and radians up to 1e+09"),
        ("image: map.png", f"image: {'m' * 300}", "File name too long"),
    ],
)
def test_a_wrong_yaml_is_a_map_error_that_names_the_key(
    tmp_path: Path, old: str, new: str, says: str
) -> None:
    path = write_map(tmp_path, grey_ramp())
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(MapError) as error:
        load_map(path)
    assert says in str(error.value)


def test_yaml_aliases_that_expand_to_gigabytes_give_a_short_message(tmp_path: Path) -> None:
    path = write_map(tmp_path, grey_ramp())
    laughs = "a0: &a0 [0, 0, 0, 0]\n"
    for i in range(1, 30):
        laughs += f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 8)}]\n"
    path.write_text(laughs + path.read_text().replace("[1, 2, 0]", "*a29"))
    with pytest.raises(MapError) as error:
        load_map(path)
    assert len(str(error.value)) < 1000


@pytest.mark.parametrize("kind", ["pgm", "png", "bmp"])
def test_a_cut_image_is_a_map_error(tmp_path: Path, kind: str) -> None:
    rng = np.random.default_rng(0)
    data = _encoded(Image.fromarray(rng.integers(0, 256, (20, 20), dtype=np.uint8)), kind)
    trailer = 24  # checksums and end marks of PNG: without them all pixels are still there
    for length in range(0, len(data) - trailer, 7):
        with pytest.raises(MapError, match=f"map.{kind}"):
            load_map(write_map(tmp_path, data[:length], kind=kind))


def test_flipped_bytes_give_a_map_or_a_map_error(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    pixels = Image.fromarray(rng.integers(0, 256, (9, 9), dtype=np.uint8))
    for kind in ("pgm", "png", "bmp"):
        data = _encoded(pixels, kind)
        for _ in range(60):
            damaged = bytearray(data)
            damaged[int(rng.integers(len(data)))] = int(rng.integers(256))
            try:
                load_map(write_map(tmp_path, bytes(damaged), kind=kind))
            except MapError as error:
                assert f"map.{kind}" in str(error)


def test_an_image_that_decompresses_to_gigabytes_is_refused_before_decompression(tmp_path: Path) -> None:
    def chunk(name: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))

    for width in (60_000, 2**30):
        header = struct.pack(">IIBBBBB", width, 60_000, 8, 0, 0, 0, 0)
        bomb = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(bytes(10**6)))
        with pytest.raises(MapError, match="at most"):
            load_map(write_map(tmp_path, bomb))


def test_the_limit_counts_pixels(tmp_path: Path) -> None:
    with pytest.raises(MapError, match="256 x 1 pixels, at most 255"):
        load_map(write_map(tmp_path, grey_ramp()), max_cells=255)


@pytest.mark.parametrize(("mode", "free_thresh"), [("trinary", 0.25), ("scale", 0.196), ("scale", 0.25)])
def test_grey_205_of_a_map_saver_is_unknown_for_any_threshold(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, mode: str, free_thresh: float
) -> None:
    pixels = Image.fromarray(np.array([[205, 205, 254, 0]], np.uint8))
    with caplog.at_level(logging.WARNING):
        grid = load_map(write_map(tmp_path, pixels, mode, thresholds=(0.65, free_thresh)))
    assert cells_of_grid(grid).tolist() == [[UNKNOWN, UNKNOWN, 0, 100]]
    assert "2 cells of grey 205 are read as unknown" in caplog.text


@pytest.mark.parametrize(("negate", "thresholds"), [(1, (0.65, 0.196)), (0, (0.0065, 0.00196))])
def test_a_map_savers_unknown_cells_that_its_yaml_makes_occupied_get_a_warning(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, negate: int, thresholds: tuple[float, float]
) -> None:
    pixels = Image.fromarray(np.array([[205, 205, 254, 0]], np.uint8))
    with caplog.at_level(logging.WARNING):
        load_map(write_map(tmp_path, pixels, negate=negate, thresholds=thresholds))
    assert "2 cells of grey 205, which map savers write for unknown, are not unknown" in caplog.text


@pytest.mark.parametrize(
    ("occupied", "free", "says"),
    [
        (65, 19.6, "occupied_thresh: expected a number from 0 to 1, got 65; if it is in percent, write 0.65"),
        (166, 50, "if it is a grey value of 255, write 0.651"),
        (0.65, -0.1, "free_thresh: expected a number from 0 to 1, got -0.1"),
        (1e9, 0.1, "expected a number from 0 to 1, got 1e+09"),
    ],
)
def test_thresholds_that_make_every_cell_free_are_refused(
    tmp_path: Path, occupied: float, free: float, says: str
) -> None:
    with pytest.raises(MapError, match="thresh") as error:
        load_map(write_map(tmp_path, grey_ramp(), thresholds=(occupied, free)))
    assert says in str(error.value)


def test_the_mode_is_read_in_any_case(tmp_path: Path) -> None:
    read = cells_of_grid(load_map(write_map(tmp_path, grey_ramp(), "Trinary")))
    assert np.array_equal(read, cells_of_grid(load_map(write_map(tmp_path, grey_ramp()))))


def test_a_trinary_image_read_in_raw_mode_gets_a_warning(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    pixels = Image.fromarray(np.array([[0, 0, 205, 254]], np.uint8))
    with caplog.at_level(logging.WARNING):
        load_map(write_map(tmp_path, pixels, "raw"))
    assert "mode raw makes 2 cells of grey 0 free" in caplog.text


def test_an_origin_in_degrees_gets_a_warning(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = write_map(tmp_path, grey_ramp())
    path.write_text(path.read_text().replace("[1, 2, 0]", "[1, 2, 90]"))
    with caplog.at_level(logging.WARNING):
        load_map(path)
    assert "the yaw 90 is read as radians; if it is in degrees, write 1.571" in caplog.text


@pytest.mark.parametrize("resolution", ["20", "50.0"])
def test_a_resolution_in_another_unit_gets_a_warning(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, resolution: str
) -> None:
    path = write_map(tmp_path, grey_ramp())
    lines = path.read_text().splitlines()
    path.write_text(
        "\n".join(f"resolution: {resolution}" if "resolution" in line else line for line in lines)
    )
    with caplog.at_level(logging.WARNING):
        load_map(path)
    assert f"resolution: {float(resolution):g} metres a cell; if it is in cells a metre" in caplog.text


def test_translucent_pixels_get_a_warning(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    pixels = np.array([[[254, 254, 254, 250], [254, 254, 254, 0], [0, 0, 0, 255]]], np.uint8)
    with caplog.at_level(logging.WARNING):
        load_map(write_map(tmp_path, Image.fromarray(pixels)))
    assert "1 cells are unknown because their pixels have an alpha" in caplog.text


def test_an_ordinary_map_gets_no_warning(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    pixels = Image.fromarray(np.array([[0, 254, 205]], np.uint8))
    with caplog.at_level(logging.WARNING):
        grid = load_map(write_map(tmp_path, pixels))
        load_map(save_map(grid, tmp_path / "scaled", "scale"))
    assert not caplog.text


@pytest.mark.real_data
@pytest.mark.parametrize(
    "name", ["maps/depot", "maps/tb3_sandbox", "maps/turtlebot3_world", "maps/warehouse"]
)
def test_public_maps_equal_a_pixel_by_pixel_reader(data_dir: Path, name: str) -> None:
    path = data_dir / f"{name}.yaml"
    keys = dict(line.split(":", 1) for line in path.read_text().splitlines() if ":" in line)
    occupied, free = float(keys["occupied_thresh"]), float(keys["free_thresh"])
    table = np.array([cell_by_map_server(level, "trinary", False, occupied, free) for level in range(256)])
    table[205] = UNKNOWN
    pixels = np.asarray(Image.open(path.with_suffix(".pgm")))
    grid = load_map(path)
    assert np.array_equal(cells_of_grid(grid), table[pixels][::-1])
    assert grid.geometry.resolution_m == float(keys["resolution"])


@pytest.mark.real_data
def test_a_public_map_saved_again_has_the_same_cells(data_dir: Path, tmp_path: Path) -> None:
    grid = load_map(data_dir / "maps/turtlebot3_world.yaml")
    again = load_map(save_map(grid, tmp_path / "map"))
    assert np.array_equal(again.probability, grid.probability, equal_nan=True)
    assert again.geometry == grid.geometry
