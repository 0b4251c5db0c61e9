"""Poses, messages, trajectories, errors and random streams: what every other part speaks."""
