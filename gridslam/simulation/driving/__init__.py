"""The simulated robot: its wheels, its driver and its route."""
