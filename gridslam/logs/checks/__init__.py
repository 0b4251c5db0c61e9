"""Messages that contradict themselves: found, repaired where that is certain, and named."""
