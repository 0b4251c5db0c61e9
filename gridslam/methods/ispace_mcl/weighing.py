"""The onboard weight of particles, by the model that the config chooses."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from gridslam.methods.ispace_mcl.config import BeamConfig, LikelihoodFieldConfig, RangeDifferenceConfig
from gridslam.sensors.beam_model import BeamMixture, BeamModel, range_difference_log_likelihood
from gridslam.sensors.lidar_beams import Beams
from gridslam.sensors.likelihood_field import DistanceField, log_likelihood_table
from gridslam.sensors.range_caster import range_caster

Floats = NDArray[np.float64]
LogWeight = Callable[[Beams, Floats, Floats], Floats]  # of poses (n, 3), where (k, 2) moves something: (n,)


def log_weight_of(
    config: LikelihoodFieldConfig | BeamConfig | RangeDifferenceConfig,
    field: DistanceField,
    occupied: NDArray[np.bool_],
) -> LogWeight:
    """The function that gives log-weights to poses on this map.

    On the likelihood field, a beam that ends where the fixed cameras see something move counts half as much as one that nothing
    explains. A hypothesis' own body needs no exception: no beam ends in it. The other two models take such beams as they are.
    """
    if isinstance(config, LikelihoodFieldConfig):
        return _on_field(config, field)
    caster = range_caster(occupied, field.geometry)
    if isinstance(config, BeamConfig):
        values = config.model_dump(exclude={"kind", "beam_weight"})
        model, share = BeamModel(caster, BeamMixture(**values)), config.beam_weight
        return lambda beams, poses, moving: share * model.log_likelihood(beams, poses)
    sigma_m = config.sigma_m
    return lambda beams, poses, moving: range_difference_log_likelihood(caster, beams, poses, sigma_m)


def _on_field(config: LikelihoodFieldConfig, field: DistanceField) -> LogWeight:
    table = log_likelihood_table(field, config.sigma_m, config.random_share)
    half = int(np.argmax(table <= 0.5 * table.min()))

    def log_weight(beams: Beams, poses: Floats, moving: Floats) -> Floats:
        known = field.near(moving, config.moving_radius_m, half) if len(moving) else field
        return config.beam_weight * known.sums(table, beams.points, poses)

    return log_weight
