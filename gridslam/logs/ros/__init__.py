"""ROS messages, in CDR or JSON: types, decoding, encoding, streams."""
