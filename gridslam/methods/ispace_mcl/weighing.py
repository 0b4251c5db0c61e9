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
LogWeight = Callable[[Beams, Floats], Floats]  # of poses (n, 3): (n,)


def log_weight_of(
    config: LikelihoodFieldConfig | BeamConfig | RangeDifferenceConfig,
    field: DistanceField,
    occupied: NDArray[np.bool_],
) -> LogWeight:
    """The function that gives log-weights to poses on this map."""
    if isinstance(config, LikelihoodFieldConfig):
        table = log_likelihood_table(field, config.sigma_m, config.random_share)
        power = config.beam_weight
        return lambda beams, poses: power * field.sums(table, beams.points, poses)
    caster = range_caster(occupied, field.geometry)
    if isinstance(config, BeamConfig):
        values = config.model_dump(exclude={"kind", "beam_weight"})
        model, share = BeamModel(caster, BeamMixture(**values)), config.beam_weight
        return lambda beams, poses: share * model.log_likelihood(beams, poses)
    sigma_m = config.sigma_m
    return lambda beams, poses: range_difference_log_likelihood(caster, beams, poses, sigma_m)
