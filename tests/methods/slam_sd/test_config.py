"""The settings of slam-sd are light to load."""

from __future__ import annotations

import subprocess
import sys


def test_the_config_is_loaded_without_numba_so_that_jobs_can_still_limit_its_threads() -> None:
    code = "import sys, gridslam.methods.slam_sd.config; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
