"""What is fuzzed: each target takes bytes, and may end in nothing but a result or a GridslamError."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from pathlib import Path

from gridslam.config.yaml_file import parse_mapping
from gridslam.core.errors import GridslamError
from gridslam.evaluation.files import read_relations, read_trajectory
from gridslam.logs.config import LogConfig, LogLimits
from gridslam.logs.open import open_log
from gridslam.maps.drawing import load_drawing
from gridslam.maps.load import load_any_map
from gridslam.maps.tag_database import load_tag_database
from gridslam.run_config import validate_run_config
from gridslam.simulation.world_config import validate_world
from gridslam.sweep.config import load_sweep
from tests.logs.mutations import sample_carmen, sample_mcap

SMALL = LogConfig(limits=LogLimits(chunk_mb=16, line_mb=1, reorder_mb=16))
MAP_YAML = """\
image: map.pgm
mode: trinary
resolution: 0.05
origin: [0.0, 0.0, 0.0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""
CONFIG = "method: {name: slam-sd, particles: 30}\nlog: {topics: {scan: /scan}}\nseed: 3\n"
SWEEP = 'command: map\nlogs: [{log: a.mcap}]\nconfigs: [slam-sd]\nseeds: 0..3\nrequire: ["mean(ape.trans.rmse)<=1"]\n'
WORLD = "walls: [{rectangle: [0, 0, 4, 3]}]\nrobot: {start: [1, 1, 0], route: [[2, 1]]}\n"
TAGS = "version: 1\nobjects: []\n"
ODOM = "stamp,x,y,yaw\n1.0,0,0,0\n1.1,0.1,0,0.01\n"
PGM = b"P5\n4 3\n255\n" + bytes(range(12))


@cache
def scratch() -> Path:
    """Where the inputs lie; targets are run one after the other."""
    folder = Path("out/fuzz/scratch")
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def file_of(data: bytes, name: str) -> Path:
    """The bytes as a file."""
    path = scratch() / name
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(data)
    return path


def read_log(path: Path) -> None:
    """All events and the truth, as a run reads them."""
    with open_log(path, SMALL) as log:
        for _ in log.events():
            pass
        log.truth()


def read_csv(data: bytes) -> None:
    """The first part as log.yaml, the others as odom.csv and scan.csv."""
    parts = data.split(b"\0", 2)
    folder = scratch() / "csv"
    for name, part in zip(("odom.csv", "log.yaml", "scan.csv"), [*parts, b"", b""], strict=False):
        file = file_of(part, f"csv/{name}")
        if not part:
            file.unlink()
    read_log(folder)


def read_map(data: bytes) -> None:
    """The YAML, then the image."""
    yaml, _, image = data.partition(b"\0")
    file_of(image, "map.pgm")
    load_any_map(file_of(yaml, "map.yaml"))


def read_config(data: bytes) -> None:
    """Text that somebody calls a configuration."""
    validate_run_config(parse_mapping(data.decode("utf-8", "replace"), "fuzz.yaml"), "fuzz.yaml")


def read_world(data: bytes) -> None:
    """Text that somebody calls a world."""
    validate_world(parse_mapping(data.decode("utf-8", "replace"), "fuzz.yaml"), "fuzz.yaml")


Target = Callable[[bytes], object]

TARGETS: Mapping[str, Target] = {
    "mcap": lambda data: read_log(file_of(data, "log.mcap")),
    "carmen": lambda data: read_log(file_of(data, "log.clf")),
    "csv": read_csv,
    "map": read_map,
    "wean": lambda data: load_any_map(file_of(data, "wean.dat")),
    "drawing": lambda data: load_drawing(file_of(data, "drawing.png")),
    "tags": lambda data: load_tag_database(file_of(data, "tags.yaml")),
    "trajectory": lambda data: read_trajectory(file_of(data, "path.tum")),
    "relations": lambda data: read_relations(file_of(data, "true.relations")),
    "config": read_config,
    "world": read_world,
    "sweep": lambda data: load_sweep(file_of(data, "sweep.yaml")),
}


def seeds_of(name: str) -> Iterator[bytes]:
    """Good inputs to begin with."""
    if name == "mcap":
        for compression in ("none", "zstd"):
            yield sample_mcap(scratch() / "seed.mcap", compression, 2000).read_bytes()[:20_000]
    if name == "drawing":
        yield b"P5\n20 20\n255\n" + bytes(200) + b"\xff" * 200
    yield {
        "mcap": b"\x89MCAP0\r\n",
        "carmen": sample_carmen(10),
        "csv": f"{ODOM}\0version: 1\n\0".encode(),
        "map": MAP_YAML.encode() + b"\0" + PGM,
        "wean": b"-1 0 0.5 1\n0 0 1 1\n",
        "drawing": PGM,
        "tags": TAGS.encode(),
        "trajectory": b"1.5 0 0 0 0 0 0 1\n2.5 1 0 0 0 0 0 1\n",
        "relations": b"1 2 0.1 0 0 0 0 0.2\n",
        "config": CONFIG.encode(),
        "world": WORLD.encode(),
        "sweep": SWEEP.encode(),
    }[name]


def check(name: str, data: bytes) -> bool:
    """Whether a target takes the data. A GridslamError of one line is a good answer; whatever else escapes is a bug."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            TARGETS[name](data)
        except GridslamError as error:
            assert str(error).strip(), "an error says what is wrong"
            return False
    return True
