"""Public datasets as they are downloaded: KITTI odometry, EuRoC, TUM RGB-D."""
