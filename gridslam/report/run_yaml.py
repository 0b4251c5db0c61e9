"""run.yaml: the resolved configuration; a run from it gives the same bytes."""

from __future__ import annotations

from pathlib import Path

import yaml

from gridslam.core.files import write_atomic
from gridslam.report.environment import made_with
from gridslam.run import Run

HEADER = """\
# gridslam {command} {log} -c run.yaml {given}-o DIR
# gives the same map, trajectory, layers and tables again, byte for byte, under the versions below.
"""


def write_run_yaml(path: Path, run: Run) -> None:
    """Write every setting of the method, also those left at their defaults, the seed and the versions.

    Of the `log` section only what was set is written: there, an absent key means "find it in the log".
    """
    config = run.config.model_copy(update={"made_with": made_with()})
    document = config.model_dump(mode="json")
    document["log"] = config.log.model_dump(mode="json", exclude_unset=True)
    given = "--map MAP.yaml " if run.command == "localize" else ""
    log = " ".join(run.log_path.name.split())
    header = HEADER.format(command=run.command, log=log, given=given)
    settings = yaml.safe_dump(document, sort_keys=False, allow_unicode=True)
    # A file name need not be text: what is not becomes a question mark in the comment.
    write_atomic(path, header.encode(errors="replace") + settings.encode())
