"""Several drives through one place as one map: what a run leaves behind, and how another drive continues it."""
