"""Consistency of a finished map with the scans that it was made of: a calibrated measure of doubt, without any truth."""
