"""Checks for messages that contradict themselves. Contradictions are reported, and repaired if the remedy is certain."""
