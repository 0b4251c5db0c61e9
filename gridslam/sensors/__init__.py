"""Sensor models: lidar beams, infrared rangers, fixed cameras, stereo heads, RFID antennas."""
