"""Occupancy mapping from stereo with occlusion and obstacle size in the likelihood."""
