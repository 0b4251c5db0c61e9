"""The methods, one package each, found by name in the registry."""
