"""The project's words: what is not written, what is written instead, and where an exception holds.

`python -m tests.glossary` counts the words that should not be there; `tests/test_glossary.py` holds the count at zero.
"""

from __future__ import annotations

import re
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parent.parent
SOURCES = ("gridslam", "cli", "configs", "tests")
PAGES = ("docs", "README.md")

# A word of a name (`least_fit` and `LeastFit` have the words least and fit), and what is written instead. Names are identifiers,
# keys of YAML files, and texts that look like one: columns, keys, options, file names.
WORDS = {
    "least": "min, or the quantity's limit",
    "most": "max, or the quantity's limit",
    "way": "path, route, travel_m, distance_m, free_space",
    "ways": "paths, routes",
    "told": "observed, evidence, reported",
    "tell": "report, apply_update",
    "mount": "extrinsics",
    "mounts": "extrinsics",
    "mounted": "extrinsics",
    "tells": "reports",
    "telling": "reporting",
    "thing": "object, ObjectModel",
    "things": "objects",
    "stay": "episode",
    "stays": "episodes",
    "been": "visited",
    "mounting": "extrinsics",
    "mountings": "extrinsics",
    "fit": "inlier_ratio, match_score; only a fit of a model to data",
    "fits": "is_accepted, matches; only fits of a model to data",
    "turn": "yaw, rotation, heading_offset; a turn on the spot or in place only",
    "turns": "rotations, revolutions; turns on the spot or in place only",
    "begin": "origin, first, start",
    "broken": "odometry_jumped, interrupted, discontinuous",
    "agree": "compare_hypotheses, is_consistent",
    "agrees": "is_consistent, matches",
    "rough": "guide_path, initial",
    "fix": "absolute_pose; a GNSS fix only",
    "fixes": "absolute_poses",
    "reach": "max_range, search_radius, max_correspondence",
    "share": "fraction, ratio, weight",
    "shares": "fractions, weights",
    "spread": "std, covariance",
    "surprise": "acceleration_noise",
    "bend": "deform, correct",
    "bent": "deformed, corrected",
    "tied": "matched",
    "untied": "unmatched",
    "anchored": "matched",
    "hindsight": "smoothing",
    "contest": "compare_hypotheses",
    "contender": "hypothesis",
    "contenders": "hypotheses",
    "compete": "compare_hypotheses",
    "shy": "obstacle_weight",
    "shyness": "obstacle_weight",
    "dread": "inflation_radius",
    "spine": "guide_path",
    "steepest": "descend_cost_to_go",
    "sight": "visibility",
    "survey": "index",
    "surveyed": "indexed",
    "ledger": "message_counts",
    "deliver": "playback, events",
    "delivery": "playback",
    "delivered": "played_back",
    "stray": "outlier, false_read",
    "strays": "outliers, false_reads",
    "outline": "footprint, contour",
    "outlines": "footprints, contours",
    "spot": "kernel, splat",
    "spots": "kernels, splats",
    "outcome": "result",
    "outcomes": "results",
    "humble": "discounted, inflated",
    "twin": "reference",
    "twins": "references",
}

# Names whose words are right by themselves, and what is written instead.
NAMES = {
    "SeenScan": "BeamEndpoints, KeyScanObservation",
    "rough_way": "guide_path",
    "end_row": "endpoint_row; stop_row of a range",
    "end_col": "endpoint_col; stop_col of a range",
}

# Names that hold such a word and are right everywhere, with the reason.
ALLOWED_NAMES = {
    "at_least": "numpy and scipy: atleast; the limits of a bound",
    "at_most": "the limits of a bound",
    "least_squares": "the field's own; scipy.optimize",
    "most_common": "collections.Counter",
    "BrokenPipeError": "Python",
    "BrokenProcessPool": "Python",
    "ROS2_HUMBLE": "the ROS release",
    "HUMBLE": "the ROS release",
    "STEREO_SGBM_MODE_SGBM_3WAY": "OpenCV",
    "fitLine": "OpenCV",
}

