"""Extrinsics of the sensors of a log, and scans that depend on them: levelled, from moving mounts, from point clouds."""
