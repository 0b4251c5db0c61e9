"""The onboard weight of particles by the lidar model that the config names."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from gridslam.core.arrays import evenly_spaced
from gridslam.methods.ispace_mcl.config import LidarWeightName
from gridslam.sensors.beam_model import BeamMixture, BeamModel, range_difference_log_likelihood
from gridslam.sensors.lidar_beams import Beams
from gridslam.sensors.likelihood_field import DistanceField, log_likelihood_table
from gridslam.sensors.range_caster import range_caster
from gridslam.sensors.surface_points import first_in_squares

Floats = NDArray[np.float64]
# Of a scan, poses (n, 3) and moving objects (k, 2): log-weights (n,)
LogWeight = Callable[[Beams, Floats, Floats], Floats]

# Of a beam's endpoint about a wall: lidar noise, map cells and pose error within a cell
ENDPOINT_STD_M = 0.15
RANDOM_WEIGHT = 0.1  # weight of beams that anything may cause, people above all
SPACING_M = 0.3  # of the endpoints: one in each square of this size, or what is near to the robot would count for most
FIELD_BEAM_WEIGHT = 0.15  # power of a beam's likelihood: neighbouring beams have common errors
MOVING_RADIUS_M = 0.3  # a beam that ends nearer to a detection of the fixed cameras is half explained

MIXTURE = BeamMixture(
    sigma_m=0.3,  # wider than the sensor's noise, so that a particle half a cell off is not rejected
    hit=0.65,
    short=0.1,
    max=0.05,
    random=0.2,
    short_decay_per_m=0.2,
    bin_m=0.05,
)
# Power of a beam's likelihood; lower than for the field, as ranges err more in common
MIXTURE_BEAM_WEIGHT = 0.05

RANGE_DIFFERENCE_STD_M = 0.5  # sigma of the paper's eq. 4, which the paper does not state


def log_weight_of(
    name: LidarWeightName, field: DistanceField, occupied: NDArray[np.bool_], max_beams: int
) -> LogWeight:
    """The function that returns the log-weights of poses on a map of occupied cells `(rows, cols)`, by `max_beams` beams at most.

    On the likelihood field, a beam that ends where the fixed cameras detect a moving object counts as half explained. The
    robot's own body needs no exception, because no beam ends in it. The other two models ignore the cameras.
    """
    if name == "likelihood-field":
        return likelihood_field_weight(field, max_beams)
    caster = range_caster(occupied, field.geometry)
    if name == "beam":
        model = BeamModel(caster, MIXTURE)
        return lambda beams, poses, moving: (
            MIXTURE_BEAM_WEIGHT * model.log_likelihood(beams.subsampled(max_beams), poses)
        )
    return lambda beams, poses, moving: range_difference_log_likelihood(
        caster, beams.subsampled(max_beams), poses, RANGE_DIFFERENCE_STD_M
    )


def likelihood_field_weight(field: DistanceField, max_beams: int) -> LogWeight:
    """The log-weight of the likelihood field, by beams that end at least about SPACING_M apart."""
    table = log_likelihood_table(field, ENDPOINT_STD_M, RANDOM_WEIGHT)
    half_explained = int(np.argmax(table <= 0.5 * table.min()))

    def log_weight(beams: Beams, poses: Floats, moving: Floats) -> Floats:
        known = field.with_objects(moving, MOVING_RADIUS_M, half_explained) if len(moving) else field
        apart = np.sort(first_in_squares(beams.points, SPACING_M))
        used = beams.points[apart[evenly_spaced(len(apart), max_beams)]]
        return FIELD_BEAM_WEIGHT * known.table_sums(table, used, poses)

    return log_weight
