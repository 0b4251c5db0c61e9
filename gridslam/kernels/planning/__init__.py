"""Compiled kernels of path planning: clearance, costs over cells, pose search, path improvement, tours."""
