"""Pose graphs over relative poses."""
