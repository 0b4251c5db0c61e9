"""Readers of what is compared: trajectories, relations, objects, and the folders of runs and truths."""
