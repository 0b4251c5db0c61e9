"""The simulator: worlds, a robot and its sensors, and the logs with ground truth that they give."""
