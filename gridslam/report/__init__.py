"""The run directory: map, trajectory, tables, report."""
