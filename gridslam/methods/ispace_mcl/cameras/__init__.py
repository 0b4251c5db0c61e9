"""Fixed cameras: frames, what moves in them, and what that says about the robot."""
