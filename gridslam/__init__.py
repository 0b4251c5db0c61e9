"""Occupancy mapping, SLAM and localization from recorded sensor logs."""

__version__ = "0.1.0"
