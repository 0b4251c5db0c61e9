"""Scores of many poses on one map, and the steps of the particle filter."""
