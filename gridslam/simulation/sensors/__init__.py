"""Simulated sensors: each has a schedule, errors of its own, and a stream of random numbers."""
