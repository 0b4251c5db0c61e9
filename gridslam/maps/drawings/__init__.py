"""Hand-drawn maps: from a picture or a photograph to walls and free space, and what was ignored."""
