"""Matching of points: point-to-line ICP and line segments."""
