"""Mapping and localization with infrared rangers on servos."""
