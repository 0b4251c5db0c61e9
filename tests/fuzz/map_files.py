"""Maps of map_server whose YAML or picture is odd."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import yaml
from PIL import Image

from tests.fuzz.targets import MAP_YAML
from tests.fuzz.value_trees import number_near


def write_odd_map(folder: Path, rng: random.Random) -> Path:
    """A map_server pair: values of the YAML, and bytes or the size of the image, are changed; the YAML's path."""
    folder.mkdir(exist_ok=True)
    document = yaml.safe_load(MAP_YAML)
    suffix = rng.choice((".pgm", ".png", ".bmp", ".tif"))
    document["image"] = f"map{suffix}"
    for key in rng.sample(list(document)[1:], rng.choice((0, 0, 1, 2))):
        document[key] = number_near(document[key], rng)
    if rng.random() < 0.1:
        document["mode"] = rng.choice(("scale", "raw", "Trinary", "x", 3))
    shape = rng.choice(((3, 4), (1, 1), (40, 30), (2, 3000)))
    depth = rng.choice(("L", "L", "RGBA", "I;16", "1", "P"))
    cells = np.random.default_rng(rng.randrange(99)).integers(0, 256, shape).astype(np.uint8)
    picture = Image.fromarray(cells)
    image = folder / f"map{suffix}"
    picture = picture.convert(depth) if depth != "I;16" else Image.fromarray(cells.astype(np.uint16) * 257)
    try:
        picture.save(image)
    except OSError:
        Image.fromarray(cells).save(image)
    if rng.random() < 0.4:
        data = bytearray(image.read_bytes())
        for _ in range(rng.choice((1, 2, 8))):
            at = rng.randrange(min(len(data), rng.choice((40, 400, 10**9))))
            data[at] = rng.choice((0, 255, 127, rng.randrange(256), ord("9")))
        image.write_bytes(data[: rng.randrange(len(data))] if rng.random() < 0.2 else data)
    path = folder / "map.yaml"
    path.write_text(yaml.dump(document).replace("\\uD800", "x"), "utf-8")
    return path
