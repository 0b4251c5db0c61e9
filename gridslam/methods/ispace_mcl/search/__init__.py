"""The search for the robot in the whole map, and the hypotheses that it leaves."""
