"""stereo-bayes: from disparities to the evidence of a frame for the cells around the robot."""
