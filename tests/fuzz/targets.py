"""What is fuzzed: each target takes bytes, and may end in nothing but a result or a GridslamError."""

from __future__ import annotations

import io
import warnings
import zipfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gridslam.config.errors import short
from gridslam.config.overrides import apply_overrides
from gridslam.config.yaml_file import parse_mapping
from gridslam.core.errors import GridslamError
from gridslam.evaluation.readers.files import read_relations, read_trajectory
from gridslam.evaluation.readers.object_files import read_objects
from gridslam.evaluation.readers.run_files import read_probability
from gridslam.logs.config import LogConfig, LogLimits
from gridslam.logs.encoding.csv_pictures import read_floats
from gridslam.logs.open import open_log
from gridslam.maps.drawings.drawing import load_drawing
from gridslam.maps.load import load_any_map
from gridslam.maps.occupancy import GridGeometry, GridLayer
from gridslam.maps.tag_database import load_tag_database
from gridslam.report.layers import write_layers
from gridslam.runs.run_config import validate_run_config
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
LAYOUT = """\
version: 1
streams:
  - {kind: odom, file: odom.csv, units: {stamp: ms, yaw: deg}, columns: &c {x: x}}
  - {kind: truth, file: odom.csv, columns: *c, row_stamps: {start_s: 2, period_s: 0.5}}
extrinsics: {laser: {x: 0.1, yaw: 3.1}}
"""
METADATA = "rosbag2_bagfile_information: {version: 5, relative_file_paths: [a.mcap]}\n"
YAMLS = (
    "a: &a {x: [1, 2.5e+3, 0x1f, 1:30], y: ~}\nb: {<<: *a, c: *a}\n",
    "a: &a [lol]\nb: &b [*a, *a, *a]\nc: &c [*b, *b, *b]\nd: [*c, *c]\n",
    "a: &a [*a]\n",
    "a: !!int ''\nb: !!timestamp foo\nc: !<x> 1\n",
    "a: 2020-01-01t10:00:00+01:00\nb: 1:59:59.5\nc: .nan\nd: =\n",
)
WORDS = (
    "&a ", "*a", "<<: *a", "!!int ", "!!float ", "!!bool ", "!!timestamp ", "!!binary ", "!!set ", "! ", "? ", "0x", "0b1",
    "1:59:59", ".inf", ".nan", "1e308", "~", "---",
    "|\n ", "{", "[", ": ", "\x93NUMPY\x01\x00", "{'descr': '<f4', ", "PK\x03\x04",
)  # fmt: skip
"""What inputs are made of: the fuzzer does not find such words by itself."""
PGM = b"P5\n4 3\n255\n" + bytes(range(12))


LAYERS = np.full((3, 4), 0.5, np.float32), np.zeros(3), np.array(0.1)
BETWEEN_LAYERS = b"----"


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


def read_any_yaml(data: bytes) -> None:
    """Text as a file, as the value of --set over it, and in a message."""
    text = data.decode("utf-8", "replace")
    document = parse_mapping(text, "fuzz.yaml")
    short(apply_overrides(document, [f"set.here={text}"]))


def read_metadata(data: bytes) -> None:
    """The metadata.yaml of a rosbag2 folder with one recording in it."""
    folder = file_of(data, "bag/metadata.yaml").parent
    if not (folder / "a.mcap").exists():
        sample_mcap(folder / "a.mcap", "none", 2000)
    read_log(folder)


def read_layers(data: bytes) -> None:
    """layers.npz, or the three arrays in it: a changed byte of an archive is hardly more than a wrong checksum."""
    path = file_of(data, "layers.npz")
    parts = data.split(BETWEEN_LAYERS)
    if len(parts) == 3:
        with zipfile.ZipFile(path, "w") as archive:
            for name, part in zip(("", ".origin", ".resolution"), parts, strict=True):
                archive.writestr(f"probability{name}.npy", part)
    read_probability(path)


def read_depth(data: bytes) -> None:
    """A depth file of a CSV folder; its ValueErrors are counted as skipped."""
    with suppress(ValueError):
        read_floats(file_of(data, "depth.npy"))


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
    "objects": lambda data: read_objects(file_of(data, "objects.csv")),
    "layers": read_layers,
    "depth": read_depth,
    "yaml": read_any_yaml,
    "metadata": read_metadata,
    "config": read_config,
    "world": read_world,
    "sweep": lambda data: load_sweep(file_of(data, "sweep.yaml")),
}


def npy(values: NDArray[np.generic]) -> bytes:
    """An array as a file of numpy."""
    buffer = io.BytesIO()
    np.save(buffer, values)
    return buffer.getvalue()


def npz() -> bytes:
    """Good layers, as a run writes them."""
    geometry = GridGeometry(float(LAYERS[2]), (0.0, 0.0))
    path = scratch() / "seed.npz"
    write_layers(path, {"probability": GridLayer(LAYERS[0], geometry)})
    return path.read_bytes()


def seeds_of(name: str) -> Iterator[bytes]:
    """Good inputs to begin with."""
    if name == "mcap":
        for compression in ("none", "zstd"):
            yield sample_mcap(scratch() / "seed.mcap", compression, 2000).read_bytes()[:20_000]
    if name == "drawing":
        yield b"P5\n20 20\n255\n" + bytes(200) + b"\xff" * 200
    if name == "csv":
        yield f"{ODOM}\0{LAYOUT}\0".encode()
    if name == "layers":
        yield BETWEEN_LAYERS.join(map(npy, LAYERS))
    if name == "yaml":
        yield from (text.encode() for text in YAMLS[1:])
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
        "objects": b"id,class,x,y,yaw,moved\na,door,1,2,3,false\n",
        "layers": npz(),
        "depth": npy(LAYERS[0]),
        "yaml": YAMLS[0].encode(),
        "metadata": METADATA.encode(),
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
