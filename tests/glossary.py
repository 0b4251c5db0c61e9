"""The project's words: what is not written, what is written instead, and where an exception holds.

`python -m tests.glossary` counts the words that should not be there; `tests/test_glossary.py` holds the count at zero.
"""

from __future__ import annotations

import keyword
import re
import sys
import tokenize
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parent.parent
SOURCES = ("gridslam", "cli", "configs", "tests")
PAGES = ("docs", "README.md")

# A word of an identifier (`least_fit` and `LeastFit` have the words least and fit), and what is written instead.
WORDS = {
    "least": "min, or the quantity's limit",
    "most": "max, or the quantity's limit",
    "way": "path, route, travel_m, distance_m, free_space",
    "ways": "paths, routes",
    "told": "observed, evidence, reported",
    "tell": "report, apply_update",
    "tells": "reports",
    "telling": "reporting",
    "thing": "object, ObjectModel",
    "things": "objects",
    "stay": "episode",
    "stays": "episodes",
    "been": "visited",
    "mounting": "extrinsics",
    "mountings": "extrinsics",
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

# Identifiers that hold such a word and are right, with the reason.
ALLOWED_IDENTIFIERS = {
    "at_least": "numpy and scipy: atleast",
    "atleast_1d": "numpy",
    "atleast_2d": "numpy",
    "least_squares": "the field's own; scipy.optimize",
    "least_squares_cost": "the field's own",
    "turn_on_spot": "a robot turning on the spot",
    "turns_on_spot": "a robot turning on the spot",
    "most_common": "collections.Counter",
    "ROS2_HUMBLE": "the ROS release",
    "HUMBLE": "the ROS release",
    "STEREO_SGBM_MODE_SGBM_3WAY": "OpenCV",
    "tell": "a file's position",
    "outline": "Pillow's colour of a border; keys of older tag databases",
    "fix": "a table of older CSV logs",
    "sharex": "matplotlib",
    "sharey": "matplotlib",
}

# Phrases of docstrings, comments, messages and pages that nobody understands at first reading.
PHRASES = (
    r"\bso many\b",
    r"\ball that was\b",
    r"\bwhat (?:is|was) asked\b",
    r"\bby more than this\b",
    r"\band so well at least\b",
    r"\bmountings?\b",
    r"\bledgers?\b",
    r"\bhindsight\b",
    r"\btold across\b",
    r"\bdrawing m\b",
    r"\bwhat came of it\b",
    r"\b(?:a|the) fix(?:es)?\b",
    r"\b(?:its|slow|the|their) twins?\b",
    r"\bfinal stage\b",
    r"\bpose fix(?:es)?\b",
    r"\bsteps? back\b",
)

_WORD = re.compile(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+")
_PHRASE = re.compile("|".join(PHRASES), re.IGNORECASE)
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
        yield from identifiers_of(file)
    for file in _files((*SOURCES, *PAGES), (".py", ".yaml", ".md", ".j2", ".html")):
        yield from phrases_of(file)


def identifiers_of(file: Path) -> Iterator[Finding]:
    """Identifiers of a Python file with a word of the table."""
    with (REPOSITORY / file).open("rb") as source:
        for token in tokenize.tokenize(source.readline):
            name = token.string
            if token.type != tokenize.NAME or keyword.iskeyword(name) or name in ALLOWED_IDENTIFIERS:
                continue
            if name.startswith("test_"):
                continue  # a sentence, not a name
            for word in _WORD.findall(name):
                if word.lower() in WORDS:
                    yield Finding(file, token.start[0], name, WORDS[word.lower()])
                    break


def phrases_of(file: Path) -> Iterator[Finding]:
    """Phrases of the list in a text file."""
    for number, line in enumerate((REPOSITORY / file).read_text(encoding="utf-8").splitlines(), start=1):
        for match in () if _OLDER_KEYS.search(line) else _PHRASE.finditer(line):
            yield Finding(file, number, match.group())


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
