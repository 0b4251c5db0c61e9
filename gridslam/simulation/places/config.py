"""The section `place` of a world file: a large place that is made by seed instead of being listed wall by wall."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from gridslam.config.base import StrictModel

Kind = Literal["office", "corridors", "campus"]


class Place(StrictModel):
    """Kind and seed of a generated place, and the length of the drive through it.

    The place depends on `kind` and `seed` alone: a longer travel visits the same corridors more often.
    """

    kind: Kind
    seed: Annotated[int, Field(ge=0)] | None = None  # absent: the seed of the world
    travel_m: Annotated[float, Field(ge=100.0, le=20_000.0)] = 2000.0