# Names that are right in files with this part of a path, with the reason.
ALLOWED_IN = (
    ("gridslam/kernels/", {"begin"}, "the first item of a thread's range"),
    ("gridslam/maps/picture/", {"outline"}, "Pillow's colour of a border"),
    ("gridslam/report/", {"outline"}, "Pillow's colour of a border"),
    ("handmap_slam/driving/exploration_report.py", {"outline"}, "Pillow's colour of a border"),
    ("gridslam/core/numpy_files.py", {"tell"}, "a file's position"),
    ("gridslam/logs/mcap/file.py", {"tell"}, "a file's position"),
    ("tests/logs/mutations.py", {"tell"}, "a file's position"),
    ("gridslam/maps/tag_database.py", {"outline"}, "a key of older tag databases"),
    ("gridslam/logs/csv_layout.py", {"mounting"}, "a key of older log.yaml"),
    ("gridslam/logs/kinds.py", {"fix"}, "a table of older CSV logs"),
    ("tests/logs/test_csv_folder.py", {"fix"}, "a table of older CSV logs"),
    ("gridslam/sweep/config.py", {"reach_m"}, "a key of older sweeps"),
    (
        "gridslam/simulation/",
        {"mounting", "stray", "tail_share", "mixing_share", "ticks_per_turn", "spot_m", "turns", "fixes"},
        "keys of older world files",
    ),
    ("tests/simulation/", {"mounting", "stray", "tail_share", "turns", "fixes"}, "keys of older world files"),
    ("gridslam/simulation/", {"turn_radps", "turn_slip"}, "keys of world files: a robot's rotation"),
    ("configs/worlds/", {"turn_radps", "turn_slip"}, "keys of world files: a robot's rotation"),
    ("tests/", {"turn_radps", "turn_slip"}, "keys of world files: a robot's rotation"),
    ("gridslam/planning/", {"turn_rate_radps", "turn_acceleration_radps2"}, "a turn rate, as the field says"),
    (
        "cli/commands/plan.py",
        {"TurnRate", "turn_rate", "turn_rate_radps", "--turn-rate"},
        "a turn rate, as the field says",
    ),
    ("tests/fuzz/", {"--turn-rate"}, "a turn rate, as the field says"),
    ("gridslam/planning/", {"turn"}, "the kind of a segment: a turn on the spot"),
    ("cli/commands/plan.py", {"turn"}, "the kind of a segment: a turn on the spot"),
    ("tests/planning/", {"turn"}, "the kind of a segment: a turn on the spot"),
    ("cli/commands/evaluate.py", {"--reach"}, "an option, kept for those who use it"),
    ("gridslam/methods/handmap_slam/", {"fit", "fits"}, "fits of a drawing to a map"),
    ("gridslam/methods/handmap_slam/", {"agree", "agrees"}, "a state in words"),
    ("tests/methods/handmap_slam/", {"fits"}, "fits of a drawing to a map"),
    ("tests/benchmarks/bench_drawn_buildings.py", {"fits"}, "fits of a drawing to a map"),
    ("gridslam/lidar_slam/sensor_checks/sweep_calibration.py", {"fit"}, "numpy's fit of a polynomial"),
    ("slam_sd/objects/walls.py", {"FIT_ROUNDS", "FIT_ITERATIONS"}, "the fit of lines to points"),
    *(
        (
            file,
            {"CorrelationFit", "fit_correlation", "FitSeed", "fit", "fits"},
            "the fit of a correlation to a map",
        )
        for file in (
            "gridslam/maps/occupancy_correlation.py",
            "gridslam/report/figures/run_length_plot.py",
            "cli/commands/correlation.py",
            "tests/benchmarks/bench_plan.py",
            "tests/maps/test_occupancy_correlation.py",
            "tests/papers/stereo_bayes.py",
        )
    ),
)
# Words that are plain English in the sentence that a test's name is.
PLAIN_WORDS = {
    "most",
    "been",
    "spot",
    "turn",
    "turns",
    "fit",
    "fits",
    "begin",
    "broken",
    "agree",
    "agrees",
    "rough",
}

# Phrases of docstrings, comments, messages and pages that nobody understands at first reading.
PHRASES = (
    r"so many\b",
    r"all that was\b",
    r"what (?:is|was) asked\b",
    r"by more than this\b",
    r"and so well at least\b",
    r"mountings?\b",
    r"bends?\b",
    r"(?:gives?|given) on\b",
    r"(?:become|into) (?:such|these)\b",
    r"ledgers?\b",
    r"hindsight\b",
    r"told across\b",
    r"drawing m\b",
    r"what came of it\b",
    r"(?:a|the) fix(?:es)?\b",
    r"(?:its|slow|the|their) twins?\b",
    r"final stage\b",
    r"pose fix(?:es)?\b",
    r"steps? back\b",
    r"told\b",
    r"tells?\b(?!\()",
    r"(?:a|the|this|their|its) shares?\b",
    r"shares? of\b",
    r"survey(?:s|ed)?\b",
    r"deliver(?:s|ed|y)?\b",
    r"asked about\b",
    r"bent\b",
    r"(?-i:[Aa]n (?:[bcdfgjkpqtvwyz]|[lmnrsx](?=[a-z]{2})|h(?!on|our|eir))[a-z]+\b)",  # what replacements leave behind
    r"(?-i:[Aa] (?:[aei][a-z]{3,}|o(?!n[ce])[a-z]{2,}|u(?!n[ai]|s|ti)[a-z]{2,})\b)",
    r"on at lower\b",
)

