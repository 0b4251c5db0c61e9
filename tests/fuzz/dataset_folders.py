"""Folders of KITTI, EuRoC and TUM RGB-D with changed lists, calibrations and pictures."""

from __future__ import annotations

import random
import shutil
from pathlib import Path

import numpy as np
import yaml
from PIL import Image

from tests.fuzz.damage import NUMBERS, changed
from tests.fuzz.value_trees import damaged

STAMPS = [1_403_636_580_000_000_000 + k * 50_000_000 for k in range(3)]
IDENTITY = "1 0 0 0 0 1 0 0 0 0 1 0"
WORDS = (*NUMBERS, "1e400", "../../x.png", "/dev/zero", "a\x1b[31m", "\u0661", "-1e-9", "9" * 400)
CAMERA = {
    "T_BS": {"cols": 4, "rows": 4, "data": [0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]},
    "resolution": [12, 8],
    "intrinsics": [10.0, 10.0, 6.0, 4.0],
    "distortion_model": "radial-tangential",
    "distortion_coefficients": [0.1, 0.0, 0.0, 0.0],
}


def fuzz_dataset(path: Path, sample: Path, rng: random.Random) -> Path:
    """A sequence of three pairs of pictures; a few of its files are damaged."""
    shutil.rmtree(path, ignore_errors=True)
    path.mkdir()
    rng.choice((_kitti, _euroc, _tum))(path)
    files = sorted(file for file in path.rglob("*") if file.is_file())
    for file in rng.sample(files, min(rng.choice((0, 1, 1, 2, 3)), len(files))):
        _damage(file, rng)
    return path


def _picture(path: Path, depth: bool = False) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(np.full((8, 12), 100, np.uint16 if depth else np.uint8)).save(path)


def _kitti(folder: Path) -> None:
    for k in range(3):
        _picture(folder / "image_0" / f"{k:06d}.png")
        _picture(folder / "image_1" / f"{k:06d}.png")
    P = "10 0 6 {} 0 10 4 0 0 0 1 0"
    (folder / "calib.txt").write_text(f"P0: {P.format(0)}\nP1: {P.format(-1)}\nTr: {IDENTITY}\n")
    (folder / "times.txt").write_text("0.0\n1.036e-01\n0.2\n")
    (folder / "poses.txt").write_text(f"{IDENTITY}\n" * 3)


def _euroc(folder: Path) -> None:
    for shift, name in enumerate(("cam0", "cam1")):
        camera = {**CAMERA, "T_BS": {**CAMERA["T_BS"], "data": [*CAMERA["T_BS"]["data"]]}}  # type: ignore[dict-item]
        camera["T_BS"]["data"][3] = 0.1 * shift  # type: ignore[index]
        place = folder / "mav0" / name
        for stamp in STAMPS:
            _picture(place / "data" / f"{stamp}.png")
        (place / "sensor.yaml").write_text(yaml.dump(camera))
        (place / "data.csv").write_text("#t,f\n" + "".join(f"{stamp},{stamp}.png\n" for stamp in STAMPS))
    for name, row in (("imu0", "0,0,0.5,0,0,9.8"), ("state_groundtruth_estimate0", "1,2,3,1,0,0,0,0,0,0")):
        (folder / "mav0" / name).mkdir()
        (folder / "mav0" / name / "data.csv").write_text("".join(f"{stamp},{row}\n" for stamp in STAMPS))


def _tum(folder: Path) -> None:
    lists = {"rgb.txt": "# colour\n", "depth.txt": "", "groundtruth.txt": ""}
    for k in range(3):
        for name in ("rgb", "depth"):
            _picture(folder / name / f"{k}.png", depth=name == "depth")
            lists[f"{name}.txt"] += f"{1305031102 + k}.17 {name}/{k}.png\n"
        lists["groundtruth.txt"] += f"{1305031102 + k}.17 1 2 3 0 0 0 1\n"
    for name, text in lists.items():
        (folder / name).write_text(text)


def _damage(file: Path, rng: random.Random) -> None:
    """Damage the tree of a YAML file, words of a list, or bytes; or take the file away."""
    data = file.read_bytes()
    what = rng.random()
    if what < 0.05:
        file.unlink()
    elif file.suffix == ".yaml" and what < 0.9:
        tree = damaged(yaml.safe_load(data), rng)
        file.write_text(yaml.dump(tree).replace("\\uD800", "x"), "utf-8")
    elif file.suffix in (".txt", ".csv") and what < 0.9:
        separator = "," if file.suffix == ".csv" else " "
        lines = [line.split(separator) for line in data.decode().splitlines()]
        for _ in range(rng.choice((1, 2))):
            row = rng.choice(lines)
            if row and rng.random() < 0.8:
                row[rng.randrange(len(row))] = rng.choice(WORDS)
            else:
                lines[rng.randrange(len(lines))] = rng.choice(
                    ([], [""], ["#"], row * 2, row[:-1], [separator])
                )
        file.write_text("\n".join(separator.join(row) for row in lines) + "\n", "utf-8")
    else:
        file.write_bytes(changed(data, rng))
