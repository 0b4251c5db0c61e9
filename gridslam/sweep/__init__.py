"""Sweeps: runs over logs or worlds x configs x overrides x seeds, their measures and tables."""
