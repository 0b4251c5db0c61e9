"""The built-in configurations: one per method, `paper/` (the papers' own settings), `worlds/` (simulated)."""
