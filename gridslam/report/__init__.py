"""Writes run directories: map, trajectory, tables, report."""
