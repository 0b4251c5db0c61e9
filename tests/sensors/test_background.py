from __future__ import annotations

import numpy as np

from gridslam.sensors.background import ColourBackground, DepthBackground

ROWS, COLS = 60, 80


def scene(rng: np.random.Generator, level: float = 0.0) -> np.ndarray:
    """A noisy picture of a textured static scene; `level` is the brightness that a lamp adds."""
    texture = np.random.default_rng(7).uniform(60.0, 160.0, (ROWS, COLS, 3))
    return np.clip(texture + level + rng.normal(0.0, 1.5, texture.shape), 0, 255).astype(np.uint8)


def learned(rng: np.random.Generator) -> ColourBackground:
    background = ColourBackground(100, 16.0, opening_px=3, closing_px=5)
    for _ in range(10):
        background.foreground(scene(rng))
    return background


def test_moving_objects_are_foreground_and_the_scene_is_not() -> None:
    rng = np.random.default_rng(0)
    background = learned(rng)
    picture = scene(rng)
    picture[20:40, 30:45] = (210, 40, 30)
    mask = background.foreground(picture)
    truth = np.zeros((ROWS, COLS), bool)
    truth[20:40, 30:45] = True
    assert mask[truth].mean() > 0.95
    assert mask[~truth].mean() < 0.02


def test_specks_are_removed_and_holes_are_filled() -> None:
    rng = np.random.default_rng(1)
    background = learned(rng)
    picture = scene(rng)
    picture[20:40, 30:45] = (210, 40, 30)
    picture[30, 37] = scene(rng)[30, 37]  # a hole
    picture[5, 5] = picture[50, 70] = (255, 0, 0)  # specks
    mask = background.foreground(picture)
    assert mask[30, 37]
    assert not mask[5, 5]
    assert not mask[50, 70]


def test_a_lamp_makes_all_pixels_foreground_until_the_model_is_restarted() -> None:
    rng = np.random.default_rng(2)
    background = learned(rng)
    assert background.foreground(scene(rng, 60.0)).mean() > 0.5
    background.restart()
    for _ in range(5):
        mask = background.foreground(scene(rng, 60.0))
    assert mask.mean() < 0.02


def wall(rng: np.random.Generator, depth_m: float = 4.0) -> np.ndarray:
    return (depth_m + rng.normal(0.0, 0.02, (ROWS, COLS))).astype(np.float32)


def test_objects_before_the_background_are_nearer() -> None:
    rng = np.random.default_rng(3)
    background = DepthBackground(margin_m=0.08, margin_ratio=0.03)
    assert not background.nearer(wall(rng)).any()  # nothing is known yet
    for _ in range(20):
        background.learn(wall(rng))
    picture = wall(rng)
    picture[10:30, 10:20] = 2.5
    picture[50:, :] = np.nan
    near = background.nearer(picture)
    assert near[10:30, 10:20].all()
    assert near.sum() == 200


def test_an_object_of_the_first_frame_is_forgotten_when_it_leaves_and_a_person_is_not_learned_within_a_minute() -> (
    None
):
    rng = np.random.default_rng(4)
    background = DepthBackground(0.08, 0.03)
    occupied = wall(rng)
    occupied[10:30, 10:20] = 2.5
    background.learn(occupied)
    background.learn(wall(rng))
    assert not background.nearer(wall(rng)).any()
    for _ in range(120):  # a minute at two frames a second
        background.learn(occupied)
    assert background.nearer(occupied)[10:30, 10:20].all()
