"""run.yaml: the resolved configuration, from which a run can be reproduced byte for byte."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

import yaml
from pydantic import BaseModel

from gridslam.core.files import write_atomic
from gridslam.methods.registry import option_words
from gridslam.report.environment import made_with
from gridslam.runs.run import Run
from gridslam.runs.run_config import RunConfig

FILE_NAME = "run.yaml"
HEADER = """\
# {command}
# reproduces {what} byte for byte, with the versions below.
"""


def write_run_yaml(path: Path, run: Run) -> None:
    """Write all settings including defaults, the seed and the versions."""
    document = settings_of(run.config.model_copy(update={"made_with": made_with()}))
    what = "map and trajectory" if run.command == "explore" else "map, trajectory, layers and tables"
    header = HEADER.format(command=command_again(run), what=what)
    settings = yaml.safe_dump(document, sort_keys=False, allow_unicode=True)
    # File names may have bytes that are not text: they become question marks in the comment.
    write_atomic(path, header.encode(errors="replace") + settings.encode())


def command_again(run: Run) -> str:
    """The command that reproduces the result of a run; for an exploration, the command that maps its log."""
    command = "map" if run.command == "explore" else run.command
    logs = [path.name for path in (*run.earlier_logs, run.log_path)]
    words = ["gridslam", command, *logs, "-c", FILE_NAME]
    for name, file in run.given.items():
        words += option_words(name, file)
    return " ".join(shlex.quote(" ".join(word.split())) for word in [*words, "-o", "DIR"])


def settings_of(config: RunConfig[BaseModel]) -> dict[str, Any]:
    """The resolved settings in YAML types, from which the same configuration can be read.

    The section `log` has only the keys that were set, since the value of an absent key is found in the log.
    """
    document = config.model_dump(mode="json")
    document["log"] = config.log.model_dump(mode="json", exclude_unset=True)
    return document
