"""What docs/architecture.md promises of another type of CPU, which OpenBLAS and NumPy imitate on this one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.conftest import REPOSITORY, Program

OTHER_CPU = {
    "OPENBLAS_CORETYPE": "Nehalem",  # without AVX and fused multiply-add
    "NPY_DISABLE_CPU_FEATURES": "AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL AVX512_SPR AVX2 FMA3",
}
LAST_DIGITS = 1e-9  # m, rad, s


def test_maps_are_the_same_bytes_and_tables_the_same_but_for_last_digits(
    process: Program, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = REPOSITORY / "sample_logs" / "ir-scan.mcap"
    arguments = ("map", log, "-c", "ir-scan", "--end", "60", "-o")
    done = [process(*arguments, tmp_path / "this")]
    for name, value in OTHER_CPU.items():
        monkeypatch.setenv(name, value)
    done.append(process(*arguments, tmp_path / "other"))
    assert [d.returncode for d in done] == [0, 0], [d.stderr for d in done]
    for name in ("map.pgm", "map.yaml"):
        assert (tmp_path / "this" / name).read_bytes() == (tmp_path / "other" / name).read_bytes(), name
    for name, separator, header in (("trajectory.tum", None, 0), ("stops.csv", ",", 1)):
        this, other = (
            np.genfromtxt(tmp_path / run / name, delimiter=separator, skip_header=header)
            for run in ("this", "other")
        )
        np.testing.assert_allclose(this, other, rtol=0.0, atol=LAST_DIGITS)
