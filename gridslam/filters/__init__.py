"""Parts of particle filters: weights, resampling, KLD sampling, kernel densities."""
