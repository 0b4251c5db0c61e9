"""The first scans of a log against its odometry, gyro and extrinsics: what contradicts is corrected, and said."""
