"""Compiled loops over bare arrays: the only home of numba."""
