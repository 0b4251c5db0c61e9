"""How far a result is from the truth: trajectories, relations, maps, objects, and gates over the measures.

The measures know no files: `files`, `object_files` and `run_files` read, `document` puts the measures together.
"""
