"""Tagged objects: reads and scans give each its pose, its state and its history."""
