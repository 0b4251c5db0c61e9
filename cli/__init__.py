"""The command line: the one part that prints, and that turns errors into exit codes."""
