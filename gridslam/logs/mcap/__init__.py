"""MCAP files: records, reading past damage, writing."""
