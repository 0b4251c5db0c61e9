"""Recordings of ROS: bags of ROS 1, databases and folders of rosbag2."""
