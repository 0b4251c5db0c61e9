"""Text logs: CARMEN, and those of Wean Hall."""
