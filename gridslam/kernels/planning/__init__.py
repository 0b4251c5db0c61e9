"""Kernels of path planning: grids, clearance, arcs, search, tours."""
