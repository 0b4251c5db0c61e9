"""Closed loop: where to observe from, in which order, and how to drive there."""
