"""run.yaml: the resolved configuration; a run from it gives the same bytes."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

import yaml
from pydantic import BaseModel

from gridslam.core.files import write_atomic
from gridslam.report.environment import made_with
from gridslam.runs.run import Run
from gridslam.runs.run_config import RunConfig

HEADER = """\
# {command}
# gives the same {what} again, byte for byte, under the versions below.
"""


def write_run_yaml(path: Path, run: Run) -> None:
    """Write every setting of the method, also those left at their defaults, the seed and the versions."""
    document = settings_of(run.config.model_copy(update={"made_with": made_with()}))
    what = "map and trajectory" if run.command == "explore" else "map, trajectory, layers and tables"
    header = HEADER.format(command=command_again(run), what=what)
    settings = yaml.safe_dump(document, sort_keys=False, allow_unicode=True)
    # A file name need not be text: what is not becomes a question mark in the comment.
    write_atomic(path, header.encode(errors="replace") + settings.encode())


def command_again(run: Run) -> str:
    """The command that makes the run's result again, in one line; an exploration's log is mapped."""
    command = "map" if run.command == "explore" else run.command
    words = ["gridslam", command, run.log_path.name, "-c", "run.yaml"]
    for option, name in run.given.items():
        words += [f"--{option}", name]
    return " ".join(shlex.quote(" ".join(word.split())) for word in [*words, "-o", "DIR"])


def settings_of(config: RunConfig[BaseModel]) -> dict[str, Any]:
    """The resolved settings in YAML's own types; a config made of them is the same.

    Of the `log` section only what was set is there: in it, an absent key means "find it in the log".
    """
    document = config.model_dump(mode="json")
    document["log"] = config.log.model_dump(mode="json", exclude_unset=True)
    return document
