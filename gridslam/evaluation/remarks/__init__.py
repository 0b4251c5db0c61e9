"""Remarks on a result that looks wrong, with the likely cause."""
