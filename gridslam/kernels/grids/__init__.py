"""Grids of cells: tiles of many maps in one pool, rays through cells, evidence of beams, what one place sees of another."""
