"""stereo-bayes: a false match behind an obstacle (figures 8 and 9), maps by the likelihoods, the correlation of cells (2.3)."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from gridslam.maps.occupancy_correlation import fit_correlation
from gridslam.methods.stereo_bayes.config import StereoBayesConfig
from gridslam.report.figures.run_length_plot import correlation_picture
from gridslam.runs.run_config import load_config
from gridslam.simulation.scene import Scene
from gridslam.simulation.truth_map import true_map
from gridslam.simulation.world_config import load_world
from tests.benchmarks.stereo_models import BayesModel
from tests.benchmarks.stereo_pictures import BEHIND, OBSTACLE_M, VISIBLE, belief_of, false_match_scene
from tests.benchmarks.stereo_trials import LIKELIHOODS, drive_stage, mean_interval, score_of
from tests.papers.page import Experiment, PagePicture, Section
from tests.papers.work import Work, both, seeds_text

CPU_MINUTES = 4.0
SEEDS = range(6)
RATES = (0.0, 0.1, 0.2)
CONFIGS = {"paper": "paper/stereo-bayes", "best": "stereo-bayes"}
SHOWN = {"independent": "conventional", "occlusion": "occlusion alone", "chain": "occlusion and size"}
TEXT = """A robot makes an occupancy map with a stereo head. The paper's likelihood models that the first obstacle
on a ray hides the cells behind it (occlusion) and that obstacles are larger than a cell (a Markov chain along the ray);
the conventional one takes every cell before the one that explains the measurement as empty. The paper shows its results
as pictures of its laboratory, without figures; these are ours for the same comparisons."""
MAPS = """Rendered drives through rooms of about 6 x 5 m with five to eight boxes, 100 stereo pairs each, matched
by OpenCV, with added false matches in a fraction of the columns; poses from wheels and from an external camera. Mean
log-loss of all cells inside the room (0 is perfect), and intersection over union of the occupied cells."""
BEST = "The chain's log-loss is the lowest at every rate and with both settings (95 % intervals of paired differences)."
CORRELATION = """The correlation r0 of cells 5 cm apart, fitted to the lengths of runs of equal occupancy in
a known map (eq. 8); `gridslam correlation MAP` does it for any map."""
THIN = """Walls drawn one cell thick have short occupied stretches, so that r0 of a true map depends on how it
was drawn more than on the place; the best settings use 0.9."""
WORLDS = ("stereo-room", "office", "ir-room")


def section(work: Work) -> Section:
    """Figures 8 and 9, maps, correlation."""
    experiments = [false_match(), maps(work), correlation()]
    return Section("stereo-bayes", "stereo-bayes: occlusion and obstacle size", TEXT, experiments)


def config_of(config: str, likelihood: str) -> StereoBayesConfig:
    """One of the two settings with a likelihood."""
    found = load_config(CONFIGS[config], [f"method.likelihood={likelihood}"]).method
    assert isinstance(found, StereoBayesConfig)
    return found


def false_match() -> Experiment:
    """The probability of an obstacle before and after false matches behind it."""
    rows = []
    for likelihood in ("independent", "chain"):

        def change(config: str, likelihood: str = likelihood) -> str:
            before, after = (
                obstacle_of(config, likelihood, frames) for frames in (VISIBLE, [*VISIBLE, *BEHIND])
            )
            return f"{before:.3f} to {after:.3f}"

        published = {"independent": "is lost", "chain": "is kept"}[likelihood]
        rows.append((f"P of the obstacle, {SHOWN[likelihood]}", published, *both(change), "none"))
    picture = PagePicture(
        "stereo-false-match",
        cv2.cvtColor(false_match_scene(), cv2.COLOR_GRAY2RGB),
        "Before (left) and after the false matches (right); above the conventional likelihood, below the paper's",
    )
    text = "In a room known to be free an obstacle is visible in six frames; in two more there are false matches behind it."
    return Experiment("A false match behind an obstacle (figures 8 and 9)", text, rows, [picture])


def obstacle_of(config: str, likelihood: str, frames: list[float]) -> float:
    """The largest probability of the cells at the surface of the obstacle, straight ahead."""
    layer = belief_of(config_of(config, likelihood), frames).layer()
    row, col = layer.geometry.cells(np.array([[OBSTACLE_M, 0.01]]))[0]
    return float(layer.values[row, col - 1 : col + 2].max())


def maps(work: Work) -> Experiment:
    """Log-loss and IoU of whole maps."""
    seeds = work.seeds(SEEDS)
    found = work.each("rooms", scores_of_seed, SEEDS)
    rows = []
    for rate in RATES:
        for likelihood in LIKELIHOODS:

            def score(config: str, rate: float = rate, likelihood: str = likelihood) -> str:
                loss, iou = np.mean([one[config][f"{rate}"][likelihood] for one in found], axis=0)[:2]
                return f"{loss:.3f} nat, {iou:.2f}"

            rows.append((f"{rate:.0%} false, {SHOWN[likelihood]}", None, *both(score), seeds_text(seeds)))
    return Experiment("Maps by the three likelihoods", MAPS, rows, short=verdict(found))


def scores_of_seed(seed: int) -> dict[str, Any]:
    """Log-loss, IoU and lost pieces by settings, rate of false matches, and likelihood."""
    found: dict[str, Any] = {config: {f"{rate}": {} for rate in RATES} for config in CONFIGS}
    for rate in RATES:
        for config in CONFIGS:
            stage = drive_stage(seed, rate, config_of(config, "chain"))
            for name in LIKELIHOODS:
                score = score_of(stage, BayesModel(config_of(config, name)))
                found[config][f"{rate}"][name] = [score.log_loss, score.iou, score.lost]
    return found


def verdict(found: list[dict[str, Any]]) -> str:
    """A sentence on where the chain is not better than the others, if anywhere."""
    if len(found) < 2:
        return ""
    worse = []
    for config, rate, other in (
        (c, s, o) for c in CONFIGS for s in RATES for o in LIKELIHOODS if o != "chain"
    ):
        gains = [one[config][f"{rate}"][other][0] - one[config][f"{rate}"]["chain"][0] for one in found]
        if mean_interval(np.array(gains))[0] <= 0.0:
            worse.append(
                f"{rate:.0%} false matches, {SHOWN[other]} ({'best' if config == 'best' else 'paper'} settings)"
            )
    if not worse:
        return BEST
    return f"The chain's log-loss is not significantly lower than that of: {'; '.join(worse)}."


def correlation() -> Experiment:
    """r0 of known maps."""
    rows: list[tuple[object, ...]] = [("the paper's laboratory", 0.978, "0.978 (adopted)", None, "-")]
    fits = {}
    for name in WORLDS:
        world, path = load_world(name)
        fits[name] = fit_correlation(true_map(Scene(world, path.parent), world.truth))
        text = f"{fits[name].r0_at_5cm:.4f} +- {fits[name].standard_error:.4f}"
        rows.append((f"true map of the world {name}", None, text, None, "0"))
    png = np.frombuffer(correlation_picture(fits["office"], "office"), np.uint8)
    picture = PagePicture(
        "stereo-correlation",
        np.asarray(cv2.imdecode(png, cv2.IMREAD_COLOR)[..., ::-1], np.uint8),
        "Lengths of occupied and free runs in the world `office`, measured and by r0",
    )
    return Experiment("Correlation of neighbouring cells (section 2.3)", CORRELATION, rows, [picture], THIN)
