"""stereo-bayes: a false match behind an obstacle (figures 8 and 9), maps by the likelihoods, the correlation of cells (2.3)."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from gridslam.maps.occupancy_correlation import fit_correlation
from gridslam.methods.stereo_bayes.config import StereoBayesConfig
from gridslam.report.run_length_plot import correlation_picture
from gridslam.runs.run_config import load_run_config
from gridslam.simulation.scene import Scene
from gridslam.simulation.truth_map import true_map
from gridslam.simulation.world_config import load_world
from tests.benchmarks.stereo_models import Believed
from tests.benchmarks.stereo_pictures import BEHIND, OBSTACLE_M, SEEN, belief_of, false_match_scene
from tests.benchmarks.stereo_trials import LIKELIHOODS, drive_stage, mean_interval, score_of
from tests.papers.page import Experiment, Picture, Section
from tests.papers.work import Work, both, seeds_text

CPU_MINUTES = 4.0
SEEDS = range(6)
SHARES = (0.0, 0.1, 0.2)
CONFIGS = {"paper": "paper/stereo-bayes", "best": "stereo-bayes"}
SHOWN = {"independent": "conventional", "occlusion": "occlusion alone", "chain": "occlusion and size"}
TEXT = """A robot makes an occupancy map of what its stereo head sees. The paper's likelihood knows that the first
obstacle on a ray hides the rest (occlusion) and that obstacles are larger than a cell (a Markov chain along the
ray); the conventional one takes every cell before the one that explains the measurement for empty. The paper shows
its results as pictures of its laboratory, without figures; these are ours for the same comparisons."""
MAPS = """Rendered drives through rooms of about 6 x 5 m with five to eight boxes, 100 stereo pairs each, matched
by OpenCV, with a share of falsely matched columns put in; poses by wheels and the fixes of a camera outside. Mean
log-loss of all cells inside the room (0 is perfect), and intersection over union of the occupied cells."""
BEST = "The chain's log-loss is the least at every share and with both settings (95 % intervals of paired differences)."
CORRELATION = """The correlation r0 of cells 5 cm apart, fitted to the distances over which occupancy goes on in a
known map (eq. 8); `gridslam correlation MAP` does it for any map."""
THIN = """Walls drawn one cell thick have short occupied stretches, so r0 of a true map tells how it was drawn more
than what the place is like; the best settings use 0.9."""
WORLDS = ("stereo-room", "office", "ir-room")


def section(work: Work) -> Section:
    """Figures 8 and 9, maps, correlation."""
    experiments = [false_match(), maps(work), correlation()]
    return Section("stereo-bayes", "stereo-bayes: occlusion and obstacle size", TEXT, experiments)


def config_of(config: str, likelihood: str) -> StereoBayesConfig:
    """One of the two settings with a likelihood."""
    found = load_run_config(CONFIGS[config], [f"method.likelihood={likelihood}"]).method
    assert isinstance(found, StereoBayesConfig)
    return found


def false_match() -> Experiment:
    """An obstacle is seen, then something behind it: what does the map say of the obstacle?"""
    rows = []
    for likelihood in ("independent", "chain"):

        def change(config: str, likelihood: str = likelihood) -> str:
            before, after = (obstacle_of(config, likelihood, frames) for frames in (SEEN, [*SEEN, *BEHIND]))
            return f"{before:.3f} to {after:.3f}"

        published = {"independent": "is given up", "chain": "stays"}[likelihood]
        rows.append((f"P of the obstacle, {SHOWN[likelihood]}", published, *both(change), "none"))
    picture = Picture(
        "stereo-false-match",
        cv2.cvtColor(false_match_scene(), cv2.COLOR_GRAY2RGB),
        "Before (left) and after the false matches (right); above the conventional likelihood, below the paper's",
    )
    what = "In a room known to be free an obstacle is seen in six frames; in two more something is matched behind it."
    return Experiment("A false match behind an obstacle (figures 8 and 9)", what, rows, [picture])


def obstacle_of(config: str, likelihood: str, frames: list[float]) -> float:
    """The probability of the cells at the obstacle's surface, straight ahead: the largest of them."""
    layer = belief_of(config_of(config, likelihood), frames).layer()
    row, col = layer.geometry.cells(np.array([[OBSTACLE_M, 0.01]]))[0]
    return float(layer.values[row, col - 1 : col + 2].max())


def maps(work: Work) -> Experiment:
    """Log-loss and IoU of whole maps."""
    seeds = work.seeds(SEEDS)
    found = work.each("rooms", scores_of_seed, SEEDS)
    rows = []
    for share in SHARES:
        for likelihood in LIKELIHOODS:

            def told(config: str, share: float = share, likelihood: str = likelihood) -> str:
                loss, iou = np.mean([one[config][f"{share}"][likelihood] for one in found], axis=0)[:2]
                return f"{loss:.3f} nat, {iou:.2f}"

            rows.append((f"{share:.0%} false, {SHOWN[likelihood]}", None, *both(told), seeds_text(seeds)))
    return Experiment("Maps by the three likelihoods", MAPS, rows, short=verdict(found))


def scores_of_seed(seed: int) -> dict[str, Any]:
    """Log-loss, IoU and lost pieces by settings, share of false matches, and likelihood."""
    found: dict[str, Any] = {config: {f"{share}": {} for share in SHARES} for config in CONFIGS}
    for share in SHARES:
        for config in CONFIGS:
            stage = drive_stage(seed, share, config_of(config, "chain"))
            for name in LIKELIHOODS:
                score = score_of(stage, Believed(config_of(config, name)))
                found[config][f"{share}"][name] = [score.log_loss, score.iou, score.lost]
    return found


def verdict(found: list[dict[str, Any]]) -> str:
    """Where the chain is not better than the others, if anywhere."""
    if len(found) < 2:
        return ""
    worse = []
    for config, share, other in (
        (c, s, o) for c in CONFIGS for s in SHARES for o in LIKELIHOODS if o != "chain"
    ):
        gains = [one[config][f"{share}"][other][0] - one[config][f"{share}"]["chain"][0] for one in found]
        if mean_interval(np.array(gains))[0] <= 0.0:
            worse.append(
                f"{share:.0%} false matches, {SHOWN[other]} ({'best' if config == 'best' else 'paper'} settings)"
            )
    if not worse:
        return BEST
    return f"The chain's log-loss is not surely less than that of: {'; '.join(worse)}."


def correlation() -> Experiment:
    """r0 of known maps."""
    rows: list[tuple[object, ...]] = [("the paper's laboratory", 0.978, "0.978 (taken over)", None, "-")]
    fits = {}
    for name in WORLDS:
        world, path = load_world(name)
        fits[name] = fit_correlation(true_map(Scene(world, path.parent), world.truth))
        text = f"{fits[name].r0_at_5cm:.4f} +- {fits[name].standard_error:.4f}"
        rows.append((f"true map of the world {name}", None, text, None, "0"))
    png = np.frombuffer(correlation_picture(fits["office"], "office"), np.uint8)
    picture = Picture(
        "stereo-correlation",
        np.asarray(cv2.imdecode(png, cv2.IMREAD_COLOR)[..., ::-1], np.uint8),
        "How far occupied and free stretches go on in the world `office`, measured and by r0",
    )
    return Experiment("Correlation of neighbouring cells (section 2.3)", CORRELATION, rows, [picture], THIN)
