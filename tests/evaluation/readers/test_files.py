from __future__ import annotations

import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest

from gridslam.core.errors import InputError
from gridslam.core.trajectory import Trajectory
from gridslam.evaluation.readers.files import read_relations, read_trajectory
from gridslam.evaluation.readers.object_files import read_objects
from gridslam.evaluation.readers.run_files import read_probability, read_truth_series, truth_paths
from gridslam.maps.occupancy import GridGeometry, GridLayer
from gridslam.report.layers import write_layers
from gridslam.report.text_files import write_tum


def write(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def test_a_trajectory_that_was_written_reads_back_with_the_very_stamps(tmp_path: Path) -> None:
    stamps = np.array([1_700_000_000_123_456_789, 1_700_000_000_123_456_790])
    written = Trajectory(stamps, np.array([[1.25, -2.5, 3.1], [0.0, 1e-6, -3.1]]))
    write_tum(tmp_path / "t.tum", written)
    read = read_trajectory(tmp_path / "t.tum")
    assert np.array_equal(read.stamps_ns, stamps)
    assert np.allclose(read.poses, written.poses, atol=1e-9)


def test_comments_blank_lines_and_windows_line_ends_are_no_poses(tmp_path: Path) -> None:
    path = write(tmp_path / "t.txt", "# t x y yaw\r\n\r\n1.5 1 2 0.5 # here\r\n2.5e0 3 4 0.25\r\n")
    read = read_trajectory(path)
    assert read.stamps_ns.tolist() == [1_500_000_000, 2_500_000_000]
    assert read.poses.tolist() == [[1.0, 2.0, 0.5], [3.0, 4.0, 0.25]]


@pytest.mark.parametrize(
    ("text", "place", "says"),
    [
        ("", "t.tum", "no pose"),
        ("# nothing\n", "t.tum", "no pose"),
        ("1 0 0 0\n2 nan 0 0\n", "t.tum:2", "'nan'"),
        ("1 0 0 0\n2 0 -1e10 0\n", "t.tum:2", "'-1e10'"),
        ("1 0 0 0\n2 1e999 0 0\n", "t.tum:2", "'1e999'"),
        ("nan 0 0 0\n", "t.tum:1", "not a stamp"),
        ("-1 0 0 0\n", "t.tum:1", "not a stamp"),
        ("1 0 0 0\n\n2 0 0\n", "t.tum:3", "3 numbers"),
        ("1 0 0 0\n2 0 0 0 0 0 0 1\n", "t.tum:2", "8 numbers"),
        ("1 0 0 0 0 0 0 0\n", "t.tum:1", "quaternion"),
        ("1 x 0 0\n", "t.tum:1", "'x'"),
    ],
)
def test_a_wrong_line_is_named(tmp_path: Path, text: str, place: str, says: str) -> None:
    with pytest.raises(InputError) as error:
        read_trajectory(write(tmp_path / "t.tum", text))
    assert place in str(error.value)
    assert says in str(error.value)


def test_a_file_that_is_no_text_is_an_input_error(tmp_path: Path) -> None:
    (tmp_path / "t.tum").write_bytes(bytes(range(256)))
    with pytest.raises(InputError, match="not a text file"):
        read_trajectory(tmp_path / "t.tum")
    with pytest.raises(InputError, match="cannot be read"):
        read_relations(tmp_path / "none")


def test_a_relation_of_seven_numbers_is_named(tmp_path: Path) -> None:
    path = write(tmp_path / "r", "1 2 0.5 0 0 0 0 0.1\n1 2 0.5 0 0 0 0\n")
    with pytest.raises(InputError, match=r"r:2: 7 numbers"):
        read_relations(path)


def test_the_truth_is_found_in_a_log_in_a_text_and_in_a_folder(tmp_path: Path, small_log: Path) -> None:
    assert len(read_truth_series(small_log)) == 60
    text = write(tmp_path / "trajectory.tum", "1 0 0 0\n")
    assert len(read_truth_series(text)) == 1
    assert truth_paths(tmp_path).trajectory == text
    assert truth_paths(small_log).trajectory == small_log


@pytest.mark.real_data
def test_a_log_without_truth_says_so(data_dir: Path) -> None:
    with pytest.raises(InputError, match="no true poses"):
        read_truth_series(data_dir / "wean_hall/robotdata1.log.gz")


def test_of_an_object_over_time_the_last_row_counts(tmp_path: Path) -> None:
    text = "stamp,id,class,x,y,yaw,moved,state\n1,a,box,0,0,0,false,\n2,a,box,1,2,0.5,true,\n2,d,door,0,0,0,,open\n"
    objects = read_objects(write(tmp_path / "objects.csv", text))
    assert objects["a"].pose == (1.0, 2.0, 0.5)
    assert (objects["a"].moved, objects["a"].state) == (True, None)
    assert (objects["d"].moved, objects["d"].state) == (None, "open")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("id,x,y\na,0,0\n", "yaw"),
        ("id,x,y,yaw\na,0,zero,0\n", "objects.csv:2: y"),
        ("id,x,y,yaw\na,0,0\n", "objects.csv:2: yaw"),
        ("id,x,y,yaw\n,0,0,0\n", "objects.csv:2: the id"),
        ("id,x,y,yaw,moved\na,0,0,0,perhaps\n", "objects.csv:2: moved"),
    ],
)
def test_a_wrong_object_is_named(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        read_objects(write(tmp_path / "objects.csv", text))


def test_the_probability_layer_reads_back_and_damage_is_an_input_error(tmp_path: Path) -> None:
    values = np.array([[0.1, np.nan]], np.float32)
    path = tmp_path / "layers.npz"
    write_layers(path, {"probability": GridLayer(values, GridGeometry(0.05, (1.0, 2.0), 0.3))})
    read = read_probability(path)
    assert read is not None
    assert read.geometry == GridGeometry(0.05, (1.0, 2.0), 0.3)
    assert np.array_equal(read.probability, values, equal_nan=True)
    path.write_bytes(path.read_bytes()[:100])
    with pytest.raises(InputError, match="run again"):
        read_probability(path)


def test_a_byte_order_mark_is_no_part_of_the_first_number(tmp_path: Path) -> None:
    bom = "\ufeff"
    assert read_truth_series(write(tmp_path / "t.path", f"{bom}1 2 3 0\n2 3 3 0\n")).trajectory.poses[
        0
    ].tolist() == [2, 3, 0]
    assert len(read_relations(write(tmp_path / "r", f"{bom}1 2 0.1 0 0 0 0 0\n"))) == 1
    assert set(read_objects(write(tmp_path / "o.csv", f"{bom}id,x,y,yaw\na,1,2,3\n"))) == {"a"}


LAYERS = {
    "probability": np.full((20, 30), 0.5, np.float32),
    "probability.origin": np.zeros(3),
    "probability.resolution": np.float64(0.1),
}


@pytest.mark.parametrize(
    "wrong",
    [
        {"probability": np.full((2, 2), 5.0)},
        {"probability": np.full((2, 2), -np.inf)},
        {"probability": np.full((2, 2), 0.5 + 0.5j)},
        {"probability": np.full((2, 2), "a")},
        {"probability": np.full(4, 0.5)},
        {"probability.origin": np.array([np.nan, 0.0, 0.0])},
        {"probability.origin": np.array([0.0, 1e300, 0.0])},
        {"probability.origin": np.zeros(2)},
        {"probability.origin": np.array("abc")},
        {"probability.origin": np.full(3, np.inf, np.float16)},
        {"probability.resolution": np.float64(1e-300)},
        {"probability.resolution": np.float64(np.inf)},
        {"probability.resolution": np.array([1.0, 2.0])},
        {"probability.resolution": np.complex128(0.1)},
    ],
)
def test_layers_that_are_no_map_are_an_unreadable_input(tmp_path: Path, wrong: dict[str, object]) -> None:
    np.savez_compressed(tmp_path / "layers.npz", **{**LAYERS, **wrong})
    with pytest.raises(InputError, match=r"layers\.npz"):
        read_probability(tmp_path / "layers.npz")


def test_layers_with_any_byte_changed_give_a_map_or_an_unreadable_input(tmp_path: Path) -> None:
    path = tmp_path / "layers.npz"
    np.savez_compressed(path, **LAYERS)
    whole = path.read_bytes()
    rng = np.random.default_rng(0)
    for place in range(len(whole)):
        damaged = bytearray(whole)
        damaged[place] ^= int(rng.integers(1, 256))
        path.write_bytes(damaged)
        try:
            assert read_probability(path) is not None or damaged != whole
        except InputError as error:
            assert str(path) in str(error)


@pytest.mark.parametrize("array", [b"\x93NUMPY\x01\x00\x10\x00{'descr': '<f4', ", b"no array", b""])
def test_layers_with_a_damaged_array_are_an_unreadable_input(tmp_path: Path, array: bytes) -> None:
    path = tmp_path / "layers.npz"
    with zipfile.ZipFile(path, "w") as archive:
        for name in LAYERS:
            archive.writestr(f"{name}.npy", array)
    with pytest.raises(InputError, match=r"layers\.npz"):
        read_probability(path)


def test_a_layer_larger_than_any_map_that_is_evaluated_is_refused_by_its_size(tmp_path: Path) -> None:
    path = tmp_path / "layers.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("probability.npy", bytes(1000))
    size = struct.pack("<I", 2**31)  # what a bomb unpacks to: in the central directory
    data = path.read_bytes()
    path.write_bytes(data.replace(struct.pack("<I", 1000), size))
    with pytest.raises(InputError, match="its arrays take 2147483648 bytes; the limit is"):
        read_probability(path)
