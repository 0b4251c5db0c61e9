"""Lidar SLAM shared by methods: scan tracking, loop closure, sessions, consistency of the map."""
