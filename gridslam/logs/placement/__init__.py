"""Where sensors are mounted, and what they see once that is known."""
