from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from gridslam.logs.codecs import cloud

SIGNALLING_NAN = np.array([0x7F800001], np.uint32).view(np.float32)


@pytest.mark.parametrize("unusable", [SIGNALLING_NAN, [np.nan], [np.inf], [-np.inf], [3e38]])
def test_times_that_are_no_numbers_are_kept_as_such_without_a_warning(
    monkeypatch: pytest.MonkeyPatch, unusable: list[float]
) -> None:
    column = np.concatenate([np.array([0.0, 0.05], np.float32), np.asarray(unusable, np.float32)])
    monkeypatch.setattr(cloud, "_column", lambda message, field: column)
    offsets = cloud._offsets_s(SimpleNamespace(), None, 10**18)
    assert offsets.shape == (3,)
    assert offsets.dtype == np.float32


def test_times_of_which_none_is_a_number_do_no_harm(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cloud, "_column", lambda message, field: np.full(2, np.nan))
    assert np.isnan(cloud._offsets_s(SimpleNamespace(), None, 0)).all()
