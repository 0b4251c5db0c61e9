"""Models of motion: odometry, wheels and gyro, absolute poses, visual odometry."""
