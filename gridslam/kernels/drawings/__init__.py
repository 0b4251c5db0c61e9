"""Scans and places laid into a hand-drawn map whose scale is unknown and differs from place to place."""
