from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

PAGE = Path(__file__).resolve().parents[2] / "docs" / "evaluation.md"


def test_the_example_of_the_page_runs(tmp_path: Path) -> None:
    example = re.search(r"```sh\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert example is not None
    program = f"{sys.executable} -c 'from gridslam.cli.main import run; run()'"
    script = f'gridslam() {{ {program} "$@"; }}\nset -e\n{example[1]}'
    done = subprocess.run(
        ["sh", "-c", script],
        cwd=tmp_path,
        env={"PYTHONPATH": str(PAGE.parents[1])},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == "gridslam: plots and measures are in out/evaluation/evaluation.html\n"
    assert "relations.trans.mean" in done.stdout
