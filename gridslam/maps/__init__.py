"""Occupancy grids in memory and on disk. A cell (row, col) counts from the lower-left corner."""
