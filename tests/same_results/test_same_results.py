from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from gridslam.core.messages import Imu
from gridslam.logs import McapWriter
from gridslam.methods.registry import BUILT_IN
from tests.same_results.__main__ import comparison, main
from tests.same_results.digests import digests_of_folder
from tests.same_results.programs import commands


def digest(folder: Path, name: str) -> str:
    return digests_of_folder(folder)[name]


def test_arrays_count_by_type_shape_and_bytes_not_by_name(tmp_path: Path) -> None:
    def layers(**arrays: np.ndarray) -> str:
        np.savez(tmp_path / "layers.npz", **arrays)
        return digest(tmp_path, "layers.npz")

    one, two = np.arange(6.0), np.ones((2, 3), np.float32)
    before = layers(a=one, b=two)
    assert layers(z=one, b=two) == before
    assert layers(a=one.reshape(2, 3), b=two) != before
    assert layers(a=one, b=two.astype(np.float64)) != before
    assert layers(a=one, b=two, c=two) != before


@pytest.mark.parametrize(
    ("text", "same"),
    [
        ("name,position\nhatch,1.50\nbin,-2e-3\n", True),
        ("class,x\ndoor,-2e-3\nbin,1.50\n", False),
        ("class,x\ndoor,1.5\nbin,-2e-3\n", False),
        ("class,x\ndoor,1.50\n", False),
    ],
)
def test_a_table_counts_by_its_numbers_as_written_in_order(tmp_path: Path, text: str, same: bool) -> None:
    (tmp_path / "objects.csv").write_text("class,x\ndoor,1.50\nbin,-2e-3\n")
    before = digest(tmp_path, "objects.csv")
    (tmp_path / "objects.csv").write_text(text)
    assert (digest(tmp_path, "objects.csv") == before) == same


def test_the_numbers_of_a_map_file_count_and_its_words_do_not(tmp_path: Path) -> None:
    def map_yaml(text: str) -> str:
        (tmp_path / "map.yaml").write_text(text)
        return digest(tmp_path, "map.yaml")

    before = map_yaml("image: map.pgm\norigin: [-1.5, 2, 0]\n")
    assert map_yaml("image: other.pgm\norigin: [-1.5, 2, 0]\n") == before
    assert map_yaml("image: map.pgm\norigin: [-1.5, 3, 0]\n") != before


def test_a_picture_counts_by_its_pixels_and_one_with_labels_not_at_all(tmp_path: Path) -> None:
    picture = Image.new("L", (8, 8), 7)
    picture.save(tmp_path / "map.png")
    picture.save(tmp_path / "drawing.png", compress_level=0)
    before = digests_of_folder(tmp_path)
    picture.save(tmp_path / "drawing.png", compress_level=9)
    assert digests_of_folder(tmp_path) == before
    picture.putpixel((0, 0), 8)
    picture.save(tmp_path / "drawing.png")
    assert digest(tmp_path, "drawing.png") != before["drawing.png"]
    assert "map.png" not in before


def test_a_log_counts_by_its_messages_not_by_its_topics(tmp_path: Path) -> None:
    def log(topic: str, rates: Sequence[float]) -> dict[str, str]:
        with McapWriter(tmp_path / "log.mcap") as writer:
            for second, rate in enumerate(rates, start=1):
                writer.write(Imu(second * 10**9, "base_link", rate), topic)
        return digests_of_folder(tmp_path)

    before = log("/imu", (0.1, 0.2))
    assert set(before) == {"log.mcap", "log.mcap events"}
    assert log("/gyro", (0.1, 0.2)) == before
    after = log("/imu", (0.1, 0.3))
    assert all(after[name] != before[name] for name in before)


def test_an_item_is_the_same_under_a_new_name_and_what_is_lost_or_new_is_reported() -> None:
    before = {"map.pgm": "1", "old.csv": "2", "lines.csv": "3", "gone.tum": "4"}
    after = {"map.pgm": "5", "episodes.csv": "2", "lines.csv": "3", "new.npz": "4"}
    assert comparison(before, after) == [
        "differs map.pgm",
        "same old.csv, now episodes.csv",
        "same lines.csv",
        "missing gone.tum",
        "new new.npz",
    ]


def test_every_method_runs_with_its_best_and_its_papers_settings(tmp_path: Path) -> None:
    names = set(commands(tmp_path, threads=1))
    assert names >= {f"{name}.{form}" for name in BUILT_IN for form in ("best", "paper")}


def test_an_unknown_run_a_missing_file_and_a_folder_in_use_are_refused(tmp_path: Path) -> None:
    file = str(tmp_path / "x.json")
    for arguments in (
        ["record", file, "no-such-run"],
        ["compare", file],
        ["record", file, "--keep", str(tmp_path)],
    ):
        with pytest.raises(SystemExit) as error:
            main(arguments)
        assert error.value.code == 2
