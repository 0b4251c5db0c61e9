"""Run configurations: strict models, the loader, and errors that name the key."""
