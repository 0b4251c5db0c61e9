"""The pages as a site: built without network, every page in the navigation, every link and docstring found."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

from tests.conftest import REPOSITORY


def test_the_site_builds_without_a_warning_and_fetches_nothing(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path / "site")],
        cwd=REPOSITORY,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1", "https_proxy": "http://127.0.0.1:9"},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    pages = list((tmp_path / "site").glob("*.html"))
    assert {page.stem for page in (REPOSITORY / "docs").glob("*.md")} <= {page.stem for page in pages}
    loaded = [re.findall(r'(?:src|<link[^>]+href)="(https?://[^"]+)', page.read_text()) for page in pages]
    assert [url for urls in loaded for url in urls if "canonical" not in url] == []
    assert "map_log" in (tmp_path / "site" / "api.html").read_text()