_WORD = re.compile(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+")
_ON_SPOT = re.compile(
    r"_?(?:at_(?:least|most)|turns?_(?:on_(?:the_)?spot|in_place))|Turns?(?:OnSpot|InPlace)|turns?-on-spot"
)
_LIKE_A_NAME = re.compile(r"[A-Za-z0-9_.\-/]+")
_TOKEN = re.compile(  # of Python: long texts and comments have neither group
    r"""(?s:(\"{3}|'{3}).*?\1)|(?P<text>"(?:[^"\\\n]|\\.)*"|'(?:[^'\\\n]|\\.)*')|\#[^\n]*|(?P<name>[A-Za-z_]\w*)"""
)
_RIGHT: set[str] = set()  # names that were looked at before and are right in any file
_YAML_KEY = re.compile(r"([A-Za-z_]+):(?:\s|$)")
_RIDDLE = re.compile(r'^ *"""(?:What|Which|Where|When|How|Why|Nothing|None|As|If|So|And)\b', re.MULTILINE)
# One word boundary for all of them: one each takes three times as long.
_PHRASE = re.compile(r"\b(?:" + "|".join(PHRASES) + ")", re.IGNORECASE)
_EXEMPT = {Path("tests/glossary.py"), Path("tests/test_glossary.py")}
_OLDER_KEYS = re.compile(r"former_keys|Older|\"mounting\"")  # lines that read files with former names


@dataclass(frozen=True, slots=True)
class Finding:
    """A word or phrase that should not be there."""

    file: Path
    line: int
    text: str
    instead: str = ""

    def __str__(self) -> str:
        return f"{self.file}:{self.line}: {self.text}" + (
            f" (instead: {self.instead})" if self.instead else ""
        )


def findings() -> Iterator[Finding]:
    """All findings in code, configurations and pages."""
    for file in _files(SOURCES, (".py",)):
        yield from names_of(file)
    for file in _files(("gridslam", "cli"), (".py",)):
        yield from riddles_of(file)
    for file in _files(SOURCES, (".yaml",)):
        yield from keys_of(file)
    for file in _files((*SOURCES, *PAGES), (".py", ".yaml", ".md", ".j2", ".html")):
        yield from phrases_of(file)


def names_of(file: Path) -> Iterator[Finding]:
    """Identifiers of a Python file with a word of the table, and texts in it that look like a name."""
    source = (REPOSITORY / file).read_text(encoding="utf-8")
    for token in _TOKEN.finditer(source):
        name = token["name"] or (token["text"] or "")[1:-1]
        if name and name not in _RIGHT and (token["name"] or _LIKE_A_NAME.fullmatch(name)):
            found = list(_finding(file, source.count("\n", 0, token.start()) + 1, name))
            yield from found
            if not found and not _is_allowed_somewhere(name):
                _RIGHT.add(name)


def _is_allowed_somewhere(name: str) -> bool:
    return any(name in names for _, names, _ in ALLOWED_IN)


def keys_of(file: Path) -> Iterator[Finding]:
    """Keys of a YAML file with a word of the table."""
    for number, line in enumerate((REPOSITORY / file).read_text(encoding="utf-8").splitlines(), start=1):
        for key in _YAML_KEY.findall(line.partition("#")[0]):
            yield from _finding(file, number, key)


def _finding(file: Path, line: int, name: str) -> Iterator[Finding]:
    if name in ALLOWED_NAMES or any(top in str(file) and name in names for top, names, _ in ALLOWED_IN):
        return
    if name in NAMES:
        yield Finding(file, line, name, NAMES[name])
        return
    words = [word.lower() for word in _WORD.findall(_ON_SPOT.sub("", name))]
    if name.startswith("test_"):
        words = [word for word in words if word not in PLAIN_WORDS]
    for word in words:
        if word in WORDS:
            yield Finding(file, line, name, WORDS[word])
            return


def riddles_of(file: Path) -> Iterator[Finding]:
    """First lines of docstrings that begin as a question, instead of with what is returned or done."""
    source = (REPOSITORY / file).read_text(encoding="utf-8")
    for match in _RIDDLE.finditer(source):
        line = source.count("\n", 0, match.end()) + 1
        yield Finding(file, line, match.group().strip(), "what is returned or done, subject first")


def phrases_of(file: Path) -> Iterator[Finding]:
    """Phrases of the list in a text file."""
    text = (REPOSITORY / file).read_text(encoding="utf-8")
    for match in _PHRASE.finditer(text):
        line = text[text.rfind("\n", 0, match.start()) + 1 : text.find("\n", match.end()) % (len(text) + 1)]
        if not _OLDER_KEYS.search(line):
            yield Finding(file, text.count("\n", 0, match.start()) + 1, match.group())


def _files(roots: tuple[str, ...], suffixes: tuple[str, ...]) -> Iterator[Path]:
    for root in roots:
        top = REPOSITORY / root
        for path in sorted(top.rglob("*")) if top.is_dir() else [top]:
            relative = path.relative_to(REPOSITORY)
            if path.suffix in suffixes and "__pycache__" not in relative.parts and relative not in _EXEMPT:
                yield relative


def main(folders: list[str]) -> None:
    """Print every finding in the folders (all without any), and the counts by word."""
    found = [f for f in findings() if not folders or str(f.file).startswith(tuple(folders))]
    counts = Counter(f.text for f in found)
    for finding in found:
        print(finding)  # noqa: T201
    print(f"{len(found)} findings, {len(counts)} different")  # noqa: T201


if __name__ == "__main__":
    main(sys.argv[1:])
