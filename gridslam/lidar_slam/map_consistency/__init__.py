"""Consistency of a finished map with its own scans: a calibrated measure of doubt that needs no ground truth."""
