"""handmap-slam: SLAM with a hand-drawn map as prior."""
