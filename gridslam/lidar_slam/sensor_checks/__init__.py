"""Checks of the first scans of a log against odometry, gyro and extrinsics. Contradictions are corrected and reported."""
