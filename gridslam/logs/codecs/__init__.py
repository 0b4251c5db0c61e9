"""One module a message kind: which messages are usable, and their form in ROS messages and CSV rows."""
