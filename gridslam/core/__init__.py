"""Basic types of all other packages: poses, messages, trajectories, errors, random streams."""
