"""Folders of CSV files, described by log.yaml."""
