"""Which localizations are not trusted, and what the user is asked to check."""

from __future__ import annotations

import numpy as np
import pytest

from gridslam.maps.occupancy import GridGeometry, OccupancyGrid
from gridslam.methods.ispace_mcl.doubt import doubt_of

WALLS = 0.65


def room(negated: bool = False) -> OccupancyGrid:
    """A free room with a wall around it; negated, the walls are free and the room is a wall."""
    probability = np.full((40, 60), 0.95, np.float32)
    probability[1:-1, 1:-1] = 0.05
    return OccupancyGrid(1.0 - probability if negated else probability, GridGeometry(0.1, (0.0, 0.0)))


@pytest.mark.parametrize(
    "statuses",
    [
        ["lost"] * 10 + ["localized"] * 90,
        ["lost"] * 70 + ["localized"] * 30,  # found late, and held
        ["localized"] * 90 + ["uncertain"] * 10,  # people at the end
        [],
    ],
)
def test_a_robot_that_was_found_and_held_is_trusted(statuses: list[str]) -> None:
    assert doubt_of(statuses, room(), WALLS) is None


@pytest.mark.parametrize(
    ("statuses", "line"),
    [
        (
            ["localized"] * 7 + ["lost"] * 93,
            "localized 7 % of the time, lost at the end; does this map belong",
        ),
        (["localized"] * 80 + ["lost"] * 20, "localized 80 % of the time, lost at the end"),
        (["uncertain"] * 100, "localized 0 % of the time, uncertain at the end"),
    ],
)
def test_a_robot_that_was_rarely_localized_or_lost_at_the_end_is_lost(statuses: list[str], line: str) -> None:
    doubt = doubt_of(statuses, room(), WALLS)
    assert doubt is not None
    assert doubt.status == "lost"
    assert doubt.reason.startswith(line)


def test_a_map_of_walls_is_suspected_to_be_negated() -> None:
    doubt = doubt_of(["lost"] * 10, room(negated=True), WALLS)
    assert doubt is not None
    assert "`negate`" in doubt.reason
